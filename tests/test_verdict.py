"""The verdict of a page: one rule, and the same word and reasons wherever it is shown."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from planish.batch.row import row_from_report
from planish.cli.main import run
from planish.hints import as_flag
from planish.pipeline import restore
from planish.report import graded, summary, usual
from planish.types import Diagnostic, PhotoReport
from planish.types.verdict import ASK_FOR_A_LOOK, SCALE_GUESSED, Evidence, judge
from planish.view.report_html import verdict as verdict_html
from small_scans import write_small_scan

FLAT = Evidence(
    settled=True,
    outcome="The sheet lies flat.",
    strain_rms=1e-4,
    expected_error_mm=0.05,
    shorter_side_mm=200.0,
    flipped=0.0,
    overlaps=0.0,
    known_fraction=0.99,
    rim=0.0,
    warnings=(),
)
OVERLAP, FLIP = Diagnostic("faces-overlap", "9 faces overlap"), Diagnostic("faces-flipped", "9 faces")


@pytest.mark.parametrize(
    ("change", "word", "codes"),
    [
        ({}, "good", []),
        ({"known_fraction": None}, "good", []),
        ({"warnings": [Diagnostic("points-welded", "3 points were welded")]}, "good", []),
        ({"strain_rms": 0.009}, "good", []),
        ({"strain_rms": 0.011}, "look at it", ["strain-high"]),
        ({"strain_rms": 0.021}, "not good", ["strain-high"]),
        ({"known_fraction": 0.94, "rim": 0.02}, "good", []),
        ({"known_fraction": 0.94}, "look at it", ["page-little-seen"]),
        ({"known_fraction": 0.49}, "not good", ["page-little-seen"]),
        ({"expected_error_mm": 1.1}, "look at it", ["error-large"]),
        ({"settled": False}, "not good", ["not-settled"]),
        ({"overlaps": 0.001, "warnings": [OVERLAP]}, "look at it", ["faces-overlap"]),
        ({"overlaps": 0.02, "warnings": [OVERLAP]}, "not good", ["faces-overlap"]),
        ({"flipped": 0.02, "warnings": [FLIP, OVERLAP]}, "not good", ["faces-flipped", "faces-overlap"]),
        ({"warnings": [Diagnostic("unit-guessed", "taken as m")]}, "look at it", ["unit-guessed"]),
        (
            {"settled": False, "warnings": [Diagnostic("surroundings-doubtful", "a table?")], "known_fraction": 0.9},
            "not good",
            ["not-settled", "page-little-seen", "surroundings-doubtful"],
        ),
    ],
)
def test_the_word_follows_from_all_that_is_known(change, word, codes):
    found = judge(replace(FLAT, **change))
    assert (found.word, [reason.code for reason in found.reasons]) == (word, codes)
    assert found.usable == (word != "not good")


def test_the_list_of_codes_is_that_of_the_documentation():
    section = Path(__file__).parent.parent.joinpath("docs", "errors.md").read_text().split("## Warnings")[1]
    rows = re.findall(r"^\| `([a-z0-9-]+)` \| (.*?) \| .* \|([^|]*)\|$", section, re.MULTILINE)
    look = {code for code, of, verdict in rows if verdict.strip() == "look" and of != "verdict"}
    assert look == ASK_FOR_A_LOOK
    assert SCALE_GUESSED <= ASK_FOR_A_LOOK


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A report of a small scan."""
    from planish.io import read_scan

    at = tmp_path_factory.mktemp("small") / "in"
    write_small_scan(at)
    return restore(read_scan(at / "scan.obj").scan).report, at


def test_where_the_size_is_guessed_scale_has_no_stars(done):
    report, _ = done
    names = [criterion.name for criterion in report.guideline.criteria]
    assert "accuracy of scale" in names
    guessed = graded(replace(report, warnings=[Diagnostic("unit-guessed", "taken as m")]))
    assert [criterion.name for criterion in guessed.guideline.criteria] == [n for n in names if "scale" not in n]
    assert any("scale" in name for name in guessed.guideline.not_graded)


def test_the_same_word_and_reasons_everywhere(done):
    report, _ = done
    doubt = Diagnostic("surroundings-doubtful", "a table may be there", "set {sheet=all}")
    report = replace(report, warnings=[Diagnostic("points-welded", "3 points were welded"), doubt])
    plain = report.to_dict()
    assert (plain["verdict"], plain["reason_codes"]) == ("look at it", ["surroundings-doubtful"])
    assert plain["reasons"] == [str(doubt)]
    row = row_from_report("a", report, [], seconds=0, cpu_seconds=0, peak_mb=0)
    assert (row.status, row.reasons) == ("look at it", [doubt.message(as_flag)])
    html = verdict_html(report)
    assert html.index("Look at it") < html.index("A table may be there") < html.index("3 points were welded")
    assert dict(summary(report))["verdict"] == "look at it"
    assert report.notes == [report.warnings[0]]


def test_every_figure_says_what_is_usual(done):
    report, _ = done
    without = [what for what, _ in summary(report) if not usual(what)]
    assert without == ["verdict", "outcome", "scan", "flattened", "FADGI 2016", "seconds"]


@pytest.mark.slow
def test_reasons_are_printed_even_if_quiet_and_the_report_has_them(done, tmp_path, capsys):
    _, at = done
    lines = [line.split() for line in (at / "scan.obj").read_text().splitlines() if not line.startswith("#")]
    metres = [["v", *(str(float(x) / 1000) for x in line[1:4])] if line[:1] == ["v"] else line for line in lines]
    for name in ("scan.mtl", "scan.jpg"):
        (tmp_path / name).write_bytes((at / name).read_bytes())
    (tmp_path / "scan.obj").write_text("\n".join(map(" ".join, metres)))
    report = tmp_path / "r.json"
    assert (
        run(["restore", str(tmp_path / "scan.obj"), "-o", str(tmp_path / "p.png"), "--report", str(report), "-q"]) == 0
    )
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("planish: look at it: the file names no unit")
    assert json.loads(report.read_text())["verdict"] == "look at it"


def test_of_one_photo_no_error_is_claimed_and_scale_has_no_stars(done):
    report, _ = done
    photo = PhotoReport("text-lines", "paper", 3000.0, "exif", 20, 500, 0.05, 0.05, 0.0, "Straight.")
    report = graded(replace(report, photo=photo))
    assert dict(summary(report))["expected error"].startswith("not known")
    assert not any("scale" in criterion.name for criterion in report.guideline.criteria)
