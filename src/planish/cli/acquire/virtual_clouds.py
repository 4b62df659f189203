"""`planish acquire virtual grid` and `points`: point clouds of a virtual scanner and of virtual photogrammetry."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from planish.gallery import Sheet
    from planish.types import Floats, Page, Pixels


def grid(folder: Path, sheet: Sheet, small: bool) -> Page:
    """Write range.ply, a range image like that of the paper's scanner."""
    import numpy as np

    from planish.gallery.clouds import range_image

    sides = (320, 240) if sheet.height_mm >= sheet.width_mm else (240, 320)
    capture = range_image(sheet, shape_rc=sides if small else None)
    rows, cols = capture.points.shape[:2]
    points, colours = np.nan_to_num(capture.points).reshape(-1, 3), capture.colours.reshape(-1, 3)
    _write_points(folder / "range.ply", points, colours, [f"width {cols}", f"height {rows}", "units: mm"])
    return capture.page


def points(folder: Path, sheet: Sheet, small: bool) -> Page:
    """Write points.ply, a photogrammetry cloud, and a photo with its camera."""
    from planish.cli.acquire.virtual_files import write_camera, write_images
    from planish.gallery.clouds import photogrammetry_cloud

    capture = (
        photogrammetry_cloud(sheet, points=75_000, photo_px=(2000, 1500)) if small else photogrammetry_cloud(sheet)
    )
    assert capture.photo is not None
    _write_points(folder / "points.ply", capture.points, capture.colours, ["units: mm"], capture.normals)
    write_images(folder, [capture.photo], "photo.png")
    write_camera(folder / "photo_camera.json", capture.camera)
    return capture.page


def _write_points(
    path: Path, points: Floats, colours: Pixels, comments: list[str], normals: Floats | None = None
) -> None:
    import numpy as np

    from planish.io.files import write_bytes
    from planish.io.ply_write import ply_parts
    from planish.io.polygons import Polygons

    columns: dict[str, NDArray] = {} if normals is None else {f"n{axis}": normals[:, k] for k, axis in enumerate("xyz")}
    columns |= {name: colours[:, k] for k, name in enumerate(("red", "green", "blue"))}
    no_faces = Polygons(np.zeros(0, np.int32), np.zeros(0, np.int32))
    write_bytes(path, ply_parts(points, no_faces, point_columns=columns, comments=comments))
