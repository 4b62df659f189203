"""What each photo of a scan shows of the sheet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from planish.errors import InputError
from planish.render.resolution import Resolution, resolution
from planish.render.uv_map import UVMap, uv_map
from planish.render.visibility import visible_faces
from planish.types import Floats, Ints, Pixels, Scan


@dataclass(frozen=True, eq=False)
class PhotoView:
    """A photo, and what it shows of the sheet.

    Attributes
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    uv_map : UVMap
    faces : (m, 3) int32
        Those of the map that the photo saw.
    resolution : Resolution
    name : str
        Of the photo, for messages.
    """

    photo: Pixels
    uv_map: UVMap
    faces: Ints
    resolution: Resolution
    name: str = "the photo"


def photo_views(scan: Scan, page_xy: Floats, size_mm: tuple[float, float]) -> list[PhotoView]:
    """Map the sheet to every photo of a scan, the main one first.

    Raises
    ------
    InputError
        Where the scan has no photo, or none of the sheet falls on one of them.
    """
    if scan.photo is None or (scan.photo_xy is None and scan.camera is None):
        raise InputError(
            "the scan has no photo that could be drawn: neither texture coordinates nor a camera came with it; give "
            "both a photo and its camera, or flatten the mesh alone"
        )
    several = [scan, *(Scan(scan.mesh, view.photo, camera=view.camera) for view in scan.others)]
    names = ["the photo"] if len(several) == 1 else [f"photo {i + 1} of {len(several)}" for i in range(len(several))]
    return [_view(one, page_xy, size_mm, name) for one, name in zip(several, names, strict=True)]


def _view(scan: Scan, page_xy: Floats, size_mm: tuple[float, float], name: str) -> PhotoView:
    assert scan.photo is not None
    sheet = uv_map(scan, page_xy)
    faces = sheet.faces[visible_faces(sheet, scan.camera)]
    return PhotoView(scan.photo, sheet, faces, resolution(sheet, faces, size_mm, scan.photo.shape[:2], name), name)


def moved_view(view: PhotoView, turn: Floats, shift: Floats, size_mm: tuple[float, float]) -> PhotoView:
    """The same photo seen from a page that was turned and shifted: `place @ turn.T + shift`.

    What the photo sees of the sheet does not change, so only the resolution over the new page is measured again.

    Parameters
    ----------
    view : PhotoView
    turn : (2, 2) float64
    shift : (2,) float64 [mm]
    size_mm : (float, float)
        Width and height of the new page.
    """
    there = view.uv_map
    there = replace(there, page_xy=there.page_xy @ turn.T + shift, jacobian=there.jacobian @ turn.T)
    measured = resolution(there, view.faces, size_mm, view.photo.shape[:2], view.name)
    return replace(view, uv_map=there, resolution=measured)


def shrunk(view: PhotoView, ppi: float) -> PhotoView:
    """The same with a photo made smaller, to about so many pixels per inch of page: quick to draw from."""
    import cv2

    times = round(view.resolution.median_ppi / ppi)
    if times < 2:
        return view
    rows, cols = (n // times for n in view.photo.shape[:2])
    if min(rows, cols) < 1:
        return view
    whole = np.ascontiguousarray(view.photo[: rows * times, : cols * times])
    small = cv2.resize(whole, (cols, rows), interpolation=cv2.INTER_AREA)
    places = (view.uv_map.photo_xy + 0.5) / times - 0.5
    sheet = replace(view.uv_map, photo_xy=places, jacobian=view.uv_map.jacobian / times)
    return replace(view, photo=small, uv_map=sheet)
