"""Third stage: the flat sheet turned the right way round, by its sides, its photo, its gutter and its text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from planish.document import SURE, detect_orientation, gutter_of_surface, skew_angle
from planish.flattening import direction_of_growth, to_page_frame, turned
from planish.pipeline.huge import quick_dpi
from planish.render import PhotoView, moved_view, preview
from planish.settings import RestoreSettings, Rotation
from planish.types import Flattening, Floats, Page, PreparedScan

PREVIEW_DPI = 150.0
"""Of the quick page on which the direction of the text is looked for."""
LEVEL_DEG = 0.1
"""Lines of text that lean by no more than this are level: a millimetre over 500."""

RAGGED = 0.005
"""A page is taken for paper of known sides if none is farther off than this part of it: by their area, pages of ten
photos are up to 0.24 % too wide or long (letter, flat, wave, curl), a Miura fold 0.7 %, a crumpled sheet 1.2 %. Half of
it takes the same ones, twice as much a Miura fold too; A4 and Letter differ by 2.8 % at least."""

OrientationReader = Callable[[Page], int | None]
"""Given a page, the clockwise turn [degrees] that puts its text upright; None where it cannot tell."""


def orient_by_shape(prepared: PreparedScan, flat: Flattening, settings: RestoreSettings) -> Flattening:
    """Orient the page by all but its text: sides along x and y, the photo's top on top, the gutter of a book upright.

    Parameters
    ----------
    prepared : PreparedScan
    flat : Flattening
        Of the points of `prepared.scan.mesh`.
    settings : RestoreSettings
        Of which `rotate` and `pages` are used.
    """
    flat = to_upright_frame(prepared, flat, settings.rotate, by_mesh=prepared.source.upright > 0)
    if settings.pages != "1" and settings.rotate == "auto":
        flat = _with_gutter_upright(prepared, flat)
    size, shift = _as_paper(flat.size_mm, prepared.source.paper_mm)
    return replace(flat, page_xy=flat.page_xy + shift, size_mm=size)


def orient_by_text(
    flat: Flattening,
    views: Sequence[PhotoView],
    read_orientation: OrientationReader | None,
    prior: float,
    icc: bytes | None = None,
    paper_mm: tuple[float, float] | None = None,
) -> tuple[Flattening, list[PhotoView]]:
    """Turn the page so that its lines of text are level and upright; unchanged where they are, or there is none.

    Parameters
    ----------
    flat : Flattening
    views : sequence of PhotoView
        Of the page of `flat`, the main photo first.
    read_orientation : callable or None
        Asked where the shapes of the letters do not tell which way up the page is.
    prior : float
        How sure it is that the page is upright already; see `Scan.upright`.
    icc : bytes or None
        Colour profile of the photo.
    paper_mm : (float, float) or None
        See `Scan.paper_mm`.

    Returns
    -------
    flat : Flattening
    views : list of PhotoView
        Of the page as it is now; no pixel has been filtered.
    """
    page = preview(views[0], flat.size_mm, quick_dpi(PREVIEW_DPI, flat.size_mm), icc)
    quarter, confidence = detect_orientation(page, prior)
    read = read_orientation(page) if read_orientation and confidence < SURE else None
    quarter = quarter if read is None else read
    clockwise = -quarter // 90
    skew, _ = skew_angle(replace(page, pixels=np.rot90(page.pixels, clockwise), known=np.rot90(page.known, clockwise)))
    if not quarter and abs(skew) <= LEVEL_DEG:
        return flat, list(views)
    page_xy, size, turn, shift = turned(flat.page_xy, quarter - (skew if abs(skew) > LEVEL_DEG else 0.0))
    size, more = _as_paper(size, paper_mm)
    flat = replace(flat, page_xy=page_xy + more, size_mm=size)
    return flat, [moved_view(view, turn, shift + more, size) for view in views]


def _as_paper(size_mm: tuple[float, float], paper_mm: tuple[float, float] | None) -> tuple[tuple[float, float], Floats]:
    """Size of the page as its paper is known to have it, either way round, and how far the sheet moves to its middle.

    A measured outline is ragged, and the page reaches to its outermost parts: the sheet itself is no larger for that.
    """
    for sides in () if paper_mm is None else (paper_mm, paper_mm[::-1]):
        beyond = np.subtract(size_mm, sides)
        if (np.abs(beyond) < RAGGED * np.array(sides)).all():
            return (float(sides[0]), float(sides[1])), -beyond / 2
    return size_mm, np.zeros(2)


def to_upright_frame(
    prepared: PreparedScan,
    flat: Flattening,
    rotate: Rotation,
    *,
    long_side_upright: bool = True,
    by_mesh: bool = False,
) -> Flattening:
    """Put the sides along x and y, the long side upright, the photo's top on top; or as `rotate` says, from there.

    Parameters
    ----------
    prepared : PreparedScan
    flat : Flattening
    rotate : Rotation
    long_side_upright : bool
        Whether only the two ways round with the long side upright are considered.
    by_mesh : bool
        Whether the mesh itself is known to stand upright: then so does the page, whatever its sides and its photo.
    """
    mesh, photo_xy = prepared.scan.mesh, prepared.scan.photo_xy
    by_mesh = by_mesh and rotate == "auto"
    if photo_xy is None or prepared.scan.textures or by_mesh:
        up = direction_of_growth(flat.page_xy, mesh.points[:, 1])
    elif photo_xy.ndim == 2:
        up = -direction_of_growth(flat.page_xy, photo_xy[:, 1])
    else:
        up = -direction_of_growth(flat.page_xy[mesh.faces[:, 0]], photo_xy[:, 0, 1])
    upright = long_side_upright and not by_mesh and rotate == "auto"
    page_xy, size = to_page_frame(flat.page_xy, up, long_side_upright=upright)
    if rotate not in ("auto", "0"):
        page_xy, size, _, _ = turned(page_xy, float(rotate))
    return replace(flat, page_xy=page_xy, size_mm=size)


def _with_gutter_upright(prepared: PreparedScan, flat: Flattening) -> Flattening:
    """The sheet of an open book with its gutter upright, and the photo's top on top if that can be; else as it is."""
    as_photographed = to_upright_frame(prepared, flat, "auto", long_side_upright=False)
    page_xy, size, _, _ = turned(flat.page_xy, 90.0)
    for way in (flat, as_photographed, replace(flat, page_xy=page_xy, size_mm=size)):
        if gutter_of_surface(prepared.scan.mesh, way.page_xy, way.size_mm):
            return way
    return flat
