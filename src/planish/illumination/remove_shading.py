"""Remove shading from a page: estimate the illumination and divide it out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from planish.color import LUMINANCE
from planish.errors import UsageError
from planish.illumination.cells import Cells, Field, cell_statistics, filled
from planish.illumination.divide import divide_illumination
from planish.illumination.lamp_model import LampModel, fit_lamp, sample_cells
from planish.illumination.paper_light import light_of_paper
from planish.illumination.refine_on_paper import nearby_range, refine_illumination
from planish.illumination.shadow_visibility import shadow_visibility
from planish.illumination.surface_at_pixels import Surface, coarse_mesh, surface_at_pixels
from planish.settings import ShadingSettings
from planish.types import Bools, Diagnostic, Floats, Page, Scan

MIN_PAPER_CELLS = 200
"""Cells of quiet paper, 0.5 mm wide, that the light can be found from."""
PAPER_SHARE = 0.02
ALIKE = 0.1
"""So much of the page must lie within so much [log] of the light found, or it is no page of blank paper and print."""
DARKEST = 0.05
"""Where less light falls than this part of the page's middling light, only so much is made good: the rest is noise."""
FEW, HANGS_TOGETHER = 0.25, 0.5
"""Where less of the cells without strokes agrees with the lamp, most of those that do must hang together: else they are
pale patches of a page that is printed all over, no paper."""
CLIPPED = 0.01
"""Part of the page that may be clipped in the photo without a word: glints, and grain of paper just below white."""
SHADOW_STEP_MM = 1.5
"""The sheet is drawn as coarsely as that where it may shade itself: its edge is as sharp as the shadow's."""
COLOURED = 0.5
"""Paper one of whose channels has less than this of the greatest is coloured, and its colour is kept."""


@dataclass(frozen=True, eq=False)
class ShadingFit:
    """How well the illumination was estimated.

    Attributes
    ----------
    method : str
        "geometry" or "background"; "none" where too little of the page is paper.
    paper_share : float
        Part of the page that the light was found from.
    unevenness_before, unevenness : float
        From the 10 % to the 90 % quantile of the paper's grey, in parts of white; after removal, before white is
        clipped.
    clipped_share : float
        Part of the page that is clipped in the photo: how bright it was there is not known.
    lamp_mm : (float, float, float) or None
        Place of the lamp in the scan's frame, very far away for daylight.
    ambient : float or None
        Share of the light on the middle of the sheet that comes from all around.
    warnings : tuple of Diagnostic
    """

    method: str
    paper_share: float
    unevenness_before: float
    unevenness: float
    clipped_share: float
    lamp_mm: tuple[float, float, float] | None = None
    ambient: float | None = None
    warnings: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True, eq=False)
class EvenlyLit:
    """A page without shading.

    Attributes
    ----------
    page : Page
    clipped : (rows, cols) bool
        Where the photo has a channel at its greatest value.
    fit : ShadingFit
    light : (rows, cols, 3) float32
        Linear light that blank paper has at the middle of each cell of the page; the page was divided by it.
    cell_px : int
        Side of the cells in page pixels; the last ones may reach beyond the page.
    """

    page: Page
    clipped: Bools
    fit: ShadingFit
    light: Field
    cell_px: int


def remove_shading(
    page: Page, scan: Scan, page_xy: Floats, normals: NDArray[np.floating[Any]], settings: ShadingSettings | None = None
) -> EvenlyLit:
    """Make a page evenly lit and its paper white.

    Parameters
    ----------
    page : Page
        As drawn from the scan's photo, grey or colour, 8 or 16 bit.
    scan : Scan
    page_xy : (n, 2) float64 [mm]
        Place on the page of every point of the scan.
    normals : (n, 3) float
        Of the surface at every point, away from the printed side.
    settings : ShadingSettings, optional
        With a method other than "none".

    Raises
    ------
    UsageError
        Where the method is "none".

    Notes
    -----
    Light is divided in each channel, so that a tint of the light or a yellowed paper goes too and inks keep their hue;
    only the colour of plainly coloured paper is kept.
    """
    s = settings or ShadingSettings()
    if s.shading == "none":
        raise UsageError('shading is "none", so there is no shade to remove; choose geometry or background')
    cells = cell_statistics(page)
    warnings: tuple[Diagnostic, ...] = ()
    surface = surface_at_pixels(cells, scan, page_xy, normals) if s.shading == "geometry" else None
    lamp = None if surface is None else _lamp(cells, surface)
    if surface is not None and lamp is not None:
        if _in_patches(cells, surface, lamp):
            return _as_photographed(page, cells)
        field, seam = _by_geometry(cells, surface, lamp)
    else:
        light = light_of_paper(cells)
        if light is None:
            return _as_photographed(page, cells)
        if s.shading == "geometry":
            warnings = (
                Diagnostic(
                    "shading-from-background",
                    "the page shows too little blank paper to find the light from the sheet's shape; its shade was "
                    "taken from the background instead",
                ),
            )
        field, seam = light, np.zeros(cells.known.shape, np.float32)
    field = np.maximum(field, np.median(field[cells.known], axis=0) + np.log(DARKEST, dtype=np.float32))
    gain = np.exp(seam[..., None] - field) * _kept_colour(field, cells)
    pixels, clipped = divide_illumination(page, gain, cells.side_px)
    clipped_share = float((clipped & page.known).mean())
    if clipped_share > CLIPPED:
        warnings += (
            Diagnostic(
                "photo-clipped",
                f"{100 * clipped_share:.0f} % of the page is clipped in the photo: how bright it was there is not "
                "known",
                "expose less",
            ),
        )
    fit = _quality(cells, field, lamp, clipped_share, warnings)
    return EvenlyLit(Page.owned(pixels, page.known, page.dpi, page.icc), clipped, fit, np.exp(field), cells.side_px)


def _as_photographed(page: Page, cells: Cells) -> EvenlyLit:
    """The page itself, and why."""
    pixels: NDArray[Any] = np.asarray(page.pixels)
    clipped = (pixels.reshape(*page.known.shape, -1) == np.iinfo(pixels.dtype).max).any(axis=2)
    warning = Diagnostic(
        "shading-kept",
        "the page shows too little blank paper to tell shade from print, so its light and colours are as photographed",
    )
    fit = ShadingFit("none", 0.0, 0.0, 0.0, float((clipped & page.known).mean()), warnings=(warning,))
    return EvenlyLit(page, clipped, fit, np.ones((*cells.known.shape, 3), np.float32), cells.side_px)


def _by_geometry(cells: Cells, surface: Surface, lamp: LampModel) -> tuple[Field, Field]:
    """Logarithm of the light of paper in each cell, and that of the seams."""
    shape = coarse_mesh(surface, max(1, round(SHADOW_STEP_MM / cells.mm)))
    share = shadow_visibility(shape, lamp.lamp, surface.points, surface.normals)
    bare = filled(lamp.log_brightness(surface.points, surface.normals, surface.off_axis), surface.known)
    model = filled(lamp.log_brightness(surface.points, surface.normals, surface.off_axis, share), surface.known)
    bend, edge = (max(1, round(mm / cells.mm)) for mm in (1.5, 4.0))
    return refine_illumination(cells, model, nearby_range(bare, bend), nearby_range(model - bare, edge))


def _lamp(cells: Cells, surface: Surface) -> LampModel | None:
    """The light found from the quiet cells, where enough of them agree with it."""
    bright, quiet = cells.brightness, _quiet(cells, surface)
    if quiet.sum() < MIN_PAPER_CELLS:
        return None
    some = sample_cells(quiet)
    where = surface.points[some], surface.normals[some], surface.off_axis[some]
    lamp = fit_lamp(*where, bright[some].astype(np.float64))
    paper = (np.abs(np.log(bright[some]) - lamp.log_brightness(*where)) < ALIKE).mean() * quiet.sum()
    return lamp if paper > max(MIN_PAPER_CELLS, PAPER_SHARE * cells.known.sum()) else None


def _quiet(cells: Cells, surface: Surface) -> Bools:
    """Cells without strokes, of paper or of even print."""
    usable = cells.known & surface.known & (cells.clipped < 0.1) & (cells.brightness > 0.01)
    return np.asarray(usable & (cells.share > 0.7))


def _in_patches(cells: Cells, surface: Surface, lamp: LampModel) -> bool:
    """Whether the cells as bright as the lamp would make paper are few, and hang together in small parts only."""
    quiet = _quiet(cells, surface)
    log_model = lamp.log_brightness(surface.points, surface.normals, surface.off_axis)
    alike = quiet & (np.abs(np.log(np.maximum(cells.brightness, 1e-4)) - log_model) < ALIKE)
    if alike.sum() > FEW * quiet.sum():
        return False
    _, _, size, _ = cv2.connectedComponentsWithStats(alike.astype(np.uint8), connectivity=8)
    return bool(size[1:, cv2.CC_STAT_AREA].max(initial=0) < HANGS_TOGETHER * alike.sum())


def _kept_colour(field: Field, cells: Cells) -> Field:
    """What white paper becomes: white, unless it is plainly coloured."""
    paper = np.exp(np.median(field[cells.known], axis=0))
    colour = paper / paper.max()
    return np.asarray(colour if colour.min() < COLOURED else np.ones(3), np.float32)


def _quality(
    cells: Cells, field: Field, lamp: LampModel | None, clipped_share: float, warnings: tuple[Diagnostic, ...]
) -> ShadingFit:
    before = cells.brightness
    after = np.exp(np.log(np.maximum(cells.light, 1e-4)) - field) @ LUMINANCE
    paper = cells.known & (cells.share > 0.9) & (cells.clipped < 0.1) & (np.abs(after - 1) < 0.1)
    return ShadingFit(
        "background" if lamp is None else "geometry",
        float(paper.mean()),
        _range_of_greys(before[paper]),
        _range_of_greys(after[paper]),
        clipped_share,
        None if lamp is None else tuple(float(mm) for mm in lamp.lamp),  # type: ignore[arg-type]
        None if lamp is None else lamp.ambient,
        warnings,
    )


def _range_of_greys(light: Field) -> float:
    """From the 10 % to the 90 % quantile, as code values in parts of white."""
    if not len(light):
        return 0.0
    low, high = np.clip(np.quantile(light, [0.1, 0.9]), 0, None) ** (1 / 2.2)
    return float(high - low)
