"""What each photo of a scan shows of the sheet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from planish.errors import InputError
from planish.render.resolution import Resolution, resolution
from planish.render.uv_map import UVMap, uv_map
from planish.render.visibility import seen_faces
from planish.types import Floats, Ints, Pixels, Scan


@dataclass(frozen=True, eq=False)
class PhotoView:
    """A photo, and what it shows of the sheet.

    Attributes
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    chart : Chart
    faces : (m, 3) int32
        Those of the chart that the photo saw.
    resolution : Resolution
    """

    photo: Pixels
    uv_map: UVMap
    faces: Ints
    resolution: Resolution


def photo_views(scan: Scan, page_xy: Floats, size_mm: tuple[float, float]) -> list[PhotoView]:
    """Look at the sheet through every photo of a scan, the main one first.

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
    return [_sight(one, page_xy, size_mm, name) for one, name in zip(several, names, strict=True)]


def _sight(scan: Scan, page_xy: Floats, size_mm: tuple[float, float], name: str) -> PhotoView:
    assert scan.photo is not None
    sheet = uv_map(scan, page_xy)
    faces = sheet.faces[seen_faces(sheet, scan.camera)]
    return PhotoView(scan.photo, sheet, faces, resolution(sheet, faces, size_mm, scan.photo.shape[:2], name))


def shrunk(sight: PhotoView, ppi: float) -> PhotoView:
    """The same with a photo made smaller, to about so many pixels per inch of page: quick to draw from."""
    import cv2

    times = round(sight.resolution.median_ppi / ppi)
    if times < 2:
        return sight
    rows, cols = (n // times for n in sight.photo.shape[:2])
    if min(rows, cols) < 1:
        return sight
    whole = np.ascontiguousarray(sight.photo[: rows * times, : cols * times])
    small = cv2.resize(whole, (cols, rows), interpolation=cv2.INTER_AREA)
    places = (sight.uv_map.photo_xy + 0.5) / times - 0.5
    sheet = replace(sight.uv_map, photo_xy=places, jacobian=sight.uv_map.jacobian / times)
    return replace(sight, photo=small, uv_map=sheet)
