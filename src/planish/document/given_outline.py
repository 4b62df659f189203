"""Whether an outline that was given, by hand or as a mask, lies where photo or scan show an edge of the sheet."""

from __future__ import annotations

import cv2
import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from planish.color import to_uint8
from planish.document.cut import continued, depth_inside, typical_length
from planish.document.rim import at_places, largest_region, rim_pixels
from planish.mesh import rasterize
from planish.types import Bools, Diagnostic, Floats, Mesh, Pixels

NEAR = 0.0075
"""How far from the outline an edge may be, in sides of a square of the sheet's area: 1.8 mm for a letter. Two opposite
sides that are both off by so much make a page 1.5 % too large or too small; a good one may be off by 2 %, and cutting
between the points of a scan adds half a percent. With half of it nobody draws well enough on a phone; doubled, pages
are off by 4 % and good."""

SIDE_PX = 400
"""Side of such a square on the picture on which edges are looked for: `NEAR` is 3 pixels."""

PRINT_PX = 7
"""Strokes of print up to so many pixels are closed over: letters of 12 points on a page of 216 mm have strokes of 1 and
gaps of 2."""

MOST_OBLIQUE = 3.0
"""A pixel of that picture counts as no more than so many, where the surface is seen obliquely: nearer than 1.3 of them
an edge is not known."""

OFF_SLOPE = 0.5
"""Within `NEAR` of the outline, points are ground if they are off the continuation of the sheet by more than so much of
its length, 27 degrees, and by more than a usual edge. Paper that is bent to a radius of 10 mm is off it by a seventh of
3 mm."""

STEP = 0.11
"""Least change of the logarithm of a colour's code value across an edge: half of that between paper and ground that is
1.25 times as dark. Sensors' noise on this picture is 0.01, the shade of a bent page over 6 pixels 0.02 to 0.05."""

TURN = np.cos(np.radians(30))
"""Cosine of the least angle between the sheet within the outline and what goes on beyond it: a step of 1.2 % of the
sheet's side over 6 pixels. Paper that is bent to a radius of a tenth of its side turns by 7 degrees over them."""

MOST_BARE = 0.1
"""Part of the outline that may be without an edge: half of a short side. A side that is nowhere near an edge is a fifth
to a quarter, and then nothing tells how far the page reaches there."""


def doubtful_outline(
    mask: Bools,
    photo: Pixels | None,
    surface: tuple[Mesh, Floats] | None = None,
    nearness: Floats | None = None,
) -> list[Diagnostic]:
    """A warning where an outline runs along no edge: what it takes in beyond the sheet, or cuts off, nobody can check.

    Parameters
    ----------
    mask : (rows, cols) bool
        Where the sheet is, by the outline that was given.
    photo : (rows', cols', 3) uint8 or uint16, or None
        Of the same proportions.
    surface : (Mesh, (n, 2) float64 [mask px]), optional
        A scan, and the places of its points on the mask.
    nearness : (n,) float64, optional
        Of its points to the viewer, where parts of it may hide others; see `rasterize`.
    """
    bare = share_without_edge(mask, photo, surface, nearness)
    if bare <= MOST_BARE:
        return []
    shown = "the photo shows" if surface is None else "the scan shows" if photo is None else "photo and scan show"
    sentence = (
        f"along {100 * bare:.0f} % of the outline that was given {shown} no edge of a sheet, so there the page may be "
        "too large or too small"
    )
    hint = "compare its sides with the original, or give an outline that follows them more closely"
    return [Diagnostic("outline-doubtful", sentence, hint)]


def share_without_edge(
    mask: Bools, photo: Pixels | None, surface: tuple[Mesh, Floats] | None = None, nearness: Floats | None = None
) -> float:
    """Part of an outline that has no edge near it: neither a change of colour, nor a step or a kink of the surface.

    Where the outline runs along the border of the photo or of what was scanned, the sheet ends there in any case.

    Examples
    --------
    >>> photo = np.full((300, 400, 3), 60, np.uint8)
    >>> photo[50:250, 100:300] = 220
    >>> mask = np.zeros((300, 400), bool)
    >>> mask[50:250, 100:300] = True
    >>> share_without_edge(mask, photo)
    0.0
    >>> mask[50:250, 300:320] = True  # a tenth of the sheet's width more
    >>> 0.2 < share_without_edge(mask, photo) < 0.35
    True
    """
    scale = min(1.0, SIDE_PX / max(float(mask.sum()) ** 0.5, 1.0))
    size = max(2, round(mask.shape[1] * scale)), max(2, round(mask.shape[0] * scale))
    small = cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA) > 127
    if not small.any() or small.all():
        return 0.0
    at, inwards = rim_pixels(small)
    reach = outline_reach(small)
    step, seen = reach * inwards, None
    if surface is not None:
        mesh, places = surface
        seen = _positions(mesh, (places + 0.5) * scale - 0.5, small.shape, nearness)
        step = step / _foreshortening(seen, at + step, at + 2 * step)
    bare = np.asarray((at - step >= 0).all(axis=0) & (np.array(small.shape) > (at - step).T + 1).all(axis=1))
    if photo is not None:
        bare &= ~_changes(_without_print(photo, size), at + step, at - step)
    if seen is not None:
        bare &= ~_ends_or_turns(seen, at + 2 * step, at + step, at - step)
    return float(bare.mean())


def without_ground(mask: Bools, mesh: Mesh, places: Floats) -> Bools:
    """The mask without the ground that its outline takes in beside a sheet which ends in a step.

    Seen from above, a rim of ground beside a raised corner is narrow; along the surface, down to the table and on, it
    is long, and an outline of seven corners around the page of a book made the page 4 % too high.

    Parameters
    ----------
    mask : (rows, cols) bool
    mesh : Mesh
    places : (n, 2) float64 [mask px]
    """
    depth, reach = depth_inside(mask, places), 2 * outline_reach(mask)
    inside = at_places(mask, places) & (depth > 0) & np.isfinite(mesh.points).all(axis=1)
    sure = inside & (depth >= max(reach, typical_length(places, mesh.faces, inside)))
    rim = np.flatnonzero(inside & ~sure)
    if not len(rim) or not sure.any():
        return mask
    sheet = continued(mesh.points, places, sure, inside, places[rim])
    off = np.linalg.norm(mesh.points[rim] - sheet, axis=1)
    away = cKDTree(mesh.points[sure]).query(sheet)[0]
    on_ground = off > np.maximum(typical_length(mesh.points, mesh.faces, sure), OFF_SLOPE * away)
    if not on_ground.any():
        return mask
    known = np.flatnonzero(inside)
    ground = np.zeros(len(inside), bool)
    ground[rim] = on_ground
    row, col = np.nonzero(mask)
    nearest = cKDTree(places[known]).query(np.stack([col, row], axis=1), workers=-1)[1]
    kept = mask.copy()
    kept[row, col] = ~ground[known[nearest]]
    return largest_region(kept)


def outline_reach(mask: Bools) -> float:
    """How far an outline that was given may be from an edge [px]: see `NEAR`."""
    return max(1.5, NEAR * float(mask.sum()) ** 0.5)


def _without_print(photo: Pixels, size: tuple[int, int]) -> Floats:
    """The logarithm of the code values of a small picture, (rows, cols, 3), thin dark strokes closed over."""
    small = cv2.resize(to_uint8(photo), size, interpolation=cv2.INTER_AREA)
    closed = cv2.morphologyEx(small, cv2.MORPH_CLOSE, np.ones((PRINT_PX, PRINT_PX), np.uint8))
    return np.asarray(cv2.GaussianBlur(np.log1p(closed.astype(np.float64)), (0, 0), 1.0))


def _changes(levels: Floats, within: Floats, beyond: Floats) -> Bools:
    """(k,) whether some colour at places within an outline differs from that beyond it."""
    first, second = (_at(levels, places) for places in (within, beyond))
    return np.asarray((np.abs(first - second) >= STEP).any(axis=1))


def _positions(mesh: Mesh, places: Floats, shape_rc: tuple[int, ...], nearness: Floats | None) -> Floats:
    """(rows, cols, 3) points of a surface at the pixels of a picture; NaN where it is not seen."""
    face, w = rasterize(places, mesh.faces, (shape_rc[0], shape_rc[1]), nearness=nearness)
    weights = np.concatenate([1 - w.sum(axis=2, keepdims=True), w], axis=2)
    points = np.einsum("rck,rckd->rcd", weights, mesh.points[mesh.faces[face]])
    points[face < 0] = np.nan
    return np.asarray(points)


def _foreshortening(points: Floats, within: Floats, deep: Floats) -> Floats:
    """(k,) how many times as long as elsewhere a surface is between two places, where it falls away from the view."""
    length = np.linalg.norm(_at(points, within) - _at(points, deep), axis=1)
    known = np.isfinite(length)
    if not known.any():
        return np.ones(len(length))
    return np.asarray(np.where(known, np.clip(length / np.maximum(np.median(length[known]), 1e-9), 1, MOST_OBLIQUE), 1))


def _ends_or_turns(points: Floats, deep: Floats, within: Floats, beyond: Floats) -> Bools:
    """(k,) whether a surface ends between places within an outline and beyond it, or goes on there another way."""
    a, b, c = (_at(points, places) for places in (deep, within, beyond))
    before, after = b - a, c - b
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = (before * after).sum(axis=1) / (np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1))
    return np.asarray(~(cosine > TURN))


def _at(values: Floats, places: Floats) -> Floats:
    """(k, d) values of a picture (rows, cols, d) at (2, k) rows and columns."""
    return np.stack(
        [ndimage.map_coordinates(values[..., k], places, order=1, mode="nearest") for k in range(values.shape[2])],
        axis=1,
    )
