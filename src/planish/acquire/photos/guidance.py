"""What to photograph next: the parts of the page that too few photos show."""

from __future__ import annotations

import numpy as np

from planish.acquire.photos.scan import PhotosScan
from planish.types import Diagnostic, Floats

FEW = 2
"""Places that fewer photos see are not measured; with two alone, nothing tells a wrong match."""
PART = 0.25
"""Part of a ninth of the page that must be short of photos for the ninth to be named."""
LITTLE_MEASURED = 0.5
"""Share of the sheet below which what is bridged rules the page's shape."""
NARROW_DEG = 20.0
"""Rays that meet at a narrower angle leave depth three times less sure than place."""

_ROWS = ("upper", "middle", "lower")
_COLUMNS = ("left", "middle", "right")


def what_next(found: PhotosScan, page_xy: Floats, size_mm: tuple[float, float]) -> list[Diagnostic]:
    """Say which further photos would help.

    Parameters
    ----------
    found : PhotosScan
    page_xy : (n, 2) float64 [mm]
        Places of the scan's points on the upright page.
    size_mm : (float, float)

    Returns
    -------
    list of Diagnostic
        Empty where nothing is short of photos.
    """
    notes = []
    ninth = np.clip((3 * page_xy / size_mm).astype(np.int64), 0, 2)
    number = 3 * ninth[:, 1] + ninth[:, 0]
    short = np.bincount(number, found.views < FEW, 9) / np.maximum(np.bincount(number, minlength=9), 1)
    names = [_name(*divmod(k, 3)) for k in np.argsort(-short, kind="stable") if short[k] > PART]
    if names:
        sentence = f"{_listed(names)} of the page {'was' if len(names) == 1 else 'were'} seen by one photo or none"
        notes.append(Diagnostic("photos-missing", sentence, "take two or three more photos from that side"))
    report = found.report
    if report.measured_fraction < LITTLE_MEASURED:
        sentence = (
            f"only {100 * report.measured_fraction:.0f} % of the sheet were measured, the rest is bridged smoothly"
        )
        notes.append(
            Diagnostic("little-measured", sentence, "take the photos from nearer, sharper, or in light from one side")
        )
    if report.angle_deg < NARROW_DEG:
        sentence = (
            f"the photos look at the sheet from nearly one side: their rays meet at {report.angle_deg:.0f} degrees"
        )
        notes.append(Diagnostic("photos-from-one-side", sentence, "walk around it, 20 to 40 degrees off the vertical"))
    return notes


def _name(row: int, column: int) -> str:
    if row == column == 1:
        return "the middle"
    if row == 1:
        return f"the {_COLUMNS[column]} side"
    return f"the {_ROWS[row]} edge" if column == 1 else f"the {_ROWS[row]} {_COLUMNS[column]} corner"


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
