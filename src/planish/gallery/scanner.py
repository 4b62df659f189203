"""A virtual range scanner: a mesh of what a pinhole sees of a bent sheet, its photo, and the truth of every point."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from planish.dpi import px_to_mm
from planish.errors import UsageError
from planish.gallery.light import Light
from planish.gallery.noise import Noise, NoiseSpec, noise_at, noise_spec, rounded, thinned
from planish.gallery.photograph import photograph
from planish.gallery.pixel_to_page import (
    FineMesh,
    fine_mesh,
    interpolate_to_pixels,
    project,
    rasterize_front,
    refine_page_xy,
)
from planish.gallery.sheets import Sheet
from planish.gallery.typeset import typeset_sheet
from planish.mesh import grid_faces, without_small_components
from planish.types import Camera, Floats, Ints, Mesh, Page, Scan

DISTANCE_MM = 650.0
"""Of the camera from the sheet."""

ASIDE_MM = np.array([3.0, -2.0, 0.0])
"""The camera does not stand exactly over the middle of the sheet."""

LAMP = Light()

MARGIN = 0.04
"""Of the photo's width and height, left free around the sheet."""

STEEPEST = 8.0
"""Neighbouring pixels whose depths differ by more than so many pixel widths (83 degrees) are not joined."""


@dataclass(frozen=True, eq=False)
class VirtualScan:
    """A scan and the truth about it.

    Attributes
    ----------
    scan : Scan
    truth_xy : (n, 2) float64 [mm]
        Where every point of the scan lies on the flat page; x right, y down, origin top left.
    page : Page
        What is printed on the sheet.
    text : str
        What can be read there.
    sheet : Sheet
    """

    scan: Scan
    truth_xy: Floats
    page: Page
    text: str
    sheet: Sheet


def virtual_scan(
    sheet: Sheet,
    *,
    points: int = 300_000,
    photo_px: tuple[int, int] | None = (4000, 3000),
    noise_mm: Noise = 0.0,
    noise_correlation_px: float = 0.0,
    noise: NoiseSpec | None = None,
    turn_deg: float = 5.0,
    tilt_deg: float = 0.0,
    frame: Literal["table", "camera"] = "table",
    reverse_faces: bool = False,
    printed: tuple[Page, str] | None = None,
    light: Light = LAMP,
    grain: float = 1.0,
    rng: np.random.Generator | int = 0,
) -> VirtualScan:
    """Scan a sheet from above and take its photo through the same pinhole.

    Hidden parts have no points, and neither has the back of the sheet; neighbouring pixels of the range image are
    joined unless their depths jump.

    Parameters
    ----------
    sheet : Sheet
    points : int
        About how many the range image shall have on the sheet.
    photo_px : (int, int) or None
        Long and short side of the photo; the long one lies along the sheet's. None for no photo.
    noise_mm : float or (float, float)
        Standard deviation of the range errors, along the ray; two numbers: from the top left to the bottom right
        corner of the sheet.
    noise_correlation_px : float
        Over how many pixels of the range image they are alike; see `NoiseSpec`.
    noise : NoiseSpec, optional
        Instead of these two: errors of every kind. Steps are those of the depth before the camera.
    turn_deg : float
        Of the page in the photo, clockwise.
    tilt_deg : float
        Of the camera from the vertical, towards the foot of the page.
    frame : {"table", "camera"}
        Coordinates of the scan: z up from the table, or the camera's, x right, y down, z away.
    reverse_faces : bool
        Deliver the faces clockwise, as some scanners do.
    printed : (Page, str), optional
        The print and its text, as `typeset_page` gives them; of the sheet's size. By default `typeset_sheet(sheet)`.
    light : Light
    grain : float
        Standard deviation of the photo's noise, in levels of 255.
    rng : numpy.random.Generator or int
        Source of all that is random here, or its seed.

    Examples
    --------
    >>> from planish.gallery import sheet
    >>> virtual = virtual_scan(sheet("letter"), points=2000, photo_px=(500, 400))
    >>> virtual.scan.photo.shape
    (500, 400, 3)
    >>> error = virtual.sheet.bend(virtual.truth_xy) - virtual.scan.mesh.points
    >>> float(abs(error).max()) < 1e-9
    True
    """
    rng = np.random.default_rng(rng)
    page, text = typeset_sheet(sheet) if printed is None else printed
    _check_size(page, sheet)
    camera = overhead_camera(sheet, photo_px or (1000, 750), turn_deg, tilt_deg)
    fine = fine_mesh(sheet, _cell_mm(sheet, points, photo_px))
    spec = noise_spec(noise, noise_mm, noise_correlation_px)
    cloud, faces, truth_xy = _range_image(sheet, fine, camera, points, spec, rng)
    photo_xy, _ = project(camera, cloud)
    photo = photograph(sheet, fine, page, camera, light, grain, rng) if photo_px else None
    if frame == "camera":
        cloud = cloud @ camera.rotation.T + camera.translation
        camera = replace(camera, rotation=np.eye(3), translation=np.zeros(3))
    mesh = Mesh.owned(cloud, faces[:, ::-1] if reverse_faces else faces)
    scan = Scan.owned(mesh, photo, photo_xy, camera) if photo_px else Scan(mesh, camera=camera)
    return VirtualScan(scan, truth_xy, page, text, sheet)


def overhead_camera(sheet: Sheet, photo_px: tuple[int, int], turn_deg: float = 0.0, tilt_deg: float = 0.0) -> Camera:
    """Place a camera over a sheet so that all of it is in the photo.

    Returns
    -------
    Camera
        In the frame of the table.
    """
    short, long = sorted(photo_px)
    rows, cols = (long, short) if sheet.height_mm >= sheet.width_mm else (short, long)
    rotation = Rotation.from_euler("ZX", [turn_deg, tilt_deg], degrees=True).as_matrix() @ np.diag([1.0, -1.0, -1.0])
    spots = fine_mesh(sheet, cell_mm=5.0).points
    middle = np.array([0, 0, spots[:, 2].mean()])
    eye = middle + ASIDE_MM - DISTANCE_MM * rotation[2]
    seen = (spots - eye) @ rotation.T
    flat = seen[:, :2] / seen[:, 2:]
    low, span = flat.min(axis=0), np.ptp(flat, axis=0)
    focal = (1 - 2 * MARGIN) * min(cols / span[0], rows / span[1])
    centre = np.array([cols, rows]) / 2 - 0.5 - focal * (low + span / 2)
    matrix = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]])
    return Camera(matrix, rotation, -rotation @ eye, (rows, cols))


def _range_image(
    sheet: Sheet,
    fine: FineMesh,
    camera: Camera,
    points: int,
    noise: NoiseSpec,
    rng: np.random.Generator,
) -> tuple[Floats, Ints, Floats]:
    """Measure the sheet through the camera: points, faces, and the points' true places on the page."""
    coarse = 400 / max(camera.shape_rc)
    share = (rasterize_front(fine, camera, _zoomed(camera, coarse), coarse)[0] >= 0).sum() / coarse**2
    if share == 0:
        raise UsageError(f"the camera sees nothing of the printed side of the sheet {sheet.name!r}; tilt it less")
    zoom = float(np.sqrt(points / share))
    face, weights = rasterize_front(fine, camera, _zoomed(camera, zoom), zoom)
    seen = np.nonzero(face >= 0)
    page_xy = interpolate_to_pixels(face, weights, fine.faces, fine.page_xy)[seen]
    page_xy = refine_page_xy(sheet, fine, camera, face[seen], page_xy, np.stack(seen[::-1], axis=1), zoom)
    index = np.full(face.shape, -1, np.int32)
    index[seen] = np.arange(len(page_xy))

    cloud = sheet.bend(page_xy)
    place = page_xy / [sheet.width_mm, sheet.height_mm]
    error = noise_at(np.stack(seen, axis=1), place, noise, rng)
    ray = cloud + camera.rotation.T @ camera.translation
    cloud = cloud + error * ray / np.linalg.norm(ray, axis=1, keepdims=True)
    if noise.step_mm:
        depth = cloud @ camera.rotation[2] + camera.translation[2]
        cloud = cloud + (rounded(depth, noise.step_mm) / depth - 1)[:, None] * (
            cloud + camera.rotation.T @ camera.translation
        )

    in_camera = cloud @ camera.rotation.T + camera.translation
    pixel_mm = in_camera[:, 2].mean() / (camera.matrix[0, 0] * zoom)
    used, faces = without_small_components(grid_faces(index, in_camera, STEEPEST * pixel_mm), len(cloud))
    cloud, page_xy = cloud[used], page_xy[used]
    if noise.keep < 1:
        used, faces = thinned(page_xy, noise.keep, rng)
        cloud, page_xy = cloud[used], page_xy[used]
    return cloud, faces, page_xy


def _cell_mm(sheet: Sheet, points: int, photo_px: tuple[int, int] | None) -> float:
    """Size of the drawn mesh's cells: 1.5 pixels of the range image or 10 of the photo, within reason."""
    area = sheet.width_mm * sheet.height_mm
    photo_pixel = np.sqrt(area / np.prod(photo_px)) if photo_px else np.inf
    return float(np.clip(min(1.5 * np.sqrt(area / points), 10 * photo_pixel), 0.75, 2.0))


def _zoomed(camera: Camera, zoom: float) -> tuple[int, int]:
    rows, cols = camera.shape_rc
    return int(np.ceil(rows * zoom)), int(np.ceil(cols * zoom))


def _check_size(page: Page, sheet: Sheet) -> None:
    rows, cols = page.pixels.shape[:2]
    width, height = px_to_mm(cols, page.dpi), px_to_mm(rows, page.dpi)
    if max(abs(width - sheet.width_mm), abs(height - sheet.height_mm)) > px_to_mm(1, page.dpi):
        raise UsageError(
            f"the print is {width:.1f} x {height:.1f} mm, the sheet {sheet.width_mm:.1f} x {sheet.height_mm:.1f} mm; "
            "typeset a page of the sheet's size"
        )
