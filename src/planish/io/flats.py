"""What leaves as a mesh: the flattened sheet, and scans that `read_scan` takes back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np

from planish.errors import OutputError
from planish.io.files import write_bytes
from planish.io.obj import obj_parts
from planish.io.pages import write_page
from planish.io.polygons import Polygons, of_triangles
from planish.io.scans import ReadScan
from planish.io.units import MM_PER_UNIT
from planish.types import Floats, Page, Scan


def write_flat(
    path: str | Path,
    found: ReadScan,
    page_xy: Floats,
    *,
    as_: Literal["points", "uv"] = "points",
    scalars: Mapping[str, Floats] | None = None,
) -> None:
    """Write a flattened scan: its points in their order and its faces as they were.

    Parameters
    ----------
    path : str or Path
        .obj
    found : ReadScan
    page_xy : (n, 2) float64 [mm]
        x right, y down: where each point of the scan lies on the page.
    as_ : {"points", "uv"}
        points: the points move to the plane z = 0, in mm, y up, so that seen from +z the page is not mirrored;
        texture coordinates stay. uv: the points stay in space, in the file's own numbers, and their place on the
        page [mm], y up, becomes their texture coordinate.

    Raises
    ------
    OutputError
    """
    path = Path(path)
    if path.suffix.lower() != ".obj":
        raise OutputError(f"{path}: a flattened mesh is written as .obj; {path.suffix} is none of them")
    up = np.stack([page_xy[:, 0], page_xy[:, 1].max(initial=0.0) - page_xy[:, 1]], axis=1)
    polygons = found.polygons
    if as_ == "uv":
        points = found.scan.mesh.points / MM_PER_UNIT[found.unit]
        polygons = Polygons(polygons.sizes, polygons.corners, up, polygons.corners)
        comment = f"points as in the scan [{found.unit}]; texture coordinates: place on the page [mm]"
    else:
        points = np.c_[up, np.zeros(len(up))]
        comment = "units: mm; the flattened sheet, in the order of the scan's points"
    write_bytes(path, obj_parts(points, polygons, comment=comment))


def write_scan(path: str | Path, scan: Scan) -> None:
    """Write a scan so that `read_scan` takes it back: mesh [mm], photo, texture coordinates.

    Parameters
    ----------
    path : str or Path
        .obj; the photo goes beside it, as JPEG (quality 95; PNG for 16 bit), and an MTL that names it.
    scan : Scan

    Raises
    ------
    OutputError
    """
    path = Path(path)
    polygons = _with_uv(scan)
    material = None
    if scan.photo is not None:
        name = path.with_suffix(".jpg" if scan.photo.dtype == np.uint8 else ".png").name
        write_page(path.with_name(name), Page(scan.photo, np.ones(scan.photo.shape[:2], bool), 72.0, scan.icc))
        mtl = path.with_suffix(".mtl")
        write_bytes(mtl, f"newmtl page\nKd 1 1 1\nmap_Kd {name}\n".encode())
        material = (mtl.name, "page")
    write_bytes(path, obj_parts(scan.mesh.points, polygons, material=material, comment="units: mm"))


def _with_uv(scan: Scan) -> Polygons:
    """The scan's faces with photo places as texture coordinates."""
    if scan.photo is None or scan.photo_xy is None:
        return of_triangles(scan.mesh.faces)
    rows, cols = scan.photo.shape[:2]
    places = scan.photo_xy.reshape(-1, 2)
    uv = np.stack([(places[:, 0] + 0.5) / cols, 1 - (places[:, 1] + 0.5) / rows], axis=1)
    seen = np.isfinite(uv).all(1)
    row = np.where(seen, np.cumsum(seen) - 1, -1)
    if scan.photo_xy.ndim == 2:
        row = row[scan.mesh.faces]
    return of_triangles(scan.mesh.faces, uv[seen], row)
