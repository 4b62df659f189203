"""Exact page position behind each pixel of a camera above a curved sheet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.gallery.sheets import Sheet
from planish.geometry import depths
from planish.geometry import project as at_pixels
from planish.geometry.guards import TINY_AREA_PX
from planish.mesh import rasterize
from planish.parallel import thread_pool
from planish.types import Bools, Camera, Floats, Ints

NEWTON_STEPS = 4
"""Newton iterations; each divides the error by 20 at a radius of 10 mm, creases need more."""

CLOSE_PX = 1e-3
"""Convergence threshold: distance from the pixel centre. Positions are exactly on the sheet in any case."""


@dataclass(frozen=True, eq=False)
class FineMesh:
    """A dense grid mesh of a sheet for rendering.

    Attributes
    ----------
    page_xy : (n, 2) float64 [mm]
    points : (n, 3) float64 [mm]
    faces : (m, 3) int32
        Counter-clockwise seen from the printed side.
    sagitta_mm : (m,) float64
        Largest distance of the sheet from the edge midpoints of each face.
    cell_mm : float
    """

    page_xy: Floats
    points: Floats
    faces: Ints
    sagitta_mm: Floats
    cell_mm: float


def fine_mesh(sheet: Sheet, cell_mm: float) -> FineMesh:
    """Mesh a sheet by a regular grid and measure the sagitta of each face.

    The sheet is evaluated at every half cell; midpoints of edges give the sagitta.
    """
    cols, rows = (1 + int(np.ceil(n / cell_mm)) for n in (sheet.width_mm, sheet.height_mm))
    x, y = np.linspace(0, sheet.width_mm, 2 * cols - 1), np.linspace(0, sheet.height_mm, 2 * rows - 1)
    half_xy = np.stack(np.meshgrid(x, y), axis=-1)
    half = sheet.bend(half_xy.reshape(-1, 2)).reshape(*half_xy.shape[:2], 3)
    corner = half[::2, ::2]
    across = np.linalg.norm(half[::2, 1::2] - (corner[:, :-1] + corner[:, 1:]) / 2, axis=-1)
    down = np.linalg.norm(half[1::2, ::2] - (corner[:-1] + corner[1:]) / 2, axis=-1)
    diagonal = np.linalg.norm(half[1::2, 1::2] - (corner[:-1, 1:] + corner[1:, :-1]) / 2, axis=-1)
    index = np.arange(rows * cols, dtype=np.int32).reshape(rows, cols)
    a, b, c, d = (k.ravel() for k in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    upper = np.maximum(np.maximum(across[:-1], down[:, :-1]), diagonal).ravel()
    lower = np.maximum(np.maximum(across[1:], down[:, 1:]), diagonal).ravel()
    return FineMesh(
        half_xy[::2, ::2].reshape(-1, 2),
        corner.reshape(-1, 3),
        np.concatenate([np.stack([a, c, b], axis=1), np.stack([c, d, b], axis=1)]),
        np.concatenate([upper, lower]),
        cell_mm,
    )


def project(camera: Camera, points: Floats, zoom: float = 1.0) -> tuple[Floats, Floats]:
    """Project points onto the photo, or a scaled image of the same view; also return their depth.

    Parameters
    ----------
    camera : Camera
    points : (n, 3) float64 [mm]
    zoom : float
        Pixels of the image per photo pixel; pixel centres stay at integers.

    Returns
    -------
    pixel_xy : (n, 2) float64 [px]
    depth : (n,) float64 [mm]
    """
    lens = camera.matrix.copy()
    lens[:2] *= zoom
    lens[:2, 2] += (zoom - 1) / 2
    return at_pixels(replace(camera, matrix=lens), points), depths(camera, points)


def rasterize_front(
    mesh: FineMesh, camera: Camera, shape_rc: tuple[int, int], zoom: float
) -> tuple[Ints, NDArray[np.float32]]:
    """Rasterize the printed side: face and weights per pixel as from `rasterize`; -1 also where the back is visible."""
    pixel_xy, depth = project(camera, mesh.points, zoom)
    face, weights = rasterize(pixel_xy, mesh.faces, shape_rc, nearness=1 / depth, perspective=True)
    front = np.append(front_facing(pixel_xy, mesh.faces), False)  # the last entry is for "no face"
    return np.where(front[face], face, np.int32(-1)), weights


def front_facing(pixel_xy: Floats, faces: Ints) -> Bools:
    """Which faces show their printed side to the camera."""
    a, b, c = (pixel_xy[faces[:, k]] for k in range(3))
    u, v = b - a, c - a
    front: Bools = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0  # y is down, so counter-clockwise has area < 0
    return front


def pixels_showing(face: Ints, which: Bools) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of pixels that show one of the faces `which` (m,); later faces are not of the sheet."""
    chosen = np.append(which, False)  # the last entry is for "no face" and for later ones
    rows, cols = np.nonzero(chosen[np.where(face < len(which), face, -1)])
    return rows, cols


def refine_page_xy(
    sheet: Sheet, mesh: FineMesh, camera: Camera, face: Ints, page_xy: Floats, target_xy: Floats, zoom: float = 1.0
) -> Floats:
    """Refine page positions interpolated on flat faces to the exact sheet.

    Newton's method with the derivative of the face: u <- u + (du/dp) (p - project(bend(u))).

    Parameters
    ----------
    sheet, mesh, camera, zoom
        As for `project`.
    face : (k,) int32
        Face behind each pixel.
    page_xy : (k, 2) float64 [mm]
        Initial positions, from the face.
    target_xy : (k, 2) [px]
        Pixel positions.

    Returns
    -------
    (k, 2) float64 [mm]
    """
    which, position = np.unique(face, return_inverse=True)
    slope = page_per_pixel(project(camera, mesh.points, zoom)[0], mesh.page_xy, mesh.faces[which])[position]
    size = np.array([sheet.width_mm, sheet.height_mm])
    u, best, least = page_xy, page_xy.copy(), np.full(len(page_xy), np.inf)
    active = np.arange(len(page_xy))
    for _ in range(NEWTON_STEPS):
        residual = target_xy[active] - project(camera, sheet.bend(u), zoom)[0]
        distance = np.hypot(*residual.T)
        better = distance < least[active]
        best[active[better]], least[active[better]] = u[better], distance[better]
        unconverged = distance > CLOSE_PX
        active = active[unconverged]
        step = np.einsum("kij,kj->ki", slope[active], residual[unconverged])
        u = np.clip(best[active] + np.clip(step, -mesh.cell_mm, mesh.cell_mm), 0, size)
    return best


def page_per_pixel(pixel_xy: Floats, page_xy: Floats, faces: Ints) -> Floats:
    """Jacobian d(page)/d(pixel) of each face, (m, 2, 2) [mm/px]; 0 for faces seen edge-on."""
    a, b, c = faces.T
    pixel = np.stack([pixel_xy[b] - pixel_xy[a], pixel_xy[c] - pixel_xy[a]], axis=2)
    page = np.stack([page_xy[b] - page_xy[a], page_xy[c] - page_xy[a]], axis=2)
    area = pixel[:, 0, 0] * pixel[:, 1, 1] - pixel[:, 0, 1] * pixel[:, 1, 0]
    adjugate = np.stack([pixel[:, 1, 1], -pixel[:, 0, 1], -pixel[:, 1, 0], pixel[:, 0, 0]], axis=1).reshape(-1, 2, 2)
    nonzero_area = np.where(np.abs(area) > TINY_AREA_PX, area, np.inf)
    slope: Floats = page @ adjugate / nonzero_area[:, None, None]
    return slope


def interpolate_to_pixels(face: Ints, weights: NDArray[np.float32], faces: Ints, values: Floats) -> Floats:
    """Interpolate vertex values (n, d) to pixels: (rows, cols, d), NaN where none of `faces` is visible."""
    result = np.full((*face.shape, values.shape[1]), np.nan)
    with thread_pool() as parallel_for:
        parallel_for(_interpolate, len(face), face, weights, faces, values, result, block=64)
    return result


@njit(cache=True, nogil=True)
def _interpolate(begin, end, face, weights, faces, values, result):  # type: ignore[no-untyped-def]
    for r in range(begin, end):
        for q in range(face.shape[1]):
            f = face[r, q]
            if 0 <= f < len(faces):
                a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
                for k in range(values.shape[1]):
                    base = values[a, k]
                    ascent = weights[r, q, 0] * (values[b, k] - base) + weights[r, q, 1] * (values[c, k] - base)
                    result[r, q, k] = base + ascent
