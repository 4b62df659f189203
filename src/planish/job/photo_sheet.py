"""The sheet of `planish photo` and of photos sent to the service: from one photo or from several."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from planish.errors import UsageError
from planish.pipeline.stages import Progress
from planish.report import graded
from planish.settings import PhotoSettings
from planish.types import Diagnostic, Floats, Pixels, Report, Restoration, Scan

SAME_SHAPE = 0.01
"""Relative difference of proportions that rounding to pixels may make."""


@dataclass(frozen=True, eq=False)
class PhotographedSheet:
    """A scan made from photos, and how the report of its restoration is completed.

    Attributes
    ----------
    scan : Scan
    scaled : bool
        Whether its size is true.
    seconds : dict
        Of reading and finding the shape.
    complete : callable
        Adds what the photos told to the report.
    number : 1, 2 or None
        Of two facing pages, the left one first.
    measured : (n,) float64 or None
        Of the scan's points, if several photos measured them: 1 where they did, falling to 0 where it is bridged.
    """

    scan: Scan
    scaled: bool
    seconds: dict[str, float]
    complete: Callable[[Restoration], Report]
    measured: Floats | None = None
    number: int | None = None

    def completed(self, restoration: Restoration, write_seconds: float) -> Report:
        """The report of the whole command."""
        report = self.complete(restoration)
        seconds = {**self.seconds, **report.seconds, "write": write_seconds}
        return graded(replace(report, seconds=seconds, seconds_total=sum(seconds.values())))


def shapes_of_one(
    file: Path, settings: PhotoSettings, progress: Progress, outline: Pixels | None = None
) -> list[PhotographedSheet]:
    """Estimate the shape of a sheet from one photo; of both facing pages if they are asked for.

    Parameters
    ----------
    file : Path
    settings : PhotoSettings
    progress : callable
    outline : (rows, cols) uint8, optional
        Of the upright photo's proportions: 0 where it does not show the sheet. There it is taken to be dark ground.
    """
    from planish.document.given_outline import doubtful_outline
    from planish.io import focal_length_px, read_photo
    from planish.photo import PhotoShape, find_shapes

    start = perf_counter()
    progress("read", 0.0)
    image = read_photo(file, upright=True)
    pixels = image.pixels if outline is None else on_dark_ground(image.pixels, outline)
    doubts = [] if outline is None else doubtful_outline(outline > 0, image.pixels)
    read_at = perf_counter()
    progress("shape", 0.0)
    sheets = find_shapes(pixels, settings, focal_px=focal_length_px(file), icc=image.icc)
    seconds = {"read": read_at - start, "shape": perf_counter() - read_at}

    def photographed(sheet: PhotoShape) -> PhotographedSheet:
        def complete(restoration: Restoration) -> Report:
            warnings = [*doubts, *image.warnings, *sheet.warnings, *restoration.report.warnings]
            return replace(restoration.report, photo=sheet.report, warnings=warnings)

        number = None if sheet.side is None else 1 + (sheet.side == "right")
        return PhotographedSheet(sheet.scan, sheet.report.scale != "unknown", seconds, complete, number=number)

    return [photographed(sheet) for sheet in sheets]


def on_dark_ground(photo: Pixels, outline: Pixels) -> Pixels:
    """The photo with everything outside the outline black.

    Raises
    ------
    UsageError
        If the outline was drawn on an image of other proportions.
    """
    import cv2

    rows, cols = photo.shape[:2]
    if abs(outline.shape[0] * cols / (outline.shape[1] * rows) - 1) > SAME_SHAPE:
        raise UsageError(
            f"the outline was drawn on an image of {outline.shape[1]} x {outline.shape[0]} pixels, and the photo has "
            f"{cols} x {rows}: they are of different proportions"
        )
    inside = cv2.resize(outline, (cols, rows), interpolation=cv2.INTER_NEAREST) > 0
    return np.where(inside[(...,) + (None,) * (photo.ndim - 2)], photo, np.zeros((), photo.dtype))


def shape_of_several(
    files: Sequence[Path], settings: PhotoSettings, camera: Path | None, progress: Progress
) -> PhotographedSheet:
    """Measure a sheet from several photos."""
    from planish.acquire.photos.guidance import what_next
    from planish.acquire.photos.page_error import expected_page_error
    from planish.acquire.photos.scan import from_photos
    from planish.io.photo_set import read_photo_set
    from planish.pipeline.scale import scaled_by_page, unlike_paper

    start = perf_counter()
    progress("read", 0.0)
    sources, cameras, read_warnings = read_photo_set(files, camera, settings.between)
    read_at = perf_counter()
    progress("shape", 0.0)
    found = from_photos(sources, settings, cameras=cameras, progress=lambda share: progress("shape", share))
    found = scaled_by_page(found, settings)
    seconds = {"read": read_at - start, "shape": perf_counter() - read_at}

    def complete(restoration: Restoration) -> Report:
        report, flat = restoration.report, restoration.flattening
        notes: list[Diagnostic] = [
            *unlike_paper(flat.size_mm, settings.paper),
            *found.acquired.warnings,
            *what_next(found, flat.page_xy, flat.size_mm),
        ]
        error = expected_page_error(found.report, flat.size_mm, report.flatten)
        return replace(
            report,
            photos=found.report,
            scan=replace(report.scan, measured_fraction=found.report.measured_fraction),
            flatten=replace(report.flatten, expected_error_mm=error),
            warnings=[*notes, *read_warnings, *report.warnings],
        )

    acquired = found.acquired
    return PhotographedSheet(acquired.scan, found.report.scale != "unknown", seconds, complete, acquired.confidence)
