"""Photo, textures or colours of a scan: which there are, and where its faces lie on them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.io.filemesh import FileMesh
from planish.io.files import read_bytes
from planish.io.images import Photo, decode_photo, read_photo
from planish.io.polygons import Polygons, uv_of_points
from planish.io.textures import Image
from planish.io.uv_charts import OUTSIDE
from planish.types import Bools, Diagnostic, Floats, Ints, Pixels, Texture, known_places

KEPT_BYTES = 600e6
"""So many bytes of decoded textures stay in memory; further ones are decoded again whenever they are drawn (0.7 s for
8192 x 8192). With half of it a set of 16 x 4096 x 4096 takes 3 s longer, with twice as much planish takes 2 GB."""


@dataclass(frozen=True, eq=False)
class Textures:
    """Several images of a mesh.

    Attributes
    ----------
    images : tuple of Texture
    of_face : (m,) int32
        Number of the image of each triangle; -1 for none.
    photo_xy : (m, 3, 2) float64 [px]
        Place of each corner on the image of its face; NaN where it has none.
    icc : bytes or None
    warnings : list of Diagnostic
    files : list of Path
        Those that were read.
    """

    images: tuple[Texture, ...]
    of_face: Ints
    photo_xy: Floats
    icc: bytes | None
    warnings: list[Diagnostic]
    files: list[Path]


def decode_image(path: Path, source: Image, *, upright: bool = False) -> Photo:
    """Decode a photo, or an image inside the mesh file `path`."""
    if isinstance(source, bytes):
        return decode_photo(f"the image in {path}", source, upright=upright)
    return decode_photo(str(source), read_bytes(source), upright=upright)


def read_textures(path: Path, found: FileMesh, triangles: NDArray[np.int64]) -> Textures:
    """Read the images that a mesh's faces show, two or more; those that cannot be read stay blank, which is said.

    Parameters
    ----------
    path : Path
        Of the mesh.
    found : FileMesh
        With images and texture coordinates.
    triangles : (m, 3) int64
        Rows of the polygons' corners, from `triangulate`.
    """
    assert found.images is not None
    images: list[Texture] = []
    warnings: list[Diagnostic] = []
    files: list[Path] = []
    owner = found.polygons.triangle_owner
    of_face = np.full(len(triangles), -1, np.int32)
    shown = found.images.of_face[owner]
    icc: bytes | None = None
    room = KEPT_BYTES
    for number in sorted(found.images.shown):
        source, name = found.images.files[number], found.images.names[number]
        if source is None:
            continue
        try:
            photo, digest = _decoded(path, source)
        except InputError as problem:
            warnings.append(
                Diagnostic("texture-unreadable", f"a texture was left out: {problem.sentence}", problem.hint)
            )
            continue
        warnings += [warning for warning in photo.warnings if warning not in warnings]
        if images and photo.icc != icc:
            sentence = f"{name} has another colour profile than the first image; its colours were taken as they are"
            warnings.append(Diagnostic("colour-profiles-differ", sentence))
        icc = icc if images else photo.icc
        of_face[shown == number] = len(images)
        pixels = photo.pixels if photo.pixels.nbytes <= room else None
        room -= 0 if pixels is None else pixels.nbytes
        read = _later(path, source, digest) if pixels is None else _kept(pixels)
        images.append(Texture(photo.pixels.shape[:2], 8 * photo.pixels.dtype.itemsize, read))
        files += [] if isinstance(source, bytes) else [source]
    blank = int(((shown >= 0) & (of_face < 0)).sum())
    if blank and images:
        sentence = f"{path}: {blank} faces show an image that cannot be read; they stay blank"
        warnings.append(Diagnostic("several-images", sentence))
    photo_xy = _corner_places(found.polygons, triangles, of_face, [image.shape_rc for image in images])
    warnings += outside_warning(path, found.polygons)
    return Textures(tuple(images), of_face, photo_xy, icc, warnings, files)


def _decoded(path: Path, source: Image) -> tuple[Photo, str]:
    if isinstance(source, bytes):
        return decode_image(path, source), ""
    data = read_bytes(source)
    return decode_photo(str(source), data), hashlib.sha256(data).hexdigest()


def _kept(pixels: Pixels) -> Callable[[], Pixels]:
    return lambda: pixels


def _later(path: Path, source: Image, digest: str) -> Callable[[], Pixels]:
    """Decodes an image anew; refused where its file is no longer the one that was read before."""

    def read() -> Pixels:
        photo, now = _decoded(path, source)
        if now != digest:
            raise InputError(f"{source!s} was changed while the scan was restored; start again")
        return photo.pixels

    return read


def places_on_photo(
    path: Path, polygons: Polygons, triangles: NDArray[np.int64], count: int, shape_rc: tuple[int, int]
) -> tuple[Floats | None, list[Diagnostic]]:
    """Texture coordinates as photo pixels: per point (n, 2) where each point has one place, else per corner (m, 3, 2).

    Pixel centres lie at integers, so u = 0 is x = -0.5. Corners without texture coordinates get NaN.
    """
    if polygons.uv is None or polygons.uv_corners is None or not (polygons.uv_corners >= 0).any():
        return None, []
    warnings = outside_warning(path, polygons)
    places = _in_pixels(polygons.uv, *shape_rc)
    row_of_point = uv_of_points(polygons, count)
    if row_of_point is not None:
        return np.asarray(places[row_of_point]), warnings
    return np.asarray(places[polygons.uv_corners[triangles]]), warnings


def _in_pixels(uv: Floats, rows: int, cols: int) -> Floats:
    """Places (t + 1, 2); the last row, NaN, is for corners without texture coordinates (-1)."""
    uv = np.vstack([uv, [np.nan, np.nan]])
    with np.errstate(invalid="ignore", over="ignore"):
        places = np.stack([uv[:, 0] * cols - 0.5, (1 - uv[:, 1]) * rows - 0.5], axis=1)
    return known_places(places)


def _corner_places(
    polygons: Polygons, triangles: NDArray[np.int64], of_face: Ints, shapes: list[tuple[int, int]]
) -> Floats:
    assert polygons.uv is not None
    assert polygons.uv_corners is not None
    places = np.full((len(triangles), 3, 2), np.nan)
    for number, (rows, cols) in enumerate(shapes):
        mine = of_face == number
        places[mine] = _in_pixels(polygons.uv, rows, cols)[polygons.uv_corners[triangles[mine]]]
    return places


def only_image(found: FileMesh, number: int) -> Polygons:
    """The polygons with the texture coordinates of the faces that show one image, where the file tells which do."""
    polygons, images = found.polygons, found.images
    if images is None or not images.shown or polygons.uv_corners is None:
        return polygons
    blank = np.repeat(images.of_face != number, polygons.sizes)
    if not blank.any():
        return polygons
    uv_corners = np.where(blank, -1, polygons.uv_corners).astype(np.int32)
    return Polygons(polygons.sizes, polygons.corners, polygons.uv, uv_corners)


def outside_warning(path: Path, polygons: Polygons) -> list[Diagnostic]:
    """A warning on face corners that lie outside of the image."""
    assert polygons.uv is not None
    assert polygons.uv_corners is not None
    used = polygons.uv[polygons.uv_corners[polygons.uv_corners >= 0]]
    with np.errstate(invalid="ignore"):
        outside = int(((used < -OUTSIDE) | (used > 1 + OUTSIDE)).any(1).sum())
    if not outside:
        return []
    sentence = (
        f"{path}: {outside} of {len(polygons.corners)} face corners have texture coordinates outside 0 to 1, so the"
    )
    return [Diagnostic("texture-outside-photo", f"{sentence} photo does not show them")]


def read_sheet_mask(path: str | Path) -> Bools:
    """Read the mask of a sheet: true where the image is not 0; of a JPEG, whose black is never quite so, above 127.

    Raises
    ------
    InputError
        If the image cannot be read, or is black all over.
    """
    pixels = read_photo(path).pixels.max(axis=2)
    mask = np.asarray(pixels > (127 if Path(path).suffix.lower() in (".jpg", ".jpeg") else 0))
    if not mask.any():
        raise InputError(f"{path} is black all over; paint it white where the sheet is")
    return mask
