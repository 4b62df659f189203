"""Points from text: x y z in each line, and PTX, which adds rows, columns and the scanner's place."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from planish.errors import InputError
from planish.io.filecloud import FileCloud, as_colours, as_grey
from planish.io.text import as_text
from planish.io.units import unit_named_in
from planish.types import Diagnostic, Floats, Pixels

_SIZE = re.compile(r"\b(?:width|cols|columns)\s*[:=]?\s*(\d+)[\s,;]+(?:height|rows)\s*[:=]?\s*(\d+)", re.I)
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?\Z")
_WHOLE = re.compile(r"[-+]?\d+\Z")
_LINES_LOOKED_AT = 200
_HEAD_LINES = 10
"""Of a PTX: columns, rows, the scanner's place, its three axes, and a matrix of four rows."""


def read_xyz(path: Path, data: bytes) -> FileCloud:
    """Read x y z and perhaps more from each line, parted by blanks, commas, semicolons or tabs.

    Where the others part them and x, y and z each have a comma, these are decimal commas.
    Three further columns, or the last three of more, are colours if they are whole numbers from 0 to 255; a single one
    is the strength of the echo. Lines that begin with # or // are comments, and so is a first line of column names;
    a comment may tell ``width 640 height 480`` and ``units: mm``.

    Raises
    ------
    InputError
        If a line holds something else, or the lines are not alike.
    """
    text = as_text(data)
    lines = text.splitlines()
    head = [line for line in lines[:100] if line.lstrip().startswith(("#", "//"))]
    body = [line for line in lines if line.strip() and not line.lstrip().startswith(("#", "//"))]
    if body and re.match(r"\s*[\"']?[A-Za-z_]", body[0]) and not re.match(r"\s*[+-]?(nan|inf)\b", body[0], re.I):
        head.append(body.pop(0))
    numbers = _table(path, body)
    if len(numbers) and numbers.shape[1] < 3:
        raise InputError(f"{path} has {numbers.shape[1]} numbers in each line; x y z, three or more, are wanted")
    size = _SIZE.search("\n".join(head))
    shape_rc = (int(size[2]), int(size[1])) if size else None
    unit = unit_named_in("\n".join(head))
    return FileCloud(numbers[:, :3], _colours(numbers), shape_rc=shape_rc, unit=unit)


def read_ptx(path: Path, data: bytes) -> FileCloud:
    """Read the first range image of a PTX, in metres, moved to where its matrix puts it.

    Its points stand column after column, from below; what was not seen is 0 0 0.

    Raises
    ------
    InputError
        If the head is not that of a PTX, or points are missing.
    """
    lines = data.decode("ascii", "replace").splitlines()
    head = [_head_line(path, number, line) for number, line in enumerate(lines[:_HEAD_LINES], 1)]
    lengths = [len(numbers) for numbers in head]
    if lengths != [1, 1, 3, 3, 3, 3, 4, 4, 4, 4]:
        raise InputError(
            f"{path} begins with rows and columns as a PTX does, but not with its ten lines of head (place, axes and"
            " matrix of the scanner); was it cut short?"
        )
    cols, rows = int(head[0][0]), int(head[1][0])
    body = lines[_HEAD_LINES : _HEAD_LINES + rows * cols]
    if len(body) < rows * cols:
        raise InputError(
            f"{path} tells {cols} columns and {rows} rows, but {len(body)} points follow; was the file cut short?"
        )
    numbers = _table(path, body, first_line=1 + _HEAD_LINES)
    if numbers.shape[1] < 3:
        raise InputError(f"{path} has {numbers.shape[1]} numbers a point; x y z, three or more, are wanted")
    numbers = numbers.reshape(cols, rows, -1)[:, ::-1].swapaxes(0, 1).reshape(rows * cols, -1)
    matrix = np.array(head[6:])
    seen = numbers[:, :3].any(axis=1, keepdims=True)
    points = np.where(seen, numbers[:, :3] @ matrix[:3, :3] + matrix[3, :3], np.nan)
    left = len(lines) - _HEAD_LINES - rows * cols
    several = Diagnostic("several-scans", f"{path} holds further scans; the first was taken")
    warnings = [several] if left > _HEAD_LINES else []
    return FileCloud(points, _colours(numbers), None, (rows, cols), matrix[3, :3], "m", warnings)


def _head_line(path: Path, number: int, line: str) -> list[float]:
    try:
        return [float(word) for word in line.split()]
    except ValueError:
        raise InputError(f"{path}: line {number} of its head holds “{line[:40]}”; numbers are wanted") from None


def _table(path: Path, lines: list[str], first_line: int = 0) -> Floats:
    """The numbers of lines that all hold as many."""
    if not lines:
        return np.zeros((0, 3))
    comma = "." if _has_decimal_commas(lines) else " "
    plain = [line.translate({ord(","): comma, ord(";"): " ", ord("\t"): " "}) for line in lines]
    try:
        return np.loadtxt(plain, np.float64, comments=None, ndmin=2)
    except ValueError:
        raise InputError(f"{path} {_odd_line(plain, first_line)}") from None


def _has_decimal_commas(lines: list[str]) -> bool:
    """Whether commas stand in numbers, as in 12,5: where semicolons, tabs or blanks part them and x, y, z have one."""
    for line in lines[:: max(1, len(lines) // _LINES_LOOKED_AT)]:
        words = [word for word in re.split(r"[;\s]+", line.strip()) if word]
        if len(words) < 3 or not all(_DECIMAL_COMMA.match(word) for word in words[:3]):
            return False
        if not all(_DECIMAL_COMMA.match(word) or _WHOLE.match(word) for word in words[3:]):
            return False
    return True


def _odd_line(lines: list[str], first_line: int) -> str:
    """What is wrong with the first line that is no row of numbers like the first."""
    wanted = len(lines[0].split())
    where = "line" if first_line else "line of points"
    for number, line in enumerate(lines, first_line or 1):
        words = line.split()
        for word in words:
            try:
                float(word)
            except ValueError:
                return f"is no text of points: {where} {number} holds “{word[:40]}”, which is no number"
        if len(words) != wanted:
            return f"has {wanted} numbers in its first line, but {len(words)} in {where} {number}; was it cut short?"
    return "is no text of points: its lines hold no numbers"


def _colours(numbers: Floats) -> Pixels | None:
    more = numbers[:, 3:]
    if more.shape[1] in (1, 2):
        return as_grey(more[:, 0])
    if more.shape[1] < 3:
        return None
    for last in (more[:, -3:], more[:, :3]):
        if (last >= 0).all() and (last <= 255).all() and (last == np.rint(last)).all() and last.max() > 1:
            return as_colours([channel.astype(np.uint8) for channel in last.T])
    return None
