"""Recover the inputs and settings of a restoration from its report.json and the files beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from planish.errors import InputError, UsageError
from planish.io import fingerprints
from planish.io.files import is_tifxyz, read_bytes
from planish.io.units import is_unit
from planish.job.settings_codec import decode_settings
from planish.settings import RestoreSettings, Units


@dataclass(frozen=True, kw_only=True)
class JobInputs:
    """Inputs and settings of a restoration.

    Attributes
    ----------
    scan : Path
    photo, camera : tuple of Path
        Further input files that are not part of the scan.
    sheet : Path or None
        Mask of the sheet.
    units : str
    settings : RestoreSettings
    size_mm : (float, float) or None
        Size of the page according to the report, if there is one.
    """

    scan: Path
    photo: tuple[Path, ...] = ()
    camera: tuple[Path, ...] = ()
    sheet: Path | None = None
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
    page, unit, mask = report["page"], report["scan"]["unit"], report["scan"].get("sheet_mask")
    sheet = next((path for path in reversed(others) if path.name == mask), None)
    others = [path for path in others if path is not sheet]
    return JobInputs(
        scan=scan,
        photo=tuple(path for path in others if path.suffix.lower() != ".json"),
        camera=tuple(path for path in others if path.suffix.lower() == ".json"),
        sheet=sheet,
        units=unit if isinstance(unit, str) and is_unit(unit) else "auto",
        settings=_read_settings(result, report.get("settings") or {}),
        size_mm=(page["width_mm"], page["height_mm"]),
    )


def _read_report(path: Path) -> dict[str, Any]:
    data = read_bytes(path)
    try:
        report = json.loads(data)
    except (ValueError, RecursionError):
        report = None
    required = {"sources": dict, "page": dict, "scan": dict}
    if not isinstance(report, dict) or not all(isinstance(report.get(key), kind) for key, kind in required.items()):
        raise InputError(f"{path} is not a report of planish; give a scan, or the folder of a restoration")
    numbers = (report["page"].get("width_mm"), report["page"].get("height_mm"))
    if not all(isinstance(number, int | float) for number in numbers) or "unit" not in report["scan"]:
        raise InputError(f"{path} is not a complete report of planish: the page has no size; restore the scan again")
    return report


def _find_sources(path: Path, report: Mapping[str, Any]) -> list[Path]:
    """Input files named by a report, checked to be beside it and unchanged (SHA-256)."""
    if not report["sources"]:
        raise InputError(f"{path} does not list its source files; give the scan itself")
    paths = []
    for name, digest in report["sources"].items():
        path_beside = path.parent / Path(name).name
        if not path_beside.exists():
            raise InputError(
                f"{path} was made from {name}, which is not beside it; put it there, or give the scan itself"
            )
        if list(fingerprints([path_beside]).values()) != [digest]:
            raise InputError(f"{path_beside} has changed since {path.name} was written; restore it again")
        paths.append(path_beside)
    return paths


def _read_settings(path: Path, values: object) -> RestoreSettings:
    try:
        return decode_settings(RestoreSettings, values)
    except UsageError as problem:
        raise InputError(f"{path} has settings that this version of planish does not know: {problem}") from None
