"""Wrong choices are refused when settings are made, and settings come from keywords."""

import dataclasses
import math

import numpy as np
import pytest

import planish
from planish import settings
from planish.choices import CheckedSettings, with_choices
from planish.errors import UsageError
from planish.gallery import sheet, sheet_mesh
from planish.settings import (
    BatchFiles,
    BinarizeSettings,
    FlattenSettings,
    PhotoSettings,
    RenderSettings,
    RestoreSettings,
    ServeSettings,
    ShadingSettings,
    VerletSettings,
)

KINDS = [kind for kind in vars(settings).values() if isinstance(kind, type) and issubclass(kind, CheckedSettings)]
KINDS.remove(CheckedSettings)
FIELDS = [(kind, field.name) for kind in KINDS for field in dataclasses.fields(kind)]


@pytest.mark.parametrize(("kind", "name"), FIELDS)
def test_no_field_of_any_settings_takes_what_is_not_of_its_type(kind, name):
    for wrong in ("slim", object(), math.nan, b"none", [1]):
        with pytest.raises(UsageError, match=rf"^{name} ") as refused:
            kind(**{name: wrong})
        assert str(refused.value).count("expected") == 1
        assert "\n" not in str(refused.value)


def test_there_is_no_settings_class_whose_values_are_not_checked():
    made = [kind for kind in vars(settings).values() if dataclasses.is_dataclass(kind)]
    assert made == KINDS


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: FlattenSettings(method="slim"), "method is 'slim'; expected multigrid or verlet or mass-spring"),
        (lambda: FlattenSettings(points=True), "points is True; expected an integer or all or auto"),
        (lambda: FlattenSettings(points=np.int64(2)), "points must be at least 3"),
        (lambda: FlattenSettings(verlet={"rounds": 3}), "verlet is {'rounds': 3}; expected VerletSettings"),
        (lambda: VerletSettings(rounds=2.5), "rounds is 2.5; expected an integer"),
        (lambda: VerletSettings(gravity=math.inf), "gravity is inf; expected a finite number"),
        (lambda: RestoreSettings(rotate=90), "rotate is 90; .*write it as a text: '90'"),
        (lambda: RenderSettings(dpi="fine"), "dpi is 'fine'; expected a number or auto"),
        (lambda: ShadingSettings(shading=None), "shading is None; expected geometry or background or none"),
        (lambda: BinarizeSettings(binarize="NICK"), "binarize is 'NICK'; expected none or nick"),
        (lambda: PhotoSettings(distance_mm=9, between=("a.jpg", 1, 2, 3)), "between is .*a text, a number, a number"),
        (lambda: BatchFiles(html=1), "html is 1; expected true or false"),
        (lambda: ServeSettings(jobs="2"), "jobs is '2'; expected an integer"),
    ],
)
def test_the_sentence_says_what_was_found_and_what_is_expected(make, sentence):
    with pytest.raises(UsageError, match=sentence):
        make()


def test_numbers_of_numpy_and_whole_numbers_are_taken():
    made = VerletSettings(rounds=np.int32(7), gravity=np.float64(2.5), time_step=1)
    assert (made.rounds, made.gravity, made.time_step) == (7, 2.5, 1)
    assert (type(made.rounds), type(made.gravity)) == (int, float)


def test_settings_come_from_keywords_of_every_stage():
    made = with_choices(
        RestoreSettings(pages="2"),
        {"dpi": 400, "shading": "none", "binarize": "otsu", "k": 0.3, "method": "verlet", "verlet": {"rounds": 10}},
    )
    assert made == RestoreSettings(
        pages="2",
        render=RenderSettings(dpi=400),
        shading=ShadingSettings(shading="none"),
        binarize=BinarizeSettings(binarize="otsu", k=0.3),
        flatten=FlattenSettings(method="verlet", verlet=VerletSettings(rounds=10)),
    )
    given = RenderSettings(dpi=100, sharpen=1)
    assert with_choices(RestoreSettings(), {"render": given, "dpi": 200}).render == RenderSettings(dpi=200, sharpen=1)


@pytest.mark.parametrize(
    ("choices", "sentence"),
    [
        ({"metod": "verlet"}, "no setting 'metod'; did you mean method?"),
        ({"zzz": 1}, "no setting 'zzz'; there are method, lengths"),
        ({"tolerance": 1e-3}, "multigrid and verlet and mass_spring have a setting 'tolerance'; write multigrid="),
        ({"verlet": 10}, "verlet needs an object or a dict with settings: time_step"),
        ({"method": "slim"}, "method is 'slim'"),
    ],
)
def test_keywords_that_are_no_settings_are_refused(choices, sentence):
    mesh, _ = sheet_mesh(sheet("book"), points=100)
    with pytest.raises(UsageError, match=sentence):
        planish.flatten(mesh, **choices)


def test_flatten_and_restore_take_keywords_and_refuse_other_objects_as_settings():
    mesh, _ = sheet_mesh(sheet("book"), points=400)
    flat = planish.flatten(mesh, lengths="straight")
    assert flat.lengths == "straight"
    assert np.array_equal(flat.page_xy, planish.flatten(mesh, settings=FlattenSettings(lengths="straight")).page_xy)
    assert planish.restore(planish.Scan(mesh), lengths="unfolded").flattening.lengths == "unfolded"
    for function, given, wrong in (
        (planish.flatten, mesh, RestoreSettings()),
        (planish.restore, planish.Scan(mesh), FlattenSettings()),
    ):
        with pytest.raises(UsageError, match="settings must be "):
            function(given, settings=wrong)
