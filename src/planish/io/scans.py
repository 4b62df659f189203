"""A scan from its files: mesh, photo, camera and unit brought together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planish.display.one_line import one_line
from planish.errors import InputError
from planish.geometry import depths
from planish.io.cameras import read_camera, scaled_camera
from planish.io.filemesh import FileMesh
from planish.io.files import recording_digests
from planish.io.images import Photo, stored_shape
from planish.io.meshes import read_mesh
from planish.io.polygons import Polygons, triangulate
from planish.io.scan_photos import decode_image, only_image, places_on_photo, read_sheet_mask, read_textures
from planish.io.textures import Image, no_images
from planish.io.units import Unit, decide_unit
from planish.io.views import Files, listed, matched
from planish.settings import mm_per_unit
from planish.types import Camera, Diagnostic, Floats, Ints, Mesh, Pixels, Scan, Texture, View, few_of_a_kind


@dataclass(frozen=True, eq=False)
class ReadScan:
    """A scan, and what of its file is needed to write the flat mesh as the file had it.

    Attributes
    ----------
    scan : Scan
        In mm; the points in the file's order, the faces cut into triangles.
    unit : str
        That the file's numbers were taken to be in.
    warnings : list of Diagnostic
    polygons : Polygons
        The file's own faces and texture coordinates.
    sources : tuple of Path
        The files that were read: the mesh (a folder for tifxyz), photos that are files of their own, cameras, mask.
    sheet_mask : Path or None
        The mask of the sheet, if one was given.
    digests : dict
        SHA-256 of the bytes that were read of each file.
    """

    scan: Scan
    unit: Unit
    warnings: list[Diagnostic]
    polygons: Polygons
    sources: tuple[Path, ...] = ()
    sheet_mask: Path | None = None
    digests: dict[Path, str] = field(default_factory=dict)

    __repr__ = one_line


def read_scan(
    path: str | Path,
    *,
    photo: Files = None,
    camera: Files = None,
    units: str = "auto",
    inside: str | Path | None = None,
    sheet: str | Path | None = None,
) -> ReadScan:
    """Read a scan.

    The photo is the one that `photo` names, else the texture that the mesh file names or holds. Where its parts lie
    is told by the texture coordinates; but if both `photo` and `camera` are given, by the camera. Of several photos
    the first is the main one, whose colours the page gets.

    Parameters
    ----------
    path : str or Path
        OBJ, PLY, GLB, glTF or a tifxyz folder.
    photo : str or Path, or several, optional
    camera : str or Path, or several, optional
        JSON, see `read_camera`; its numbers are in the unit of the mesh. For several photos as many in the same order,
        or one file that has all of them by name.
    units : {"auto", "mm", "cm", "m", "in"} or a length
        Such as "7.91um" for voxels of that side.
    inside : str or Path, optional
        For scans from strangers: the only folder from which files are read that the mesh itself names (materials,
        buffers, images, also through links); others count as missing. By default they may lie anywhere.
    sheet : str or Path, optional
        Image that is white (not 0) where the photo shows the sheet; what lies elsewhere is surroundings.

    Raises
    ------
    InputError
        If a file is missing, damaged, of the wrong kind, or the files do not belong together.
    """
    with recording_digests() as digests:
        read = _read_scan(Path(path), photo, camera, units, None if inside is None else Path(inside))
        if sheet is not None:
            masked = replace(read.scan, sheet=read_sheet_mask(sheet))
            read = replace(read, scan=masked, sources=(*read.sources, Path(sheet)), sheet_mask=Path(sheet))
    return replace(read, digests=digests)


def _read_scan(path: Path, photo: Files, camera: Files, units: str, inside: Path | None) -> ReadScan:
    photos = listed(photo)
    cameras = matched(photos, listed(camera))
    main, seen_by = (photos[0] if photos else None), cameras[0]
    found = read_mesh(path, inside)
    unit, extra = decide_unit(_used(found), units, found.unit)
    warnings = [*found.warnings, *extra]
    scale = mm_per_unit(unit)
    points = found.points * scale
    triangles = triangulate(points, found.polygons)
    mesh = Mesh.owned(points, found.polygons.corners[triangles])
    seen_from = _camera_of(seen_by, _photo_name(found, main), main or found.texture, points, scale, warnings)
    shown = _shown(path, found, main, seen_by, seen_from, triangles, warnings)
    others = [
        _view(path, found, one, where, points, scale, shown.icc, warnings)
        for one, where in zip(photos[1:], cameras[1:], strict=True)
    ]
    scan = Scan.owned(
        mesh,
        photo=shown.photo,
        photo_xy=shown.photo_xy,
        camera=shown.camera,
        icc=shown.icc,
        others=tuple(others),
        textures=shown.textures,
        texture_of_face=shown.texture_of_face,
        colours=found.colours if shown.nothing else None,
    )
    if shown.nothing and found.colours is not None:
        sentence = f"{path} has no image, so the page is drawn in the colours of its points"
        warnings.append(Diagnostic("colours-of-points", sentence))
    files = (path, *shown.files, *photos[1:], *dict.fromkeys(cameras))
    sources = tuple(Path(file) for file in files if file is not None)
    return ReadScan(scan, unit, few_of_a_kind(warnings), found.polygons, sources)


@dataclass(frozen=True, eq=False)
class _Shown:
    """What the page is drawn from: a photo, or several textures, or nothing."""

    photo: Pixels | None = None
    photo_xy: Floats | None = None
    icc: bytes | None = None
    textures: tuple[Texture, ...] = ()
    texture_of_face: Ints | None = None
    files: Sequence[Path] = ()
    camera: Camera | None = None

    @property
    def nothing(self) -> bool:
        return self.photo is None and not self.textures


def _shown(
    path: Path,
    found: FileMesh,
    main: Path | None,
    seen_by: Path | None,
    seen_from: Camera | None,
    triangles: NDArray[np.int64],
    warnings: list[Diagnostic],
) -> _Shown:
    """The photo that the user names, else the image or the images that the mesh's faces show."""
    images = found.images or no_images(len(found.polygons.sizes))
    if main is None and len(images.shown) > 1:
        if seen_from is not None:
            raise InputError(
                f"{path} has {len(images.shown)} images, and {seen_by} is one camera",
                "give {photo}, the image that it took",
            )
        read = read_textures(path, found, triangles)
        warnings += read.warnings
        if not read.images:
            return _Shown()
        return _Shown(None, read.photo_xy, read.icc, read.images, read.of_face, read.files)
    source = found.texture if main is None else main
    picture = _picture(path, source, seen_from, warnings, must=main is not None)
    if picture is None or source is None:
        return _Shown(camera=seen_from)
    seen_from = _of_same_size(seen_by, seen_from, source, picture, warnings)
    number = next((k for k in images.shown if main is not None and _same_file(images.files[k], main)), None)
    photo_xy = None
    if seen_from is None or main is None or number is not None:
        number = images.shown[0] if number is None and images.shown else number or 0
        polygons = only_image(found, number)
        if len(images.shown) > 1:
            blank = int((images.of_face != number).sum())
            sentence = (
                f"{path} has {len(images.shown)} images; {source!s} stands for {images.names[number]}, and {blank}"
            )
            warnings.append(Diagnostic("several-images", f"{sentence} faces on others stay blank"))
        photo_xy, extra = places_on_photo(path, polygons, triangles, len(found.points), picture.pixels.shape[:2])
        warnings += extra
    if photo_xy is None and seen_from is None:
        raise InputError(
            f"{path} has no texture coordinates, so nothing tells where its points lie on the photo",
            "give {camera}",
        )
    return _Shown(
        picture.pixels, photo_xy, picture.icc, files=[] if isinstance(source, bytes) else [source], camera=seen_from
    )


def _used(found: FileMesh) -> Floats:
    """The points that faces use: others tell nothing of the sheet's size."""
    used = np.zeros(len(found.points), bool)
    used[found.polygons.corners] = True
    return found.points[used]


def _camera_of(
    path: Path | None,
    photo_name: str | None,
    photo: Image | None,
    points: Floats,
    mm_per_unit: float,
    warnings: list[Diagnostic],
) -> Camera | None:
    if path is None:
        return None
    photo_shape = None if photo is None else stored_shape(photo)
    camera = read_camera(path, photo_name, mm_per_unit=mm_per_unit, photo_shape=photo_shape, warnings=warnings)
    _check_in_front(path, camera, points)
    return camera


def _view(
    path: Path,
    found: FileMesh,
    photo: Path,
    seen_by: Path | None,
    points: Floats,
    mm_per_unit: float,
    icc: bytes | None,
    warnings: list[Diagnostic],
) -> View:
    """A further photo and its camera; `icc` is the colour profile of the main one."""
    camera = _camera_of(seen_by, photo.name, photo, points, mm_per_unit, warnings)
    picture = _picture(path, photo, camera, warnings, must=True)
    assert camera is not None
    assert picture is not None
    camera = _of_same_size(seen_by, camera, photo, picture, warnings)
    assert camera is not None
    if picture.icc != icc:
        warnings.append(
            Diagnostic(
                "colour-profiles-differ",
                f"{photo} has another colour profile than the first photo; its brightness was matched to that one's, "
                "its colours were taken as they are",
            )
        )
    return View.owned(picture.pixels, camera)


def _photo_name(found: FileMesh, photo: str | Path | None) -> str | None:
    if photo is not None:
        return Path(photo).name
    return found.texture.name if isinstance(found.texture, Path) else None


def _picture(
    path: Path, source: Image | None, camera: Camera | None, warnings: list[Diagnostic], *, must: bool
) -> Photo | None:
    """The photo that the user names, or else the texture, if it can be read: the geometry does without."""
    if source is None:
        return None
    try:
        picture = decode_image(path, source)
        if camera is not None and picture.pixels.shape[:2] != camera.shape_rc:
            upright = decode_image(path, source, upright=True)
            picture = upright if upright.pixels.shape[:2] == camera.shape_rc else picture
    except InputError as problem:
        if must:
            raise
        warnings.append(Diagnostic("texture-unreadable", f"the texture was left out: {problem.sentence}", problem.hint))
        return None
    warnings += picture.warnings
    return picture


def _same_file(texture: Image | None, photo: Path) -> bool:
    return isinstance(texture, Path) and photo.exists() and texture.samefile(photo)


def _check_in_front(path: str | Path, camera: Camera, points: Floats) -> None:
    finite = points[np.isfinite(points).all(1)]
    if np.median(depths(camera, finite)) <= 0:
        raise InputError(
            f"{path}: the camera looks away from the scan, which lies behind it; do the two belong together?"
        )


def _of_same_size(
    path: Path | None, camera: Camera | None, source: Image, picture: Photo, warnings: list[Diagnostic]
) -> Camera | None:
    """The camera for the photo's size: scaled where the sizes differ by one factor, else refused."""
    if camera is None or picture.pixels.shape[:2] == camera.shape_rc:
        return camera
    scaled = scaled_camera(camera, picture.pixels.shape[:2])
    if scaled is not None:
        factor = scaled.shape_rc[1] / camera.shape_rc[1]
        sentence = f"{path} is for a photo of another size; its numbers were multiplied by {factor:.4g}"
        warnings.append(Diagnostic("camera-scaled", sentence))
        return scaled
    name = "the texture" if isinstance(source, bytes) else str(source)
    (rows, cols), (wanted_rows, wanted_cols) = picture.pixels.shape[:2], camera.shape_rc
    raise InputError(
        f"{name} is {cols} x {rows} pixels, but {path} is for a photo of {wanted_cols} x {wanted_rows}; give the photo"
        " that the camera's numbers belong to"
    )
