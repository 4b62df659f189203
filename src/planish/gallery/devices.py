"""Virtual devices: a depth camera, and a camera with a projector, capturing a sheet of the gallery."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial.transform import Rotation

from planish.dpi import MM_PER_INCH
from planish.gallery.light import Light
from planish.gallery.photograph import photograph
from planish.gallery.pixel_to_page import fine_mesh
from planish.gallery.scene_view import (
    SceneView,
    aim_camera,
    bin_pixels,
    lit_mask,
    reflectance,
    render_view,
    supersampled_camera,
)
from planish.gallery.sheets import Sheet
from planish.gallery.typeset import typeset_sheet
from planish.geometry import depths, project
from planish.parallel import thread_pool
from planish.types import Camera, Floats, Page, Pixels

LENS = (-0.12, 0.10, 0.0006, -0.0004)
"""Distortion of the virtual cameras: a few pixels of barrel distortion in the corners."""

PROJECTOR_LENS = (-0.05, 0.02, 0.0, 0.001)

SUPERSAMPLING = 2
"""Samples per pixel in each direction."""

BLUR_PX = 0.5
"""Standard deviation of the lens blur."""

SMALL_RIG = (512, 640), (400, 640)
"""Rows and columns of a camera and a projector with half the resolution."""

AMBIENT = 0.06
"""Ambient light relative to the projector's white."""


@dataclass(frozen=True, eq=False)
class DepthCapture:
    """Output of a depth camera, with the ground truth.

    Attributes
    ----------
    frames : list of (rows, cols) float64 [mm]
        Depth along the optical axis in whole millimetres; 0 where missing.
    camera, photo_camera : Camera
    photo : (h, w, 3) uint8
    page : Page
        The print on the sheet.
    """

    frames: list[Floats]
    camera: Camera
    photo: Pixels
    photo_camera: Camera
    page: Page


def depth_capture(
    sheet: Sheet,
    *,
    frames: int = 30,
    noise_mm: float = 1.0,
    shape_rc: tuple[int, int] = (480, 640),
    photo_px: tuple[int, int] = (2000, 1500),
    printed: Page | None = None,
    rng: np.random.Generator | int = 0,
) -> DepthCapture:
    """Capture a sheet with a depth camera, and a photo with a colour camera 25 mm beside it.

    The noise is Gaussian, proportional to the square of the depth (`noise_mm` holds at the table), and independent
    between frames; depths are rounded to whole millimetres. Pixels at edges average near and far (flying pixels);
    0.5 % of the pixels are missing.

    Parameters
    ----------
    sheet : Sheet
    frames : int
    noise_mm : float
    shape_rc : (int, int)
        Rows and columns of the depth maps.
    photo_px : (int, int)
        Long and short side of the photo.
    printed : Page, optional
        By default `typeset_sheet(sheet)`.
    rng : numpy.random.Generator or int

    Examples
    --------
    >>> from planish.gallery import sheet
    >>> made = depth_capture(sheet("book"), frames=2, shape_rc=(60, 80), photo_px=(200, 150))
    >>> len(made.frames), made.frames[0].shape, made.photo.shape
    (2, (60, 80), (200, 150, 3))
    """
    rng = np.random.default_rng(rng)
    page = printed or typeset_sheet(sheet)[0]
    camera = aim_camera((0, 0, 520), (0, 0, 10), 1.15 * _width_to_see(sheet, shape_rc), shape_rc)
    long, short = max(photo_px), min(photo_px)
    upright = sheet.height_mm >= sheet.width_mm
    photo_rc = (long, short) if upright else (short, long)
    photo_camera = aim_camera((25, 0, 520), (0, 0, 10), 1.12 * _width_to_see(sheet, photo_rc), photo_rc, LENS)
    fine = bin_pixels(_depth_at(render_view(sheet, supersampled_camera(camera, SUPERSAMPLING)), camera), SUPERSAMPLING)
    photo = photograph(sheet, fine_mesh(sheet, 1.0), page, photo_camera, Light(), 1.0, rng)
    return DepthCapture(list(_with_noise(fine, frames, noise_mm, rng)), camera, photo, photo_camera, page)


def _with_noise(depth: Floats, frames: int, noise_mm: float, rng: np.random.Generator) -> Iterator[Floats]:
    typical = np.nanmedian(depth)
    for _ in range(frames):
        frame = np.rint(depth + noise_mm * (depth / typical) ** 2 * rng.standard_normal(depth.shape))
        frame[~np.isfinite(frame) | (rng.random(depth.shape) < 0.005)] = 0
        yield frame


def _depth_at(seen: SceneView, camera: Camera) -> Floats:
    return depths(camera, seen.points.reshape(-1, 3)).reshape(seen.points.shape[:2])


def _width_to_see(sheet: Sheet, shape_rc: tuple[int, int]) -> float:
    """Width of a field of view that contains the whole sheet."""
    rows, cols = shape_rc
    return max(sheet.width_mm, sheet.height_mm * cols / rows)


def projector_rig(
    sheet: Sheet, camera_rc: tuple[int, int] = (1024, 1280), projector_rc: tuple[int, int] = (800, 1280)
) -> tuple[Camera, Camera]:
    """Place a camera above a sheet and a projector 220 mm to its left, both with distortion; the table is the world.

    Returns
    -------
    camera, projector : Camera
    """
    camera = aim_camera((10, 0, 620), (0, 0, 10), 1.1 * _width_to_see(sheet, camera_rc), camera_rc, LENS)
    width = 1.25 * _width_to_see(sheet, projector_rc)
    return camera, aim_camera((-210, 15, 590), (0, 0, 10), width, projector_rc, PROJECTOR_LENS)


@dataclass(frozen=True, eq=False)
class PatternCapture:
    """Photos of a sheet under a projector's patterns.

    Attributes
    ----------
    frames : (n, rows, cols) uint8
        Grey, in linear light, like those of a machine vision camera.
    photo : (rows, cols, 3) uint8
        Colour photo under white.
    """

    frames: NDArray[np.uint8]
    photo: NDArray[np.uint8]


def structured_light(
    sheet: Sheet,
    camera: Camera,
    projector: Camera,
    patterns: Iterable[NDArray[np.uint8]],
    page: Page,
    *,
    noise: float = 1.0,
    exposure: float = 0.85,
    rng: np.random.Generator | int = 0,
) -> PatternCapture:
    """Render a photo of a sheet under each projector pattern.

    Parameters
    ----------
    sheet : Sheet
    camera, projector : Camera
    patterns : iterable of (rows, cols) uint8
        Of the projector's resolution.
    page : Page
        The print on the sheet.
    noise : float
        Standard deviation of sensor noise, in levels of 255.
    exposure : float
        Value, 0 to 1, of the brightest paper under white; above 1 the photos are overexposed.
    rng : numpy.random.Generator or int
    """
    rng = np.random.default_rng(rng)
    seen = render_view(sheet, supersampled_camera(camera, SUPERSAMPLING))
    at = project(projector, seen.points.reshape(-1, 3)).astype(np.float32).reshape(*seen.points.shape[:2], 2)
    light = _light_from(projector, sheet, seen, at, exposure)
    colours = reflectance(seen, page).astype(np.float32)
    grey = colours.mean(axis=2)

    def expose(pattern: NDArray[np.uint8], reflected: NDArray[np.float32]) -> NDArray[np.uint8]:
        levels = np.zeros(camera.shape_rc, np.float32)
        with thread_pool() as parallel_for:
            parallel_for(
                _expose, len(levels), pattern, at, light, np.float32(AMBIENT * exposure), reflected, levels, block=64
            )
        levels = 255 * ndimage.gaussian_filter(levels, BLUR_PX)
        levels += np.float32(noise) * rng.standard_normal(levels.shape, np.float32)
        return np.clip(np.rint(levels), 0, 255).astype(np.uint8)

    frames = np.stack([expose(pattern, grey) for pattern in patterns])
    white = np.full(projector.shape_rc, 255, np.uint8)
    photo = np.stack([expose(white, np.ascontiguousarray(colours[..., k])) for k in range(3)], axis=-1)
    return PatternCapture(frames, photo)


def _light_from(
    projector: Camera, sheet: Sheet, seen: SceneView, at: NDArray[np.float32], exposure: float
) -> NDArray[np.float32]:
    """Irradiance of full projector white at each pixel; `exposure` on the brightest paper."""
    to_lamp = -projector.rotation.T @ projector.translation - seen.points
    distance = np.linalg.norm(to_lamp, axis=-1)
    incident = np.clip((to_lamp * seen.normals).sum(axis=-1) / distance, 0, None) / distance**2
    incident *= lit_mask(sheet, projector, seen.points, at)
    brightest = np.nanmax(np.where(np.isfinite(seen.page_xy[..., 0]), incident, np.nan))
    return np.nan_to_num(incident * exposure / ((1 + AMBIENT) * brightest)).astype(np.float32)


@njit(cache=True, nogil=True)
def _expose(first, last, pattern, at, light, ambient, reflected, levels):  # type: ignore[no-untyped-def]
    """Mean light, 0 to 1, over the samples of each pixel; the pattern is interpolated bilinearly."""
    rows, cols = pattern.shape
    for r in range(first, last):
        for q in range(levels.shape[1]):
            for i in range(SUPERSAMPLING * r, SUPERSAMPLING * r + SUPERSAMPLING):
                for j in range(SUPERSAMPLING * q, SUPERSAMPLING * q + SUPERSAMPLING):
                    x, y = at[i, j, 0], at[i, j, 1]
                    projected = np.float32(0.0)
                    if 0.0 <= x < cols - 1 and 0.0 <= y < rows - 1:
                        c, d = int(x), int(y)
                        fx, fy = x - np.float32(c), y - np.float32(d)
                        above = (1 - fx) * pattern[d, c] + fx * pattern[d, c + 1]
                        below = (1 - fx) * pattern[d + 1, c] + fx * pattern[d + 1, c + 1]
                        projected = ((1 - fy) * above + fy * below) / np.float32(255.0)
                    levels[r, q] += (
                        reflected[i, j] * (light[i, j] * projected + ambient) / (SUPERSAMPLING * SUPERSAMPLING)
                    )


def posed_board(
    pixels: NDArray[np.uint8], square_px: int, square_mm: float, turn: Floats, middle: Floats
) -> tuple[Sheet, Page]:
    """Pose a rigid flat board above the table.

    Parameters
    ----------
    pixels : (rows, cols) uint8
        Print of the board.
    square_px, square_mm : int, float
        Scale: so many pixels are so many millimetres.
    turn : (3,) float64 [rad]
        Rotation vector from the lying board, its top away from the viewer.
    middle : (3,) float64 [mm]
        Position of its centre.
    """
    size = np.array([pixels.shape[1], pixels.shape[0]]) * square_mm / square_px
    rotation = Rotation.from_rotvec(turn).as_matrix()

    def bend(xy: Floats) -> Floats:
        flat_points = np.column_stack([xy[:, 0] - size[0] / 2, size[1] / 2 - xy[:, 1], np.zeros(len(xy))])
        return np.asarray(flat_points @ rotation.T + middle)

    board = Sheet("board", float(size[0]), float(size[1]), bend)
    return board, Page(pixels, np.ones(pixels.shape, bool), MM_PER_INCH * square_px / square_mm)


def board_poses(count: int, rng: np.random.Generator | int = 0) -> Iterator[tuple[Floats, Floats]]:
    """Generate poses of a board of about 175 x 125 mm in front of the virtual rig, tilted to all sides.

    Yields
    ------
    turn : (3,) float64 [rad]
    middle : (3,) float64 [mm]
    """
    rng = np.random.default_rng(rng)
    for k in range(count):
        around = 2 * np.pi * k / count
        tilt = np.radians(rng.uniform(18, 32))
        turn = tilt * np.array([np.cos(around), np.sin(around), 0.0]) + [0, 0, rng.uniform(-0.2, 0.2)]
        yield turn, np.array([rng.uniform(-35, 35), rng.uniform(-30, 30), rng.uniform(60, 110)])
