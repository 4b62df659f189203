"""Items of a batch from a list file: CSV with a header line, or JSON Lines."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterator
from pathlib import Path, PurePath, PureWindowsPath
from typing import Any

from planish.batch.items import MAX_NAME_BYTES, RESERVED, Item, ScanList, conflicting_names, safe_name
from planish.errors import InputError
from planish.io.files import read_bytes
from planish.io.units import is_unit
from planish.settings import MESH_SUFFIXES

COLUMNS = ("scan", "photo", "camera", "name", "units")


def read_list(path: Path) -> ScanList:
    r"""Read a list of scans.

    Parameters
    ----------
    path : Path
        .csv with a header line, or .jsonl; column `scan`, and optionally `photo`, `camera` (several as a JSON list,
        in CSV separated by ;), `name`, `units`. Paths are relative to the folder of the list. The default name is the
        path of the scan as listed, without suffix.

    Raises
    ------
    InputError
        If a line cannot be parsed, or two items have the same name.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(f"{folder}/scans.csv").write_text("scan,photo\na/1.ply,a/1.jpg\n")
    ...     item = read_list(Path(f"{folder}/scans.csv")).items[0]
    ...     item.name, item.photo[0].name
    ('a/1', '1.jpg')
    """
    if path.suffix.lower() in MESH_SUFFIXES:
        raise InputError(f"{path} is a single scan, not a folder of scans or a list; use planish restore for it")
    path = path.absolute()  # workers may have another working directory
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path} is not UTF-8 text; save the list as CSV (UTF-8)") from None
    rows = _json_rows(path, text) if path.suffix.lower() in (".jsonl", ".ndjson") else _csv_rows(path, text)
    lines_by_name: dict[str, list[int]] = {}
    items = []
    for line, row in rows:
        item = _item(path, line, row)
        lines_by_name.setdefault(item.name, []).append(line)
        items.append(item)
    if not items:
        raise InputError(f"{path} lists no scan; give one line per scan, with the column scan")
    conflicts = sorted(conflicting_names(item.name for item in items))
    if conflicts:
        lines = ", ".join(str(line) for line in lines_by_name[conflicts[0]])
        raise InputError(
            f"{path}: the name {conflicts[0]} (line {lines}) occurs twice or is a parent folder of another name"
            f"{f', as are {len(conflicts) - 1} others' if len(conflicts) > 1 else ''}; give each scan a unique name"
        )
    return ScanList(sorted(items, key=lambda item: item.name))


def _csv_rows(path: Path, text: str) -> Iterator[tuple[int, dict[str, Any]]]:
    reader = csv.DictReader(text.splitlines(), skipinitialspace=True)
    names = [name.strip().lower() for name in reader.fieldnames or []]
    if "scan" not in names or not set(names) <= set(COLUMNS) or len(set(names)) < len(names):
        raise InputError(
            f"{path}: the first line reads “{', '.join(names)[:100]}”; expected a header with the column scan and any "
            "of photo, camera, name, units"
        )
    reader.fieldnames = names
    try:
        for row in reader:
            if None in row:
                raise InputError(
                    f"{path}, line {reader.line_num}: more fields than the {len(names)} columns of the header"
                )
            yield reader.line_num, row
    except csv.Error as problem:
        raise InputError(f"{path}, line {reader.line_num}: {problem}") from None


def _json_rows(path: Path, text: str) -> Iterator[tuple[int, dict[str, Any]]]:
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        try:
            row = json.loads(line)
        except (ValueError, RecursionError) as problem:
            raise InputError(f"{path}, line {number} is not valid JSON: {problem}") from None
        if not isinstance(row, dict) or not set(row) <= set(COLUMNS):
            raise InputError(f"{path}, line {number}: expected an object with scan and any of {', '.join(COLUMNS[1:])}")
        yield number, row


def _item(path: Path, line: int, row: dict[str, Any]) -> Item:
    location = f"{path}, line {line}"
    scans, photos, cameras = (_paths(path, location, row, column) for column in ("scan", "photo", "camera"))
    if len(scans) != 1:
        raise InputError(f"{location} names {len(scans)} scans; expected one")
    units = row.get("units") or "auto"
    if units != "auto" and not (isinstance(units, str) and is_unit(units)):
        raise InputError(f"{location}: units is {units!r}; expected auto, mm, cm, m, in or a length such as 7.91um")
    name = row.get("name")
    if name:
        _check_name(location, name)
    else:
        name = default_name(path.parent, scans[0])
    return Item(name=name, scan=scans[0], photo=photos, camera=cameras, units=units)


def _paths(path: Path, location: str, row: dict[str, Any], column: str) -> tuple[Path, ...]:
    value = row.get(column)
    paths = [part.strip() for part in value.split(";")] if isinstance(value, str) else value or []
    if not isinstance(paths, list) or not all(isinstance(part, str) and "\0" not in part for part in paths):
        raise InputError(f"{location}: {column} is {value!r}; expected a path or a list of paths")
    return tuple(_located(path.parent, part) for part in paths if part)


def _located(folder: Path, name: str) -> Path:
    """A file of the list; one that was written on Windows has other separators, which Linux takes for letters."""
    found = folder / name
    if "\\" in name and not os.path.lexists(found):
        other = folder / PureWindowsPath(name).as_posix()
        found = other if os.path.lexists(other) else found
    return found


def _check_name(location: str, name: Any) -> None:
    good = isinstance(name, str) and not name.startswith("/") and "//" not in f"{name}/"
    parts = name.split("/") if good else []
    if not good or name in RESERVED or any(safe_name(p) != p or p in (".", "..") or p[0] == "." for p in parts):
        raise InputError(
            f"{location}: {str(name)[:MAX_NAME_BYTES]!r} is not a valid folder name; use letters, digits, - and _, and "
            "/ for subfolders"
        )


def default_name(folder: PurePath, scan: PurePath) -> str:
    r"""Name from the path of the scan, relative to the folder of the list if possible.

    Examples
    --------
    >>> default_name(PureWindowsPath(r"D:\lists"), PureWindowsPath(r"D:\lists\box 1\a.obj"))
    'box 1/a'
    >>> default_name(Path("/lists"), Path("/scans/box 1/a.obj"))
    'scans/box 1/a'
    """
    below = scan.relative_to(folder) if scan.is_relative_to(folder) else scan
    parts = [part for part in below.with_suffix("").parts if part not in (below.anchor, "..", ".")]
    return safe_name("/".join(parts) or scan.name)
