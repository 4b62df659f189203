"""Warnings and hints as values: codes are listed, settings in hints exist, and the library names no flags."""

import ast
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from planish import errors
from planish.cli.main import run
from planish.hints import as_field, as_flag, as_parameter
from planish.io.units import decide_unit
from planish.types import Diagnostic

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "src" / "planish"
FRONT_ENDS = ("cli", "web", "batch")
"""Rooms that talk to a user in the terms of their own; Tesseract's flag in io/ocr.py is not ours."""


def trees():
    for path in sorted(SOURCE.rglob("*.py")):
        yield path.relative_to(SOURCE), ast.parse(path.read_text())


def texts(tree):
    """Strings of a module that are no docstrings; the parts of joined ones together, values as x."""
    docstrings = {
        id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(part.value if isinstance(part, ast.Constant) else "x" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings | inside:
            yield node.value


def codes():
    calls = [
        node
        for _, tree in trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Diagnostic"
    ]
    return {ast.literal_eval(call.args[0]) for call in calls}


@pytest.mark.slow
def test_every_code_is_documented_and_every_documented_code_exists():
    section = (ROOT / "docs" / "errors.md").read_text().split("## Warnings")[1]
    assert set(re.findall(r"^\| `([a-z0-9-]+)` \|", section, re.MULTILINE)) == codes()


@pytest.mark.slow
def test_the_library_names_no_flags():
    named = {
        (str(path), text)
        for path, tree in trees()
        if path.parts[0] not in (*FRONT_ENDS, "hints.py")
        for text in texts(tree)
        if re.search(r"(?<![\w-])--[a-z]", text)
    }
    assert {path for path, _ in named} <= {"io/ocr.py"}, named


@pytest.mark.slow
def test_settings_in_hints_are_flags_of_the_command_line():
    pages = (ROOT / "docs").glob("cli*.md")
    known = {flag for page in pages for flag in re.findall(r"--[a-z0-9.-]+", page.read_text())}
    used = {
        as_flag(name)
        for path, tree in trees()
        if path.parts[0] not in (*FRONT_ENDS, "hints.py")
        for text in texts(tree)
        for name in re.findall(r"(?<!\{)\{([a-z_][\w.]*)(?:=[^{}]*)?\}", text)
    }
    assert {"--units", "--dpi", "--verlet.self-collision", "--as"} <= used
    assert used <= known, used - known


@pytest.mark.parametrize(
    ("naming", "sentence"),
    [
        (as_parameter, "found; set units or as_=uv"),
        (as_flag, "found; set --units or --as uv"),
        (as_field, "found; set the field units or the field as to uv"),
    ],
)
def test_each_front_end_names_settings_its_own_way(naming, sentence):
    assert Diagnostic("odd", "found", "set {units} or {as_=uv}").message(naming) == sentence
    assert errors.InputError("found", "set {units} or {as_=uv}").message(naming) == sentence


def test_braces_in_file_names_stay():
    warning = Diagnostic("odd", "{units}.obj names no unit", "set {units}")
    assert warning.message(as_flag) == "{units}.obj names no unit; set --units"


def test_python_and_the_command_line_tell_the_same_in_their_own_terms(tmp_path, capsys):
    points = np.array([[0.0, 0.0, 0.0], [0.21, 0.0, 0.0], [0.0, 0.297, 0.0]])
    _, (warning,) = decide_unit(points, "auto", None)
    assert warning.code == "unit-guessed"
    assert str(warning).endswith("; set units if that is wrong")
    (tmp_path / "sheet.obj").write_text("v 0 0 0\nv 0.21 0 0\nv 0 0.297 0\nf 1 2 3\n")
    run(["flatten", str(tmp_path / "sheet.obj"), "-o", str(tmp_path / "flat.obj")])
    assert "; set --units if that is wrong" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "builtin"),
    [
        (errors.UsageError, ValueError),
        (errors.InputError, ValueError),
        (errors.OutputError, OSError),
        (errors.MissingExtraError, errors.PlanishError),
    ],
)
def test_errors_are_builtin_ones_too_and_keep_their_hint_between_processes(error, builtin):
    with pytest.raises(builtin, match=r"^found; lower dpi$"):
        raise error("found", "lower {dpi}")
    again = pickle.loads(pickle.dumps(error("found", "lower {dpi}")))
    assert (type(again), again.sentence, again.hint) == (error, "found", "lower {dpi}")
