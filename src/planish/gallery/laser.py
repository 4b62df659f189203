"""Virtual laser scanner: a line swept over a curved sheet, photo by photo, with print, noise and speckle.

The sheet lies on black cloth that reflects no laser light. Photos are sRGB. Each pixel is the mean of 2 x 2 samples,
so ink edges within a pixel affect the line as in a real camera.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.color import code_values
from planish.dpi import MM_PER_INCH
from planish.gallery.light import Light, irradiance, visibility
from planish.gallery.photograph import photograph
from planish.gallery.pixel_to_page import (
    FineMesh,
    fine_mesh,
    interpolate_to_pixels,
    pixels_showing,
    rasterize_front,
    refine_page_xy,
)
from planish.gallery.scanner import overhead_camera
from planish.gallery.sheets import Sheet, normals
from planish.gallery.typeset import typeset_sheet
from planish.parallel import thread_pool
from planish.types import Camera, Floats, Page

MIRROR_MM = (-380.0, 0.0, 420.0)
"""Position of the laser source: 40 degrees to the left of the camera."""

ROOM = Light(exposure=0.35, shadows=False)
"""Ambient light, dim enough to leave range for the laser."""

LASER_COLOUR = np.array([0.05, 1.0, 0.08])
"""Camera response to a green laser: red, green, blue."""

SUPERSAMPLING = 2
"""Samples per pixel in each direction."""

CELL_MM = 1.0
FLAT_MM = 0.002
"""Faces with less sagitta are rendered as flat: 1/50 of the accuracy tested."""


@dataclass(frozen=True, eq=False)
class VirtualSweep:
    """Photos of a sheet under a laser line, with the ground truth.

    Attributes
    ----------
    photo : (rows, cols, 3) uint8
        With the laser off.
    planes : (frames, lines, 4) float64
        a x + b y + c z + d = 0 [mm], (a, b, c) of length 1.
    frame : callable
        Index of the frame -> photo (rows, cols, 3) uint8 with the laser on.
    camera : Camera
    sheet : Sheet
    page : Page
    text : str
        Printed text.
    """

    photo: NDArray[np.uint8]
    planes: Floats
    frame: Callable[[int], NDArray[np.uint8]]
    camera: Camera
    sheet: Sheet
    page: Page
    text: str


@dataclass(frozen=True, eq=False)
class _Scene:
    """Samples of the scene, 2 x 2 per pixel: points, ambient light, and ratio of laser to ambient light."""

    points: NDArray[np.float32]
    room: NDArray[np.float32]
    laser_ratio: NDArray[np.float32]


def virtual_sweep(
    sheet: Sheet,
    *,
    frames: int = 200,
    photo_px: tuple[int, int] = (2000, 1500),
    line_mm: float = 0.35,
    strength: float = 1.0,
    speckle: float = 0.1,
    grain: float = 1.0,
    printed: tuple[Page, str] | None = None,
    camera: Camera | None = None,
    rng: np.random.Generator | int = 0,
) -> VirtualSweep:
    """Sweep a laser line over a sheet from left to right by a rotating mirror.

    Parameters
    ----------
    sheet : Sheet
    frames : int
    photo_px : (int, int)
        Long and short side.
    line_mm : float
        Standard deviation of the line's Gaussian profile.
    strength : float
        Linear value of the line on white paper facing the laser; above about 0.7 it saturates.
    speckle : float
        Contrast of laser speckle at each sample.
    grain : float
        Standard deviation of sensor noise, in levels of 255.
    printed : (Page, str), optional
        The print and its text. By default `typeset_sheet(sheet)`.
    camera : Camera, optional
        By default above the sheet.
    rng : numpy.random.Generator or int

    Examples
    --------
    >>> from planish.gallery import sheet
    >>> sweep = virtual_sweep(sheet("book"), frames=3, photo_px=(200, 160))
    >>> sweep.planes.shape, sweep.frame(1).shape
    ((3, 1, 4), (200, 160, 3))
    """
    x = np.linspace(-0.5, 0.5, frames) * (sheet.width_mm + 4)
    planes = np.stack([plane_through(MIRROR_MM, (place, 0.0, 0.0)) for place in x])[:, None]
    optics = (line_mm, strength, speckle, grain)
    return _capture(sheet, planes, (MIRROR_MM,), photo_px, optics, printed, camera, rng)


def virtual_lines(
    sheet: Sheet,
    *,
    photo_px: tuple[int, int] = (2000, 1500),
    line_mm: float = 0.5,
    strength: float = 1.0,
    speckle: float = 0.1,
    grain: float = 1.0,
    printed: tuple[Page, str] | None = None,
    camera: Camera | None = None,
    rng: np.random.Generator | int = 0,
) -> VirtualSweep:
    """Project two fixed laser lines across a book, like a simple book scanner: one frame with both.

    The lasers are above the head and below the foot of the page; their lines diverge as the paper rises. Parameters
    as for `virtual_sweep`.

    Examples
    --------
    >>> from planish.gallery import sheet
    >>> virtual_lines(sheet("spread"), photo_px=(160, 200)).planes.shape
    (1, 2, 4)
    """
    sources = (0.0, 330.0, 500.0), (0.0, -330.0, 500.0)
    feet = (0.0, 0.18 * sheet.height_mm, 0.0), (0.0, -0.18 * sheet.height_mm, 0.0)
    pairs = zip(sources, feet, strict=True)
    planes = np.stack([plane_through(source, foot, (1.0, 0, 0)) for source, foot in pairs])[None]
    optics = (line_mm, strength, speckle, grain)
    return _capture(sheet, planes, sources, photo_px, optics, printed, camera, rng)


def laser_on_sheet(
    sheet: Sheet,
    planes: Floats,
    *,
    printed: tuple[Page, str],
    camera: Camera,
    line_mm: float = 0.35,
    rng: np.random.Generator | int = 0,
) -> VirtualSweep:
    """Project the laser line of `virtual_sweep` onto a sheet, in given planes (frames, 1, 4)."""
    return _capture(sheet, planes, (MIRROR_MM,), camera.shape_rc, (line_mm, 1.0, 0.1, 1.0), printed, camera, rng)


def mirror_angle_deg(planes: Floats) -> Floats:
    """Rotation angles (n,) [degrees] of planes (n, 4) of `virtual_sweep`, from the plane through x = 0."""
    first = plane_through(MIRROR_MM, (0.0, 0.0, 0.0))[:3]
    return np.asarray(np.degrees(np.arctan2(np.cross(first, planes[:, :3])[:, 1], planes[:, :3] @ first)))


def squared_paper(sheet: Sheet, square_mm: float = 8.0) -> tuple[Page, str]:
    """Squared paper of a sheet's size, lines half a millimetre wide, for use as `printed`."""
    dots = 6  # per millimetre
    row, col = np.mgrid[: round(sheet.height_mm * dots), : round(sheet.width_mm * dots)]
    line = np.minimum(row % (square_mm * dots), col % (square_mm * dots)) < dots / 2
    return Page(np.where(line, 60, 255).astype(np.uint8), np.ones(row.shape, bool), MM_PER_INCH * dots), ""


def plane_through(source: Sequence[float], foot: Sequence[float], along: Sequence[float] = (0.0, 1.0, 0.0)) -> Floats:
    """Plane (4,) through a laser source, a point of its line, and the line's direction there."""
    normal = np.cross(np.subtract(foot, source), along)
    normal = normal / np.linalg.norm(normal)
    return np.array([*normal, -normal @ np.asarray(source)])


def _capture(
    sheet: Sheet,
    planes: Floats,
    sources: Sequence[Sequence[float]],
    photo_px: tuple[int, int],
    optics: tuple[float, float, float, float],
    printed: tuple[Page, str] | None,
    camera: Camera | None,
    rng: np.random.Generator | int,
) -> VirtualSweep:
    """Render the laser-off photo, and return a function for the others; noise per photo is reproducible."""
    page, text = typeset_sheet(sheet) if printed is None else printed
    camera = overhead_camera(sheet, photo_px) if camera is None else camera
    scene = _scene(sheet, page, camera, sources)
    line_mm, strength, speckle, grain = optics
    seeds = np.random.SeedSequence(int(np.random.default_rng(rng).integers(2**32))).spawn(len(planes) + 1)

    def take(seed: np.random.SeedSequence, lit: Floats) -> NDArray[np.uint8]:
        noise = np.random.default_rng(seed)
        light = np.empty((*camera.shape_rc, 3), np.float32)
        pattern = 1 + speckle * noise.standard_normal((64, 64), np.float32)
        colour = (strength * LASER_COLOUR).astype(np.float32)
        arguments = scene.points, scene.room, scene.laser_ratio, lit, 1 / (2 * line_mm**2), colour, pattern
        with thread_pool() as parallel_for:
            parallel_for(_expose, len(light), *arguments, int(noise.integers(2**30)), light, block=64)
        code = code_values(np.dtype(np.uint16))[(np.clip(light, 0, 1) * 65535 + 0.5).astype(np.uint16)]
        levels = code / np.float32(257) + np.float32(grain) * noise.standard_normal(light.shape, np.float32)
        return np.clip(np.rint(levels), 0, 255).astype(np.uint8)

    photo = take(seeds[-1], np.zeros((0, 4)))
    return VirtualSweep(photo, planes, lambda k: take(seeds[k], planes[k]), camera, sheet, page, text)


def _scene(sheet: Sheet, page: Page, camera: Camera, sources: Sequence[Sequence[float]]) -> _Scene:
    """Sample the sheet at 2 x 2 positions per pixel."""
    lens = camera.matrix.copy()
    lens[:2] *= SUPERSAMPLING
    lens[:2, 2] += (SUPERSAMPLING - 1) / 2
    fine_camera = replace(
        camera, matrix=lens, shape_rc=(SUPERSAMPLING * camera.shape_rc[0], SUPERSAMPLING * camera.shape_rc[1])
    )
    mesh = fine_mesh(sheet, CELL_MM)
    room = photograph(sheet, mesh, page, fine_camera, ROOM, 0.0, np.random.default_rng(0))
    room_light = ((np.arange(256) / 255) ** ROOM.gamma).astype(np.float32)[room]
    face, weights = rasterize_front(mesh, fine_camera, fine_camera.shape_rc, 1.0)
    page_positions = interpolate_to_pixels(face, weights, mesh.faces, mesh.page_xy)
    curved = pixels_showing(face, mesh.sagitta_mm > FLAT_MM)
    page_positions[curved] = refine_page_xy(
        sheet, mesh, fine_camera, face[curved], page_positions[curved], np.stack(curved[::-1], axis=1)
    )
    seen = np.nonzero(face >= 0)
    points = np.full((*face.shape, 3), np.nan, np.float32)
    points[seen] = sheet.bend(page_positions[seen])
    upward = normals(sheet, mesh.page_xy)
    lamps = np.stack([_laser_irradiance(mesh, upward, source) for source in sources], axis=1)
    laser_light = interpolate_to_pixels(face, weights, mesh.faces, lamps)
    above = irradiance(ROOM, mesh.points, upward, np.ones(len(upward)))
    ambient_light = interpolate_to_pixels(face, weights, mesh.faces, (above * ROOM.exposure / above.max())[:, None])
    laser_ratio = np.nan_to_num(laser_light / ambient_light).astype(np.float32)  # relative to ambient light
    return _Scene(points, room_light, laser_ratio)


def _laser_irradiance(mesh: FineMesh, upward: Floats, source: Sequence[float]) -> Floats:
    """Cosine of the laser's incidence at each point, 0 in shadow."""
    lamp = Light(position_mm=(source[0], source[1], source[2]))
    way = np.asarray(source) - mesh.points
    cosine = np.einsum("ij,ij->i", upward, way) / np.linalg.norm(way, axis=1)
    return np.asarray(np.clip(cosine, 0, None) * visibility(lamp, mesh.points, upward, mesh.faces))


@njit(cache=True, nogil=True)
def _expose(first, last, points, room, laser_ratio, planes, sharpness, colour, pattern, seed, light):  # type: ignore[no-untyped-def]
    """Mean light over the samples of each pixel: ambient (1 + laser exp(-distance^2 / 2 sd^2) speckle)."""
    for i in range(first, last):
        for j in range(light.shape[1]):
            for c in range(3):
                light[i, j, c] = 0.0
            for r in range(SUPERSAMPLING * i, SUPERSAMPLING * i + SUPERSAMPLING):
                for q in range(SUPERSAMPLING * j, SUPERSAMPLING * j + SUPERSAMPLING):
                    laser = 0.0
                    for k in range(len(planes)):
                        n = planes[k]
                        p = points[r, q]
                        distance = n[0] * p[0] + n[1] * p[1] + n[2] * p[2] + n[3]
                        if distance * distance * sharpness < 16.0:
                            shape = np.exp(-distance * distance * sharpness)
                            laser += (
                                shape
                                * laser_ratio[r, q, k]
                                * pattern[(r * 7 + seed) % 64, (q * 5 + r // 9 + seed) % 64]
                            )
                    for c in range(3):
                        light[i, j, c] += room[r, q, c] * (1.0 + colour[c] * max(laser, 0.0))
            for c in range(3):
                light[i, j, c] /= SUPERSAMPLING * SUPERSAMPLING


def ground_truth(sweep: VirtualSweep, photo_xy: Floats) -> tuple[Floats, Floats]:
    """Ground truth at photo positions.

    Parameters
    ----------
    sweep : VirtualSweep
    photo_xy : (n, 2) float64 [photo px]

    Returns
    -------
    page_xy : (n, 2) float64 [mm]
        Position on the flat page; NaN outside of the sheet.
    points : (n, 3) float64 [mm]
    """
    mesh = fine_mesh(sweep.sheet, CELL_MM)
    face, weights = rasterize_front(mesh, sweep.camera, sweep.camera.shape_rc, 1.0)
    col, row = np.clip(np.rint(photo_xy), 0, np.array(face.shape)[::-1] - 1).astype(int).T
    page_xy = interpolate_to_pixels(face, weights, mesh.faces, mesh.page_xy)[row, col]
    seen = face[row, col] >= 0
    behind = face[row, col][seen]
    page_xy[seen] = refine_page_xy(sweep.sheet, mesh, sweep.camera, behind, page_xy[seen], photo_xy[seen])
    points = np.full((len(page_xy), 3), np.nan)
    points[seen] = sweep.sheet.bend(page_xy[seen])
    return page_xy, points
