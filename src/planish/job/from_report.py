"""Recover the inputs and settings of a restoration from its report.json and the files beside it."""

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
class JobInputs:
    """Inputs and settings of a restoration.

    Attributes
    ----------
    scan : Path
    photo, camera : tuple of Path
        Further input files that are not part of the scan.
    units : {"auto", "mm", "cm", "m", "in"}
    settings : RestoreSettings
    size_mm : (float, float) or None
        Size of the page according to the report, if there is one.
    """

    scan: Path
    photo: tuple[Path, ...] = ()
    camera: tuple[Path, ...] = ()
    units: Units = "auto"
    settings: RestoreSettings = field(default_factory=RestoreSettings)
    size_mm: tuple[float, float] | None = None


def inputs_from_report(result: Path) -> JobInputs:
    """Recover what is needed to repeat a restoration.

    Parameters
    ----------
    result : Path
        A scan; a report; or a folder that holds report.json and the input files.

    Raises
    ------
    InputError
        If there is no report, or an input file is missing or has changed since.
    """
    if result.is_dir() and not is_tifxyz(result):
        if not (result / "report.json").is_file():
            raise InputError(f"{result} has no report.json that names the scan; give the scan itself")
        result = result / "report.json"
    if result.suffix.lower() != ".json":
        return JobInputs(scan=result)
    report = _read_report(result)
    scan, *others = _find_sources(result, report)
    page, unit = report["page"], report["scan"]["unit"]
    return JobInputs(
        scan=scan,
        photo=tuple(path for path in others if path.suffix.lower() != ".json"),
        camera=tuple(path for path in others if path.suffix.lower() == ".json"),
        units=unit if unit in get_args(Units) else "auto",
        settings=_decode(RestoreSettings, report.get("settings") or {}),
        size_mm=(page["width_mm"], page["height_mm"]),
    )


def _read_report(path: Path) -> dict[str, Any]:
    data = read_bytes(path)
    try:
        report = json.loads(data)
    except (ValueError, RecursionError):
        report = None
    wanted = {"sources": dict, "page": dict, "scan": dict}
    if not isinstance(report, dict) or not all(isinstance(report.get(key), kind) for key, kind in wanted.items()):
        raise InputError(f"{path} is not a report of planish; give a scan, or the folder of a restoration")
    numbers = (report["page"].get("width_mm"), report["page"].get("height_mm"))
    if not all(isinstance(number, int | float) for number in numbers) or "unit" not in report["scan"]:
        raise InputError(f"{path} is not a whole report of planish: the page has no size; restore the scan anew")
    return report


def _find_sources(path: Path, report: Mapping[str, Any]) -> list[Path]:
    """Input files named by a report, checked to be beside it and unchanged (SHA-256)."""
    if not report["sources"]:
        raise InputError(f"{path} does not tell which files it was made from; give the scan itself")
    paths = []
    for name, digest in report["sources"].items():
        path_beside = path.parent / Path(name).name
        if not path_beside.exists():
            raise InputError(
                f"{path} was made from {name}, which is not beside it; put it there, or give the scan itself"
            )
        if list(fingerprints([path_beside]).values()) != [digest]:
            raise InputError(f"{path_beside} is no longer the file that {path.name} was made from; restore it anew")
        paths.append(path_beside)
    return paths


def _decode(kind: type[T], plain: Mapping[str, Any]) -> T:
    """Settings from their JSON; what an older or newer version does not know keeps its default."""
    kinds = get_type_hints(kind)
    given: dict[str, Any] = {}
    for name in {f.name for f in fields(kind)} & set(plain):  # type: ignore[arg-type]
        value, options = plain[name], get_args(kinds[name]) if get_origin(kinds[name]) is Literal else ()
        if options and value not in options:
            raise InputError(f"the report has {name} {value!r}, which this version of planish does not know")
        nested = is_dataclass(kinds[name]) and isinstance(value, dict)
        given[name] = _decode(kinds[name], value) if nested else value
    try:
        return kind(**given)
    except (TypeError, UsageError) as problem:
        raise InputError(f"the settings in the report are not those of this version: {problem}") from None
