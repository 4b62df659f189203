"""The sheet apart from its surroundings: the table around it is left out where it is plainly one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planish.document.box_face import box_face
from planish.document.cut import cut_to_outline, left_out_share, with_faces
from planish.document.given_outline import doubtful_outline, without_ground
from planish.document.hands import without_hands
from planish.document.raised import raised_sheet
from planish.document.rim import at_places, share_around, sticking_out, with_margin
from planish.document.sheet_outline import (
    MAYBE_CONTRAST,
    count_sheets,
    ends_in_an_edge,
    find_sheet,
    is_even,
    refined_sheet,
    whiteness,
)
from planish.document.top_view import picture, top_view
from planish.document.view_cut import cut_in_view, outside_of_mask
from planish.errors import InputError
from planish.geometry import project
from planish.geometry.axes import principal_axes
from planish.geometry.resection import resect
from planish.mesh import area_vectors
from planish.types import Bools, Diagnostic, Floats, Ints, Mesh, Pixels, Scan

MIN_AREA = 0.05
"""Part of the scanned area that must be surroundings for them to be left out."""

MIN_AROUND = 0.6
"""Part of all directions from the middle of the paper in which surroundings must follow it closely. A sheet alone that
is dark on one side, as beside a spine, has a quarter to a half of them; a sheet on a table all, or three quarters where
it reaches the border of the scan."""

ALL_AROUND = 0.95
"""The same where the sheet reaches no border of the scan; where it does, a page may be cut off there, which is told."""

FLATNESS = 0.01
"""Distance from their common plane, as part of their extent, within which surroundings are a table: 4 mm over 400 mm,
more than the noise of a depth camera."""

MIN_FLAT = 0.8
"""Part of the surroundings that must lie in that plane; the rest may be hands, weights, a second sheet."""

MAX_SHEET_FLAT = 0.9
"""If more of the sheet lies in the plane of the table, shape does not tell them apart, and a dark frame printed on a
flat sheet would look the same: then nothing is left out unasked."""

MAX_STICKING_OUT = 0.012
"""Part of the sheet that may stick out of it untold: a thumb and its hand have 0.023 to 0.057, the corners of pages
0.004 to 0.005. Halved, a rounded or crumpled corner is told; doubled, half of the hands are not."""


@dataclass(frozen=True, eq=False)
class _Picture:
    """A picture of the scan, and where its points are on it; NaN where they are not known."""

    pixels: Pixels
    places: Floats


def leave_out_surroundings(scan: Scan) -> tuple[Scan, list[Diagnostic]]:
    """Reduce a scan to the faces of its sheet, if the sheet plainly lies on a table.

    The photo tells paper from ground (`find_sheet`), or, where the images are no view of the scene, the colours seen
    straight from above; the ground must lie all around the sheet, and in one plane from which the sheet rises. Where
    colours tell nothing, what stands out of a plane with steps all around is the sheet (`raised_sheet`). Where that is
    not plain either, but something stands out, a shadow may lie across sheet and table: then white is separated from
    coloured ground, which no shadow changes. Anything less plain is kept: a sheet alone loses no point.

    Parameters
    ----------
    scan : Scan

    Returns
    -------
    scan : Scan
        With the same points; only faces are left out.
    warnings : list of Diagnostic
    """
    shown = _picture(scan)
    cut, warnings = _by_colour(scan, shown)
    if cut is not scan:
        return cut, warnings
    shaped, notes = _by_shape(scan)
    if shaped is not scan:
        return shaped, notes
    doubts = warnings or notes
    if doubts and shown is not None:
        cut, warnings = _by_colour(scan, _Picture(whiteness(shown.pixels), shown.places))
    return (scan, doubts) if cut is scan else (cut, warnings)


def _by_colour(scan: Scan, shown: _Picture | None) -> tuple[Scan, list[Diagnostic]]:
    """The scan cut where paper ends and darker ground begins; the scan itself where that is not plain."""
    if shown is None:
        return scan, []
    mask = find_sheet(shown.pixels, whole=True)
    faint = mask is None
    if mask is None:
        mask = find_sheet(shown.pixels, whole=True, contrast=MAYBE_CONTRAST)
    if mask is None:
        return scan, []
    near = with_margin(mask)
    scale = near.shape[1] / mask.shape[1]
    faces, places = scan.mesh.faces, shown.places
    outside = np.asarray(~at_places(near, places, scale)[faces].any(axis=1))
    area = np.linalg.norm(area_vectors(scan.mesh.points, faces), axis=1)
    share = float(area[outside].sum() / max(area.sum(), np.finfo(float).tiny))
    around = share_around(near, places[faces[outside][:, 0]], scale)
    if share < MIN_AREA or around < MIN_AROUND:
        return scan, []
    inside = at_places(mask, places[faces].mean(axis=1))
    flat_ground, flat_sheet = _flat_shares(scan.mesh, outside, inside)
    if not inside.any() or not ends_in_an_edge(shown.pixels, places[np.isfinite(places).all(axis=1)]):
        return scan, []
    in_plane, apart = flat_ground >= MIN_FLAT, flat_sheet <= MAX_SHEET_FLAT
    if faint and not (in_plane and apart):
        return scan, []
    if faint or not (in_plane and apart and is_even(shown.pixels, strictly=around < ALL_AROUND)):
        which = "hardly darker than it" if faint else "with shade or other things on it"
        which = which if apart else "in the same plane"
        sentence = f"{100 * share:.0f} % of the scan may be ground around the sheet, {which}; all of it was kept"
        hint = _by_mask(scan, "the sheet", "if that is so")
        return scan, [Diagnostic("surroundings-doubtful", sentence, hint)]
    mask = refined_sheet(shown.pixels)
    alone, hand = without_hands(shown.pixels, mask, places, scan.mesh)
    if hand:
        near = with_margin(alone)
        around = share_around(near, places[~at_places(near, places, scale)], scale)
    cut = cut_to_outline(scan, alone, places)[0]
    notes = [_left_out(scan, cut, cut_off=around < ALL_AROUND)]
    sheets = count_sheets(shown.pixels, alone, mask & ~alone)
    if sheets > 1:
        sentence = f"the scan shows {sheets} sheets; the page is the largest of them"
        notes.insert(0, Diagnostic("sheets-several", sentence, _by_mask(scan, "another of them", "to get that")))
    notes += _held(hand)
    return cut, _maybe_held(scan, alone) + notes


def _by_shape(scan: Scan) -> tuple[Scan, list[Diagnostic]]:
    """The scan cut to what stands out of the plane all around it; the scan itself where that is not plain."""
    raised = raised_sheet(scan)
    if raised is None:
        return scan, []
    side = box_face(scan.mesh, raised) if raised.ends_in_steps else None
    if side is not None:
        cut = with_faces(scan, side)
        sentence = "the scan shows a box on a table; the page is its largest flat face"
        first = Diagnostic("box-face", sentence, _by_mask(scan, "another face", "to get that"))
        return cut, [first, _left_out(scan, cut)]
    view, mask = raised.view, raised.mask
    pixels = picture(scan, view)
    alone, hand = (mask, 0.0) if pixels is None else without_hands(pixels, mask, view.places, scan.mesh)
    cut, left_out = cut_to_outline(scan, alone, view.places)
    if raised.plain:
        return cut, [*_maybe_held(scan, alone), _left_out(scan, cut, by_shape=True), *_held(hand)]
    share = left_out_share(scan.mesh, left_out)
    sentence = f"{100 * share:.0f} % of the scan may be a table, out of which the sheet rises; all of it was kept"
    return scan, [Diagnostic("surroundings-doubtful", sentence, _by_mask(scan, "the sheet", "if that is so"))]


def _held(share: float) -> list[Diagnostic]:
    if not share:
        return []
    sentence = "something that holds the sheet, as a hand would, was left out with what it hides of it"
    return [Diagnostic("hand-left-out", sentence, "set {sheet=all} to keep everything")]


def _maybe_held(scan: Scan, mask: Bools) -> list[Diagnostic]:
    share = sticking_out(mask)
    if share <= MAX_STICKING_OUT:
        return []
    sentence = f"{100 * share:.0f} % of the sheet stick out of it, as a hand would; the page may be too large"
    return [Diagnostic("surroundings-doubtful", sentence, _by_mask(scan, "the sheet without the hand"))]


def _by_mask(scan: Scan, wanted: str, why: str = "") -> str:
    """How a user names the part that is wanted: on the photo, or where there is no single one, in the mesh itself."""
    if takes_mask(scan):
        hint = f"give {{sheet}} as an image that is white on {wanted}"
    else:
        hint = f"cut the mesh to {wanted} in another program"
    return f"{hint} {why}".rstrip()


def takes_mask(scan: Scan) -> bool:
    """Whether places on one photo are known, so that a mask tells which faces are the sheet's."""
    return not scan.textures and (scan.photo_xy is not None or scan.camera is not None)


def _left_out(scan: Scan, cut: Scan, *, cut_off: bool = False, by_shape: bool = False) -> Diagnostic:
    before, after = (
        float(np.nansum(np.linalg.norm(area_vectors(one.mesh.points, one.mesh.faces), axis=1))) for one in (scan, cut)
    )
    share = 1 - after / max(before, np.finfo(float).tiny)
    sentence = f"the sheet lies on a table, and {100 * share:.0f} % of the scan around it were left out"
    if by_shape:
        sentence += (
            "; its shape alone tells so, and a part of one sheet that stands up from the rest would look the same"
        )
    if cut_off:
        sentence += "; it reaches the border of the scan, which may cut it off"
    return Diagnostic("surroundings-left-out", sentence, "set {sheet=all} to keep them")


def cut_to_mask(scan: Scan) -> tuple[Scan, list[Diagnostic]]:
    """Reduce a scan to the faces that lie on its mask, `scan.sheet`: of the photo's proportions, or on `sheet_view`.

    Raises
    ------
    InputError
        Where the mask is not of the photo's proportions, the scan has no single photo, or no face lies on the mask.
    """
    mask = scan.sheet
    assert mask is not None
    if scan.sheet_view is not None:
        return cut_in_view(scan, mask, scan.sheet_view)
    shape = scan.camera.shape_rc if scan.camera is not None else mask.shape
    shape = shape if scan.photo is None else scan.photo.shape
    if not takes_mask(scan):
        what = f"{len(scan.textures)} images" if scan.textures else "no photo"
        raise InputError(
            f"the sheet is given as a mask on the photo, but the scan has {what}", "give {photo} and its {camera}"
        )
    if abs(mask.shape[0] * shape[1] / (mask.shape[1] * shape[0]) - 1) > 0.01:
        raise InputError(
            f"the mask of the sheet is {mask.shape[1]} x {mask.shape[0]} pixels, the photo {shape[1]} x {shape[0]}; "
            "give a mask of the photo's size"
        )
    places = scan.photo_xy
    if places is None:
        assert scan.camera is not None
        places = project(scan.camera, scan.mesh.points)
    places = _per_point(places, scan.mesh.faces, len(scan.mesh.points))
    places = (places + 0.5) * (mask.shape[1] / shape[1]) - 0.5
    kept, left_out = cut_to_outline(scan, without_ground(mask, scan.mesh, places), places)
    if left_out.all():
        raise InputError("no part of the scan lies on the mask of the sheet; do mask and photo belong together?")
    return kept, [*doubtful_outline(mask, scan.photo, (scan.mesh, places)), outside_of_mask(scan.mesh, left_out)]


def _picture(scan: Scan) -> _Picture | None:
    """The photo where it is one view of the scene, else the scan's colours seen from above."""
    places = _places(scan)
    if scan.photo is not None and places is not None:
        return _Picture(scan.photo, places)
    if not scan.has_picture or not len(scan.mesh.faces):
        return None
    view = top_view(scan)
    pixels = picture(scan, view)
    return None if pixels is None else _Picture(pixels, view.places)


def _places(scan: Scan) -> Floats | None:
    """(n, 2) places of all points on the photo; None where it is no single view of them, as in a texture atlas."""
    points, photo_xy = scan.mesh.points, scan.photo_xy
    if scan.camera is not None and photo_xy is None:
        return project(scan.camera, points)
    if photo_xy is None or scan.textures:
        return None
    if photo_xy.ndim == 3:
        corners, photo_xy = photo_xy, _per_point(photo_xy, scan.mesh.faces, len(points))
        if np.nanmax(np.abs(photo_xy[scan.mesh.faces] - corners), initial=0.0) > 1.0:  # a pixel
            return None
    known = np.isfinite(photo_xy).all(axis=1) & np.isfinite(points).all(axis=1)
    if scan.camera is None and (known.sum() < len(points) // 2 or resect(points[known], photo_xy[known]) is None):
        return None
    return photo_xy


def _per_point(photo_xy: Floats, faces: Ints, count: int) -> Floats:
    """(n, 2) the places of points; of those with several, that of one corner."""
    if photo_xy.ndim == 2:
        return photo_xy
    places = np.full((count, 2), np.nan)
    places[faces.ravel()] = photo_xy.reshape(-1, 2)
    return places


def _flat_shares(mesh: Mesh, outside: Bools, inside: Bools) -> tuple[float, float]:
    """Parts of the surroundings and of the sheet that lie in the plane of the surroundings."""
    ground, sheet = (_some(mesh, faces) for faces in (outside, inside))
    if len(ground) < 3:
        return 0.0, 1.0
    tolerance = FLATNESS * float(np.linalg.norm(np.ptp(ground, axis=0)))
    used = ground
    for _ in range(10):  # reweighted to the nearer half: a hand on the table does not tilt the plane
        middle = used.mean(axis=0)
        normal = principal_axes(used)[0][2]
        away = np.abs((ground - middle) @ normal)
        used = ground[away <= max(np.median(away), tolerance / 2)]
    flat = [float((np.abs((points - middle) @ normal) <= tolerance).mean()) for points in (ground, sheet)]
    return flat[0], flat[1]


def _some(mesh: Mesh, faces: Bools, most: int = 5000) -> Floats:
    """At most so many corners of faces, evenly spread over the mesh."""
    rows = mesh.faces[faces][:, 0]
    points = mesh.points[rows[:: max(1, len(rows) // most)]]
    return points[np.isfinite(points).all(axis=1)]
