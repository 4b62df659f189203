"""What each photo of a scan shows of the sheet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from planish.errors import InputError
from planish.render.point_colours import FINER, picture_of_colours
from planish.render.resolution import Resolution, resolution
from planish.render.uv_map import UVMap, uv_map
from planish.render.visibility import visible_faces
from planish.types import Floats, Ints, Pixels, Scan, Texture


@dataclass(frozen=True, eq=False)
class PhotoView:
    """A photo, and what it shows of the sheet.

    Attributes
    ----------
    uv_map : UVMap
    faces : (m, 3) int32
        Those of the map that the photo saw.
    resolution : Resolution
    photo : (rows, cols, 3) uint8 or uint16, or None
    textures : tuple of Texture
        Instead of the photo: several images, each shown by some of the faces.
    image : (m,) int32 or None
        The number of each face's texture.
    name : str
        Of the photo, for messages.
    finer : float
        The photo has so many pixels to one that was measured: it was interpolated.
    """

    uv_map: UVMap
    faces: Ints
    resolution: Resolution
    photo: Pixels | None = None
    textures: tuple[Texture, ...] = ()
    image: Ints | None = None
    name: str = "the photo"
    finer: float = 1.0

    @property
    def dtype(self) -> np.dtype:
        """Of the pixels."""
        return np.result_type(*(texture.dtype for texture in self.textures)) if self.photo is None else self.photo.dtype

    @property
    def shapes(self) -> list[tuple[int, ...]]:
        """Rows and columns of each image."""
        return [texture.shape_rc for texture in self.textures] if self.photo is None else [self.photo.shape[:2]]


def photo_views(scan: Scan, page_xy: Floats, size_mm: tuple[float, float]) -> list[PhotoView]:
    """Map the sheet to every photo of a scan, the main one first; several textures are one view.

    Raises
    ------
    InputError
        Where the scan has no photo, or none of the sheet falls on one of them.
    """
    if scan.photo is None and not scan.textures and scan.colours is not None:
        return [_of_colours(scan, page_xy, size_mm)]
    if (scan.photo is None and not scan.textures) or (scan.photo_xy is None and scan.camera is None):
        raise InputError(
            "the scan has no photo that could be drawn: neither texture coordinates nor a camera came with it; give "
            "both a photo and its camera, or flatten the mesh alone"
        )
    several = [scan, *(Scan.owned(scan.mesh, view.photo, camera=view.camera) for view in scan.others)]
    names = ["the photo"] if len(several) == 1 else [f"photo {i + 1} of {len(several)}" for i in range(len(several))]
    return [_view(one, page_xy, size_mm, name) for one, name in zip(several, names, strict=True)]


def _view(scan: Scan, page_xy: Floats, size_mm: tuple[float, float], name: str, finer: float = 1.0) -> PhotoView:
    sheet = uv_map(scan, page_xy)
    seen = visible_faces(sheet, scan.camera)
    faces, image = sheet.faces[seen], None if sheet.image is None else sheet.image[seen]
    textures = scan.textures if scan.photo is None else ()
    unmeasured = Resolution(np.zeros((0, 0), np.float32), 0.0, 0.0)
    view = PhotoView(sheet, faces, unmeasured, scan.photo, textures, image, name, finer)
    return replace(view, resolution=_measured(view, size_mm))


def _of_colours(scan: Scan, page_xy: Floats, size_mm: tuple[float, float]) -> PhotoView:
    """A view of the points' own colours: they are drawn on the page, finely, and that is the photo."""
    photo, px_per_mm = picture_of_colours(scan, page_xy, size_mm)
    drawn = Scan(scan.mesh, photo, photo_xy=page_xy * px_per_mm - 0.5)
    return _view(drawn, page_xy, size_mm, "the picture of the points' colours", FINER)


def _measured(view: PhotoView, size_mm: tuple[float, float]) -> Resolution:
    found = resolution(view.uv_map, view.faces, size_mm, view.shapes, view.image, view.name)
    if view.finer == 1:
        return found
    return Resolution(found.ppi / np.float32(view.finer), found.median_ppi / view.finer, found.low_ppi / view.finer)


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
    moved = replace(view, uv_map=there)
    return replace(moved, resolution=_measured(moved, size_mm))


def shrunk(view: PhotoView, ppi: float) -> PhotoView:
    """The same with a photo made smaller, to about so many pixels per inch of page: quick to draw from."""
    times = round(view.resolution.median_ppi / ppi)
    if times < 2 or min(min(shape) for shape in view.shapes) < times:
        return view
    places = (view.uv_map.photo_xy + 0.5) / times - 0.5
    sheet = replace(view.uv_map, photo_xy=places, jacobian=view.uv_map.jacobian / times)
    small = None if view.photo is None else _smaller(view.photo, times)
    textures = tuple(_smaller_texture(texture, times) for texture in view.textures)
    return replace(view, photo=small, textures=textures, uv_map=sheet)


def _smaller(photo: Pixels, times: int) -> Pixels:
    import cv2

    rows, cols = (n // times for n in photo.shape[:2])
    whole = np.ascontiguousarray(photo[: rows * times, : cols * times])
    return cv2.resize(whole, (cols, rows), interpolation=cv2.INTER_AREA)


def _smaller_texture(texture: Texture, times: int) -> Texture:
    rows, cols = texture.shape_rc
    return Texture((rows // times, cols // times), texture.bits, lambda: _smaller(texture.read(), times))
