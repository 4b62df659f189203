"""The JSON schema of the report, held against reports as they are written."""

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest

from planish.io import write_json
from planish.pipeline import restore
from planish.settings import RestoreSettings
from planish.types import Diagnostic, PhotoReport, Scan

SCHEMA = json.loads((Path(__file__).parent.parent / "docs" / "report.schema.json").read_text())


@pytest.fixture(scope="module")
def scan(book_scan):
    return book_scan.scan


@pytest.fixture(scope="module")
def report(scan):
    return restore(scan, RestoreSettings(pages="2")).report


@pytest.fixture
def written(tmp_path):
    """A report as it comes back from its file."""

    def write(report):
        write_json(tmp_path / "report.json", report)
        return json.loads((tmp_path / "report.json").read_text())

    return write


def check(report):
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    jsonschema.validate(report, SCHEMA)


@pytest.mark.slow
def test_reports_of_every_kind_fit_it(scan, report, written):
    photo = PhotoReport("shading", "unknown", 1000.0, "assumed", 0, 0, None, None, 0.5, "A guess.")
    geometry = restore(Scan(scan.mesh)).report
    for kind in (report, geometry, replace(report, photo=photo, sources={"scan.obj": "0" * 64})):
        check(written(kind))
    assert report.spine is not None  # so that all parts were looked at
    assert report.shading is not None
    assert report.guideline is not None


def test_numbers_that_are_not_finite_are_null(report, written):
    burst = written(replace(report, flatten=replace(report.flatten, strain_rms=float("nan"), strain_max=float("inf"))))
    assert burst["flatten"]["strain_rms"] is burst["flatten"]["strain_max"] is None
    check(burst)


@pytest.mark.parametrize("key", ["outcome", "settled", "warnings", "flatten", "page"])
def test_a_key_left_out_is_found(report, written, key):
    short = written(report)
    del short[key]
    with pytest.raises(jsonschema.ValidationError, match=f"'{key}' is a required property"):
        check(short)


def test_a_word_for_a_number_is_found(report, written):
    wrong = written(report)
    wrong["page"]["width_mm"] = "216 mm"
    with pytest.raises(jsonschema.ValidationError, match="is not of type 'number', 'null'"):
        check(wrong)


def test_warnings_are_sentences_with_their_codes_beside_them(report, written):
    unsure = Diagnostic("unit-guessed", "the numbers were taken as mm", "set {units} if that is wrong")
    told = written(replace(report, warnings=[unsure]))
    check(told)
    assert told["warnings"] == ["the numbers were taken as mm; set units if that is wrong"]
    assert told["warning_codes"] == ["unit-guessed"]
