"""Synthetic point clouds of known sheets: range images and photogrammetry clouds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from planish.gallery.light import Light, irradiance
from planish.gallery.photograph import photograph
from planish.gallery.pixel_to_page import fine_mesh
from planish.gallery.scanner import overhead_camera
from planish.gallery.scene_view import TABLE_DEPTH_MM, SceneView, aim_camera, reflectance, render_view
from planish.gallery.sheets import Sheet, normals
from planish.gallery.typeset import typeset_sheet
from planish.types import Bools, Camera, Floats, Page, Pixels

SCANNER_MM = (3.0, -2.0, 650.0)
"""Position of the virtual range scanner above the table's origin."""

STEEPEST_DEG = 80.0
"""Largest angle of incidence at which the scanner measures."""

MISSING_SHARE = 0.003
"""Share of missing pixels."""

TABLE_MARGIN_MM = 15.0
"""Margin of the table around the sheet in a photogrammetry cloud."""

OUTLIER_SHARE = 0.002
"""Part of its points that are matches gone wrong, up to `OUTLIER_MM` off the surface."""
OUTLIER_MM = 15.0


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Output of a range scanner.

    Attributes
    ----------
    points : (rows, cols, 3) float64 [mm]
        In the scanner's frame: x right, y down, z away; NaN where missing.
    colours : (rows, cols, 3) uint8
        Photo through the same lens.
    camera : Camera
        Scanner pose in the table's frame.
    page : Page
        The print on the sheet.
    """

    points: Floats
    colours: Pixels
    camera: Camera
    page: Page


def range_image(
    sheet: Sheet,
    *,
    shape_rc: tuple[int, int] | None = None,
    noise_mm: float = 0.05,
    printed: Page | None = None,
    rng: np.random.Generator | int = 0,
) -> RangeImage:
    """Scan a sheet like the scanner of the ICDAR 2005 paper: 640 x 480 points, each with a colour.

    Errors are along the rays; points at angles of incidence above 80 degrees and 0.3 % of the pixels are missing.

    Parameters
    ----------
    sheet : Sheet
    shape_rc : (int, int), optional
        Rows and columns; by default 640 along the longer side of the sheet and 480 along the other.
    noise_mm : float
        Standard deviation of the errors.
    printed : Page, optional
        By default `typeset_sheet(sheet)`.
    rng : numpy.random.Generator or int

    Examples
    --------
    >>> from planish.gallery import sheet
    >>> made = range_image(sheet("book"), shape_rc=(64, 48))
    >>> made.points.shape, bool(np.nanmin(made.points[..., 2]) > 550)
    ((64, 48, 3), True)
    """
    rng = np.random.default_rng(rng)
    page = printed or typeset_sheet(sheet)[0]
    if shape_rc is None:
        shape_rc = (640, 480) if sheet.height_mm >= sheet.width_mm else (480, 640)
    width_mm = max(sheet.width_mm, sheet.height_mm * shape_rc[1] / shape_rc[0])
    camera = aim_camera(SCANNER_MM, (SCANNER_MM[0], SCANNER_MM[1], 10.0), 1.06 * width_mm, shape_rc)
    seen = render_view(sheet, camera)
    points = seen.points @ camera.rotation.T + camera.translation
    distance = np.linalg.norm(points, axis=2, keepdims=True)
    towards = -(seen.normals @ camera.rotation.T * points).sum(axis=2) / distance[..., 0]
    points = points * (1 + noise_mm * rng.standard_normal(distance.shape) / distance)
    points[(towards < np.cos(np.radians(STEEPEST_DEG))) | (rng.random(shape_rc) < MISSING_SHARE)] = np.nan
    colours = photograph(sheet, fine_mesh(sheet, 1.0), page, camera, Light(), 1.0, rng)
    return RangeImage(points, colours, camera, page)


@dataclass(frozen=True, eq=False)
class PhotogrammetryCloud:
    """Output of a photogrammetry program.

    Attributes
    ----------
    points : (n, 3) float64 [mm]
        In the table's frame, z up; unorganised.
    colours : (n, 3) uint8
    normals : (n, 3) float64
        Outward, noisy.
    photo : (h, w, 3) uint8, or None
    camera : Camera
        Camera of the photo, in the frame of the points.
    page : Page
        The print on the sheet.
    """

    points: Floats
    colours: Pixels
    normals: Floats
    photo: Pixels | None
    camera: Camera
    page: Page


def photogrammetry_cloud(
    sheet: Sheet,
    *,
    points: int = 300_000,
    noise_mm: float = 0.1,
    photo_px: tuple[int, int] | None = (4000, 3000),
    printed: Page | None = None,
    rng: np.random.Generator | int = 0,
) -> PhotogrammetryCloud:
    """Sample coloured points on a sheet and the table around it, like a photogrammetry cloud.

    Errors are isotropic; one point in 500 is an outlier up to 15 mm off the surface.

    Parameters
    ----------
    sheet : Sheet
    points : int
        On the sheet; points on the table are added at the same density.
    noise_mm : float
        Standard deviation of the errors in each direction.
    photo_px : (int, int) or None
        Long and short side of a photo from above; None for no photo.
    printed : Page, optional
        By default `typeset_sheet(sheet)`.
    rng : numpy.random.Generator or int

    Examples
    --------
    >>> from planish.gallery import sheet
    >>> made = photogrammetry_cloud(sheet("letter"), points=2000, photo_px=None)
    >>> made.points.shape == made.normals.shape == made.colours.shape, len(made.points) > 2000
    (True, True)
    """
    rng = np.random.default_rng(rng)
    page = printed or typeset_sheet(sheet)[0]
    page_xy = rng.uniform(0, [sheet.width_mm, sheet.height_mm], (points, 2))
    position, upward = sheet.bend(page_xy), normals(sheet, page_xy)
    table = _table_around(position, points / (sheet.width_mm * sheet.height_mm), rng)
    at = np.concatenate([page_xy, np.full((len(table), 2), np.nan)])
    position = np.concatenate([position, table])
    upward = np.concatenate([upward, np.tile([0.0, 0.0, 1.0], (len(table), 1))])
    colours = _seen_colours(position, upward, at, page)

    error = noise_mm * rng.standard_normal(position.shape)
    outlier = rng.random(len(position)) < OUTLIER_SHARE
    error[outlier] += upward[outlier] * rng.uniform(-OUTLIER_MM, OUTLIER_MM, (int(outlier.sum()), 1))
    noisy_normals = upward + 0.1 * rng.standard_normal(upward.shape)
    noisy_normals /= np.linalg.norm(noisy_normals, axis=1, keepdims=True)
    camera = overhead_camera(sheet, photo_px or (1000, 750), turn_deg=5.0)
    photo = photograph(sheet, fine_mesh(sheet, 1.0), page, camera, Light(), 1.0, rng) if photo_px else None
    order = rng.permutation(len(position))
    return PhotogrammetryCloud((position + error)[order], colours[order], noisy_normals[order], photo, camera, page)


def _table_around(position: Floats, density: float, rng: np.random.Generator) -> Floats:
    """Random points of the table around the sheet, not under it."""
    low, high = position[:, :2].min(axis=0) - TABLE_MARGIN_MM, position[:, :2].max(axis=0) + TABLE_MARGIN_MM
    candidates = rng.uniform(low, high, (int(density * np.prod(high - low)), 2))
    apart = cKDTree(position[:, :2]).query(candidates)[0] > 2 / np.sqrt(density)
    uncovered: Bools = np.asarray(apart)
    return np.column_stack([candidates[uncovered], np.full(int(uncovered.sum()), -TABLE_DEPTH_MM)])


def _seen_colours(position: Floats, upward: Floats, page_xy: Floats, page: Page) -> Pixels:
    """Colours of points as in a photo; `page_xy` is NaN on the table."""
    light = Light()
    sent = reflectance(SceneView(position[None], upward[None], page_xy[None]), page, light.gamma)[0]
    bright = irradiance(light, position, upward, np.ones(len(position)))
    linear = sent * (bright * light.exposure / bright.max())[:, None]
    return np.clip(np.rint(255 * np.clip(linear, 0, 1) ** (1 / light.gamma)), 0, 255).astype(np.uint8)
