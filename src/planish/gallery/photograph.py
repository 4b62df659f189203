"""Render the photo of a printed sheet on a table: near light, perspective, area sampling of the print."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.dpi import mm_to_px
from planish.gallery.light import Light, irradiance, visibility
from planish.gallery.pixel_to_page import (
    FineMesh,
    front_facing,
    interpolate_to_pixels,
    page_per_pixel,
    pixels_showing,
    project,
    refine_page_xy,
)
from planish.gallery.sheets import Sheet, normals
from planish.mesh import rasterize
from planish.parallel import thread_pool
from planish.types import Bools, Camera, Floats, Ints, Page

PAPER = np.array([1.0, 0.985, 0.94])
"""Relative reflectance of blank paper: red, green, blue."""

INK = 0.035
"""Reflectance of solid black ink, relative to paper."""

TABLE = np.array([0.034, 0.035, 0.038])
"""Reflectance of the table."""

TABLE_CELL_MM = 1.5
TABLE_DEPTH_MM = 0.1
"""Depth of the table below z = 0, which keeps it behind the sheet."""

FLAT_MM = 0.01
FLAT_RAD = 0.06
"""Faces with less sagitta (a tenth of a pixel) and less variation of normals are rendered as flat."""

BAND = 512
"""Photo rows rendered at a time."""


def photograph(
    sheet: Sheet,
    mesh: FineMesh,
    page: Page,
    camera: Camera,
    light: Light,
    grain: float,
    rng: np.random.Generator,
) -> NDArray[np.uint8]:
    """Render a photo of the sheet.

    Parameters
    ----------
    sheet, mesh : Sheet, FineMesh
    page : Page
        The print; uint8, grey or colour.
    camera : Camera
        Its `shape_rc` is the size of the photo.
    light : Light
    grain : float
        Standard deviation of sensor noise, in levels of 255.
    rng : numpy.random.Generator

    Returns
    -------
    (rows, cols, 3) uint8
    """
    table_points, table_faces = _table(camera, len(mesh.points))
    points, faces = np.concatenate([mesh.points, table_points]), np.concatenate([mesh.faces, table_faces])
    pixel_xy, depth = project(camera, points)
    face, weights = rasterize(pixel_xy, faces, camera.shape_rc, nearness=1 / depth, perspective=True)
    front = front_facing(pixel_xy, mesh.faces)
    page_xy = interpolate_to_pixels(face, weights, mesh.faces, mesh.page_xy)
    upward = normals(sheet, mesh.page_xy)
    curved = pixels_showing(face, (mesh.sagitta_mm > FLAT_MM) | (_normal_spread(upward, mesh.faces) > FLAT_RAD))
    page_xy[curved] = refine_page_xy(sheet, mesh, camera, face[curved], page_xy[curved], np.stack(curved[::-1], axis=1))
    bright = _brightness(sheet, upward, light, points, faces, face, weights, front, curved, page_xy[curved])

    slopes = page_per_pixel(pixel_xy, mesh.page_xy, mesh.faces)
    print_ = np.asarray(page.pixels if page.pixels.ndim == 3 else np.repeat(page.pixels[..., None], 3, axis=2))
    reflect = PAPER * (INK + (1 - INK) * (np.arange(256.0) / 255)[:, None] ** light.gamma)
    size = np.array([sheet.width_mm, sheet.height_mm])
    photo = np.empty((*camera.shape_rc, 3), np.uint8)
    for top in range(0, len(photo), BAND):
        bottom = min(top + BAND, len(photo))
        linear = np.zeros((bottom - top, face.shape[1], 3), np.float32)
        scene = face, page_xy, bright, front, slopes, print_, reflect, mm_to_px(1, page.dpi), size
        with thread_pool() as parallel_for:
            parallel_for(_render_rows, bottom - top, top, *scene, linear, block=64)
        levels = 255 * np.clip(linear, 0, 1) ** np.float32(1 / light.gamma)
        levels += np.float32(grain) * rng.standard_normal(levels.shape, np.float32)
        photo[top:bottom] = np.clip(np.rint(levels), 0, 255)
    return photo


def _brightness(
    sheet: Sheet,
    upward: Floats,
    light: Light,
    points: Floats,
    faces: Ints,
    face: Ints,
    weights: NDArray[np.float32],
    front: Bools,
    curved: tuple[NDArray[np.int64], NDArray[np.int64]],
    curved_xy: Floats,
) -> Floats:
    """Irradiance at each pixel (rows, cols), scaled so that the brightest paper has the exposure.

    Interpolated between vertices, but evaluated per pixel on curved faces, so that creases stay sharp.
    """
    on_sheet = len(upward)
    all_normals = np.concatenate([upward, np.tile([0.0, 0.0, 1.0], (len(points) - on_sheet, 1))])
    lit = visibility(light, points, all_normals, faces)
    above = irradiance(light, points, all_normals, lit)
    bright: Floats = interpolate_to_pixels(face, weights, faces, above[:, None])[..., 0]
    back = np.append(~front, np.zeros(len(faces) - len(front) + 1, bool))[face]  # the last entry is for "no face"
    below = irradiance(light, points[:on_sheet], -upward, lit[:on_sheet])
    rows, cols = np.nonzero(back)
    bright[rows, cols] = interpolate_to_pixels(
        face[rows, cols][None], weights[rows, cols][None], faces[: len(front)], below[:, None]
    )[0, :, 0]

    share = interpolate_to_pixels(face[curved][None], weights[curved][None], faces[: len(front)], lit[:on_sheet, None])[
        0, :, 0
    ]
    side = np.where(back[curved], -1.0, 1.0)[:, None]
    bright[curved] = irradiance(light, sheet.bend(curved_xy), side * normals(sheet, curved_xy), share)
    return bright * (light.exposure / above[:on_sheet].max())


def _normal_spread(upward: Floats, faces: Ints) -> Floats:
    """Largest angle between the vertex normals of each face [rad]."""
    corners = upward[faces]
    cosines = np.einsum("mkd,mkd->mk", corners, np.roll(corners, 1, axis=1)).min(axis=1)
    angle: Floats = np.arccos(np.clip(cosines, -1, 1))
    return angle


def _table(camera: Camera, first: int) -> tuple[Floats, Ints]:
    """Grid over the visible part of the table; its faces index points from `first`."""
    rows, cols = camera.shape_rc
    reach = 0.1 * max(rows, cols) if np.any(camera.distortion) else 1.0  # distortion widens the field of view
    low, right, bottom = -reach, cols - 1 + reach, rows - 1 + reach
    corners = np.array([[low, low, 1], [right, low, 1], [low, bottom, 1], [right, bottom, 1]], float)
    rays = corners @ np.linalg.inv(camera.matrix).T @ camera.rotation
    eye = -camera.rotation.T @ camera.translation
    table_xy = (eye - (eye[2] + TABLE_DEPTH_MM) / rays[:, 2:] * rays)[:, :2]
    low, high = table_xy.min(axis=0), table_xy.max(axis=0)
    x, y = (np.linspace(a, b, 2 + int((b - a) / TABLE_CELL_MM)) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(x, y, [-TABLE_DEPTH_MM]), axis=-1).reshape(-1, 3)
    index = first + np.arange(len(grid), dtype=np.int32).reshape(len(y), len(x))
    a, b, c, d = (k.ravel() for k in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    return grid, np.concatenate([np.stack([a, b, c], axis=1), np.stack([c, b, d], axis=1)])


@njit(cache=True, nogil=True)
def _render_rows(begin, end, top, face, page_xy, bright, front, slopes, print_, reflect, density, size, linear):  # type: ignore[no-untyped-def]
    """Render linear light (rows, cols, 3) of the photo from row `top` on."""
    cols = face.shape[1]
    for r in range(top + begin, top + end):
        sample = np.empty(3)
        for q in range(cols):
            if face[r, q] < 0:
                continue
            f, dr, dq = _printed_side(r, q, face, front)
            if f >= 0:
                j = slopes[f]
                x = page_xy[r + dr, q + dq, 0] - j[0, 0] * dq - j[0, 1] * dr
                y = page_xy[r + dr, q + dq, 1] - j[1, 0] * dq - j[1, 1] * dr
                _area_sample(x, y, j, print_, reflect, density, size, sample)
            elif face[r, q] < len(front):
                sample[:] = PAPER  # the back of the sheet is blank
            else:
                sample[:] = TABLE
            for k in range(3):
                linear[r - top, q, k] = bright[r, q] * sample[k]


@njit(cache=True)
def _printed_side(r, q, face, front):  # type: ignore[no-untyped-def]
    """Face of the printed side at a pixel, or at a neighbour of a table pixel at its border: face, drow, dcol."""
    if face[r, q] < len(front):
        return (face[r, q] if front[face[r, q]] else -1), 0, 0
    for dr, dq in ((0, -1), (0, 1), (-1, 0), (1, 0)):
        if 0 <= r + dr < face.shape[0] and 0 <= q + dq < face.shape[1]:
            f = face[r + dr, q + dq]
            if 0 <= f < len(front) and front[f]:
                return f, dr, dq
    return -1, 0, 0


@njit(cache=True)
def _area_sample(x, y, j, print_, reflect, density, size, sample):  # type: ignore[no-untyped-def]
    """Mean reflectance over the pixel's footprint on the page, at least 2 x 2 samples and one per print pixel."""
    across = min(8, max(2, int(np.ceil(density * np.hypot(j[0, 0], j[1, 0])))))
    down = min(8, max(2, int(np.ceil(density * np.hypot(j[0, 1], j[1, 1])))))
    sample[:] = 0.0
    for m in range(down):
        for n in range(across):
            dq, dr = (n + 0.5) / across - 0.5, (m + 0.5) / down - 0.5
            px, py = x + j[0, 0] * dq + j[0, 1] * dr, y + j[1, 0] * dq + j[1, 1] * dr
            if 0 <= px <= size[0] and 0 <= py <= size[1]:
                _add_print(px * density - 0.5, py * density - 0.5, print_, reflect, sample)
            else:
                sample += TABLE
    sample /= across * down


@njit(cache=True)
def _add_print(x, y, print_, reflect, sample):  # type: ignore[no-untyped-def]
    """Add a bilinear sample of the print in linear light."""
    rows, cols = print_.shape[0], print_.shape[1]
    x, y = min(max(x, 0.0), cols - 1.0), min(max(y, 0.0), rows - 1.0)
    q, r = min(int(x), cols - 2), min(int(y), rows - 2)
    fx, fy = x - q, y - r
    for k in range(3):
        above = (1 - fx) * reflect[print_[r, q, k], k] + fx * reflect[print_[r, q + 1, k], k]
        below = (1 - fx) * reflect[print_[r + 1, q, k], k] + fx * reflect[print_[r + 1, q + 1, k], k]
        sample[k] += (1 - fy) * above + fy * below
