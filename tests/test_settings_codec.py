"""One codec decodes the settings of reports, forms and commands."""

import json
from dataclasses import asdict, replace

import pytest

from planish.cli.restore_options import RestoreOptions
from planish.errors import UsageError
from planish.job.settings_codec import SettingsError, decode_settings
from planish.settings import BinarizeSettings, FlattenSettings, RenderSettings, RestoreSettings, VerletSettings

SETTINGS = RestoreSettings(
    flatten=FlattenSettings(method="verlet", points=800, verlet=VerletSettings(max_steps=50, self_collision=True)),
    render=RenderSettings(dpi=150.0),
    binarize=BinarizeSettings(k="auto"),
    rotate="90",
)


def test_json_is_decoded_to_the_same_settings():
    assert decode_settings(RestoreSettings, json.loads(json.dumps(asdict(SETTINGS)))) == SETTINGS


def test_missing_values_keep_their_defaults_and_unknown_names_are_ignored():
    assert decode_settings(RestoreSettings, {"pages": "2", "of another version": {}}) == RestoreSettings(pages="2")


def test_options_of_a_command_become_settings_without_the_options_about_files():
    options = RestoreOptions(flatten=SETTINGS.flatten, render=SETTINGS.render, rotate="90", pdfa=True, ocr="eng")
    assert options.settings() == replace(SETTINGS, binarize=BinarizeSettings())


def test_strings_are_numbers_and_booleans_only_if_so_asked():
    values = {"render": {"dpi": "150"}, "flatten": {"verlet": {"self_collision": "true"}}}
    settings = decode_settings(RestoreSettings, values, from_strings=True)
    assert (settings.render.dpi, settings.flatten.verlet.self_collision) == (150.0, True)
    with pytest.raises(SettingsError, match=r"^render\.dpi is '150'; expected a number or auto$"):
        decode_settings(RestoreSettings, {"render": {"dpi": "150"}})


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ([], r"^settings is \[\]; expected an object with settings$"),
        ({"render": 3}, "^render is 3; expected an object with settings$"),
        ({"rotate": "45"}, "^rotate is '45'; expected auto or 0 or 90 or 180 or 270$"),
        ({"rotate": "4" * 1000}, r"^rotate is '4{59}\.\.\.; expected"),
        ({"flatten": {"verlet": {"max_steps": 2.5}}}, r"^flatten\.verlet\.max_steps is 2\.5; expected an integer$"),
        ({"flatten": {"verlet": {"gravity": float("inf")}}}, r"^flatten\.verlet\.gravity is inf; expected a finite"),
        ({"flatten": {"verlet": {"max_steps": 0}}}, "^max_steps must be greater than 0, not 0$"),
    ],
)
def test_a_wrong_value_is_named_with_what_was_expected(values, sentence):
    with pytest.raises(UsageError, match=sentence):
        decode_settings(RestoreSettings, values)
