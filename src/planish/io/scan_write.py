"""Scans to files that `read_scan` takes back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from planish.errors import OutputError
from planish.io.cameras import camera_as_json
from planish.io.encode import jpeg_bytes, png_bytes
from planish.io.files import all_or_nothing, write_bytes, write_json
from planish.io.gltf_write import glb_bytes, one_uv_per_point
from planish.io.obj import obj_parts
from planish.io.ply_write import ply_parts
from planish.io.polygons import Polygons, of_triangles
from planish.settings import MM_PER_UNIT
from planish.types import Floats, Pixels, Scan, Texture


def write_scan(path: str | Path, scan: Scan) -> list[Path]:
    """Write a scan so that `read_scan` takes it back: mesh, photo, texture coordinates, camera.

    OBJ and PLY are in mm, and the photo goes beside them under the same name: as JPEG of quality 95, or as PNG if it
    has 16 bits. GLB is in metres (float32) and holds the photo. A camera goes beside as NAME_camera.json, in the unit
    of the mesh. Where there are further photos, all lie beside the mesh, the others as NAME-2, NAME-3 and so on, and
    all cameras in NAME_cameras.json, to be given to `read_scan` with the photos. Several textures go beside an OBJ or
    PLY as NAME-1, NAME-2 and so on.

    Parameters
    ----------
    path : str or Path
        .obj, .ply or .glb.
    scan : Scan

    Returns
    -------
    list of Path
        The files written, the mesh first.

    Raises
    ------
    OutputError
        If the suffix is another, a file cannot be written, or there are several photos and the first has no camera.

    Examples
    --------
    >>> import tempfile
    >>> from planish.types import Mesh
    >>> mesh = Mesh(np.array([[0.0, 0, 0], [200, 0, 0], [0, 280, 0]]), np.array([[0, 1, 2]]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     [file.name for file in write_scan(f"{folder}/sheet.ply", Scan(mesh))]
    ['sheet.ply']
    """
    path = Path(path)
    check_scan_name(path)
    if scan.others and (scan.photo is None or scan.camera is None):
        raise OutputError(
            f"{path}: the scan has several photos, and is written only with the camera of each; the first has none"
        )
    in_metres = path.suffix.lower() == ".glb"
    if scan.textures and in_metres:
        raise OutputError(f"{path}: the scan has {len(scan.textures)} textures; write it as .obj or .ply")
    photo = None if scan.photo is None else _encoded(scan.photo, scan.icc)
    written, name = [path], None
    with all_or_nothing():
        if photo is not None and (scan.others or not in_metres):
            written.append(_write_photo(path, photo))
            name = written[-1].name
        textures = [_write_texture(path, k, texture) for k, texture in enumerate(scan.textures, 1)]
        written += textures
        if in_metres:
            write_bytes(path, _glb(scan, photo))
        elif textures:
            write = _write_textured_obj if path.suffix.lower() == ".obj" else _write_textured_ply
            written += write(path, scan, [file.name for file in textures])
        else:
            written += (_write_obj if path.suffix.lower() == ".obj" else _write_ply)(path, scan, name)
        written += _write_cameras(path, scan, name, MM_PER_UNIT["m"] if in_metres else 1.0)
    return written


def check_scan_name(path: Path) -> None:
    """Refuse a suffix that no scan is written as."""
    if path.suffix.lower() not in (".obj", ".ply", ".glb"):
        raise OutputError(
            f"{path}: a scan is written as .obj, .ply or .glb; {path.suffix or 'no suffix'} is none of them"
        )


def _encoded(photo: Pixels, icc: bytes | None) -> bytes:
    return (jpeg_bytes if photo.dtype == np.uint8 else png_bytes)(photo, icc=icc)


def _write_photo(path: Path, photo: bytes) -> Path:
    """Under the name of `path`, with the suffix of its kind."""
    named = path.with_name(path.stem + (".png" if photo.startswith(b"\x89PNG") else ".jpg"))
    write_bytes(named, photo)
    return named


def _write_cameras(path: Path, scan: Scan, photo_name: str | None, mm_per_unit: float) -> list[Path]:
    """The camera beside the mesh; or further photos, and the cameras of all."""
    if scan.camera is None:
        return []
    main = camera_as_json(scan.camera, mm_per_unit=mm_per_unit)
    if not scan.others:
        file = path.with_name(f"{path.stem}_camera.json")
        write_json(file, main)
        return [file]
    cameras, written = {photo_name: main}, []
    for number, view in enumerate(scan.others, 2):
        photo = _encoded(view.photo, scan.icc)
        written.append(_write_photo(path.with_name(f"{path.stem}-{number}{path.suffix}"), photo))
        cameras[written[-1].name] = camera_as_json(view.camera, mm_per_unit=mm_per_unit)
    file = path.with_name(f"{path.stem}_cameras.json")
    write_json(file, {"cameras": cameras})
    return [*written, file]


def _write_obj(path: Path, scan: Scan, photo_name: str | None) -> list[Path]:
    mtl = path.with_suffix(".mtl")
    material = None
    if photo_name is not None:
        write_bytes(mtl, f"newmtl page\nKd 1 1 1\nmap_Kd {photo_name}\n".encode())
        material = (mtl.name, "page")
    write_bytes(path, obj_parts(scan.mesh.points, _textured(scan), material=material, comment="units: mm"))
    return [mtl] if material else []


def _write_ply(path: Path, scan: Scan, photo_name: str | None) -> list[Path]:
    uv = None
    polygons = _textured(scan)
    if scan.photo is not None and scan.photo_xy is not None and scan.photo_xy.ndim == 2:
        uv = _uv(scan.photo_xy, scan.photo.shape[:2])
    write_bytes(path, ply_parts(scan.mesh.points, polygons, point_uv=uv, texture=photo_name, comments=["units: mm"]))
    return []


def _write_texture(path: Path, number: int, texture: Texture) -> Path:
    return _write_photo(path.with_name(f"{path.stem}-{number}{path.suffix}"), _encoded(texture.read(), None))


def _write_textured_obj(path: Path, scan: Scan, names: list[str]) -> list[Path]:
    assert scan.texture_of_face is not None
    mtl = path.with_suffix(".mtl")
    blocks = [f"newmtl page{k}\nKd 1 1 1\nmap_Kd {name}\n" for k, name in enumerate(names)]
    write_bytes(mtl, "\n".join([*blocks, "newmtl blank\nKd 1 1 1\n"]).encode())
    materials = [f"page{k}" if k >= 0 else "blank" for k in scan.texture_of_face.tolist()]
    parts = obj_parts(
        scan.mesh.points,
        _of_textures(scan),
        material=(mtl.name, materials[0] if materials else "blank"),
        material_of_face=materials,
        comment="units: mm",
    )
    write_bytes(path, parts)
    return [mtl]


def _write_textured_ply(path: Path, scan: Scan, names: list[str]) -> list[Path]:
    assert scan.texture_of_face is not None
    comments = ["units: mm", *(f"TextureFile {name}" for name in names)]
    columns = {"texnumber": scan.texture_of_face}
    write_bytes(path, ply_parts(scan.mesh.points, _of_textures(scan), comments=comments, face_columns=columns))
    return []


def _of_textures(scan: Scan) -> Polygons:
    """The faces with their places on their own images as texture coordinates."""
    assert scan.photo_xy is not None
    assert scan.texture_of_face is not None
    shapes = np.array([texture.shape_rc for texture in scan.textures])[np.maximum(scan.texture_of_face, 0)]
    rows, cols = shapes[:, :1], shapes[:, 1:]
    uv = np.stack([(scan.photo_xy[..., 0] + 0.5) / cols, 1 - (scan.photo_xy[..., 1] + 0.5) / rows], axis=-1)
    uv = uv.reshape(-1, 2)
    seen = np.isfinite(uv).all(axis=1) & np.repeat(scan.texture_of_face >= 0, 3)
    row = np.where(seen, np.cumsum(seen) - 1, -1).astype(np.int32)
    return of_triangles(scan.mesh.faces, uv[seen], row.reshape(-1, 3))


def _glb(scan: Scan, photo: bytes | None) -> bytes:
    polygons, points, faces, uv = _textured(scan), scan.mesh.points, scan.mesh.faces, None
    if polygons.uv is not None and polygons.uv_corners is not None:
        corners = polygons.uv_corners.reshape(-1, 3)
        faces, source, uv = one_uv_per_point(len(points), faces, polygons.uv, corners)
        points = points[source]
    return glb_bytes(points, faces, uv, photo)


def _uv(photo_xy: Floats, shape_rc: tuple[int, int]) -> Floats:
    """Texture coordinates (k, 2), v up; the inverse of what reading does."""
    rows, cols = shape_rc
    places = photo_xy.reshape(-1, 2)
    return np.stack([(places[:, 0] + 0.5) / cols, 1 - (places[:, 1] + 0.5) / rows], axis=1)


def _textured(scan: Scan) -> Polygons:
    """The scan's faces with photo places as texture coordinates; those that are not finite are left out."""
    if scan.photo is None or scan.photo_xy is None:
        return of_triangles(scan.mesh.faces)
    uv = _uv(scan.photo_xy, scan.photo.shape[:2])
    seen = np.isfinite(uv).all(1)
    row = np.where(seen, np.cumsum(seen) - 1, -1).astype(np.int32)
    if scan.photo_xy.ndim == 2:
        row = row[scan.mesh.faces]
    return of_triangles(scan.mesh.faces, uv[seen], row)
