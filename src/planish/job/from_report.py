"""A finished restoration found again: its scan and its settings, from the report and the files beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from planish.errors import InputError, UsageError
from planish.io import fingerprints
from planish.io.files import is_tifxyz, read_bytes
from planish.settings import RestoreSettings, Units

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Again:
    """What a restoration was made from.

    Attributes
    ----------
    scan : Path
    photo, camera : tuple of Path
        The other files that were read, as far as they are no part of the scan.
    units : {"auto", "mm", "cm", "m", "in"}
    settings : RestoreSettings
    size_mm : (float, float) or None
        Of the page that came out, where there is a report.
    """

    scan: Path
    photo: tuple[Path, ...] = ()
    camera: tuple[Path, ...] = ()
    units: Units = "auto"
    settings: RestoreSettings = field(default_factory=RestoreSettings)
    size_mm: tuple[float, float] | None = None


def find_again(result: Path) -> Again:
    """Find what is needed to make a restoration once more.

    Parameters
    ----------
    result : Path
        A scan; a report; or a folder with a report.json and the files that it was made from.

    Raises
    ------
    InputError
        Where there is no report, or a file that it names is not there or no longer the same.
    """
    if result.is_dir() and not is_tifxyz(result):
        if not (result / "report.json").is_file():
            raise InputError(f"{result} has no report.json, so nothing tells which scan to show; name the scan itself")
        result = result / "report.json"
    if result.suffix.lower() != ".json":
        return Again(scan=result)
    report = _report(result)
    scan, *others = _sources(result, report)
    page, unit = report["page"], report["scan"]["unit"]
    return Again(
        scan=scan,
        photo=tuple(path for path in others if path.suffix.lower() != ".json"),
        camera=tuple(path for path in others if path.suffix.lower() == ".json"),
        units=unit if unit in get_args(Units) else "auto",
        settings=_made(RestoreSettings, report.get("settings") or {}),
        size_mm=(page["width_mm"], page["height_mm"]),
    )


def _report(path: Path) -> dict[str, Any]:
    try:
        report = json.loads(read_bytes(path))
    except (ValueError, RecursionError):
        report = None
    wanted = {"sources": dict, "page": dict, "scan": dict}
    if not isinstance(report, dict) or not all(isinstance(report.get(key), kind) for key, kind in wanted.items()):
        raise InputError(f"{path} is not a report of planish; give a scan, or the folder of a restoration")
    numbers = (report["page"].get("width_mm"), report["page"].get("height_mm"))
    if not all(isinstance(number, int | float) for number in numbers) or "unit" not in report["scan"]:
        raise InputError(f"{path} is not a whole report of planish: the page has no size; restore the scan anew")
    return report


def _sources(path: Path, report: Mapping[str, Any]) -> list[Path]:
    """The files that a report was made from: beside it, and unchanged."""
    if not report["sources"]:
        raise InputError(f"{path} does not tell which files it was made from; give the scan itself")
    found = []
    for name, digest in report["sources"].items():
        beside = path.parent / Path(name).name
        if not beside.exists():
            raise InputError(
                f"{path} was made from {name}, which is not beside it; put it there, or give the scan itself"
            )
        if list(fingerprints([beside]).values()) != [digest]:
            raise InputError(f"{beside} is no longer the file that {path.name} was made from; restore it anew")
        found.append(beside)
    return found


def _made(kind: type[T], plain: Mapping[str, Any]) -> T:
    """Settings from their JSON; what an older or newer version does not know keeps its default."""
    kinds = get_type_hints(kind)
    given: dict[str, Any] = {}
    for name in {f.name for f in fields(kind)} & set(plain):  # type: ignore[arg-type]
        value, options = plain[name], get_args(kinds[name]) if get_origin(kinds[name]) is Literal else ()
        if options and value not in options:
            raise InputError(f"the report has {name} {value!r}, which this version of planish does not know")
        nested = is_dataclass(kinds[name]) and isinstance(value, dict)
        given[name] = _made(kinds[name], value) if nested else value
    try:
        return kind(**given)
    except (TypeError, UsageError) as problem:
        raise InputError(f"the settings in the report are not those of this version: {problem}") from None
