"""Ground truth per pixel of a camera above a sheet on a table: point, normal and page position; and reflectance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from planish.dpi import mm_to_px
from planish.gallery.photograph import INK, PAPER, TABLE
from planish.gallery.pixel_to_page import (
    FineMesh,
    fine_mesh,
    front_facing,
    interpolate_to_pixels,
    pixels_showing,
    project,
    refine_page_xy,
)
from planish.gallery.sheets import Sheet, normals
from planish.geometry import depths
from planish.geometry.guards import normalize
from planish.mesh import rasterize
from planish.types import Bools, Camera, Floats, Ints, Page

TABLE_MM = 800.0
TABLE_CELL_MM = 20.0
TABLE_DEPTH_MM = 0.1
"""Half extent of the table, its grid, and its depth below z = 0, which keeps it behind the sheet."""

FLAT_MM = 1e-3
"""Faces with a smaller sagitta count as flat; pixels on others are refined."""

CELL_MM = 1.0
"""Grid of the sheet's mesh."""

SHADOW_MM = 0.4
"""Depth tolerance of the shadow map."""


@dataclass(frozen=True, eq=False)
class SceneView:
    """Scene geometry seen by the pixels of a camera.

    Attributes
    ----------
    points : (rows, cols, 3) float64 [mm]
        World coordinates; NaN where there is neither sheet nor table.
    normals : (rows, cols, 3) float64
        Unit normals towards the camera; on the sheet interpolated between points 1 mm apart.
    page_xy : (rows, cols, 2) float64 [mm]
        Page position; NaN where the printed side is not visible.
    """

    points: Floats
    normals: Floats
    page_xy: Floats


def aim_camera(
    eye: tuple[float, float, float],
    target: tuple[float, float, float],
    view_mm: float,
    shape_rc: tuple[int, int],
    distortion: tuple[float, ...] = (),
) -> Camera:
    """Aim a camera or projector from `eye` at `target`, its image `view_mm` wide there.

    Image rows are parallel to the table's x axis as far as possible.

    Examples
    --------
    >>> camera = aim_camera((0, 0, 600), (0, 0, 0), 300, (480, 640))
    >>> camera.matrix[0].tolist(), camera.rotation.round(9).tolist()
    ([1280.0, 0.0, 319.5], [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    """
    away = np.subtract(target, eye).astype(float)
    distance = float(np.linalg.norm(away))
    forward = away / distance
    right = np.array([1.0, 0, 0]) - forward[0] * forward
    right = normalize(right)
    rotation = np.stack([right, np.cross(forward, right), forward]) + 0.0
    rows, cols = shape_rc
    focal = cols * distance / view_mm
    matrix = np.array([[focal, 0, (cols - 1) / 2], [0, focal, (rows - 1) / 2], [0, 0, 1]])
    return Camera(matrix, rotation, -rotation @ np.asarray(eye, float), shape_rc, np.asarray(distortion, float))


def supersampled_camera(camera: Camera, zoom: int) -> Camera:
    """The same view with each pixel divided into zoom x zoom."""
    matrix = camera.matrix.copy()
    matrix[:2] *= zoom
    matrix[:2, 2] += (zoom - 1) / 2
    rows, cols = camera.shape_rc
    return replace(camera, matrix=matrix, shape_rc=(rows * zoom, cols * zoom))


def render_view(sheet: Sheet, camera: Camera) -> SceneView:
    """Determine what every camera pixel sees, to a thousandth of a pixel on the sheet, including lens distortion."""
    mesh, points, faces = _scene(sheet)
    pixel_xy, depth = project(camera, points)
    face, weights = rasterize(pixel_xy, faces, camera.shape_rc, nearness=1 / depth, perspective=True)
    front = front_facing(pixel_xy, mesh.faces)
    page_xy = interpolate_to_pixels(face, weights, mesh.faces, mesh.page_xy)
    curved = pixels_showing(face, mesh.sagitta_mm > FLAT_MM)
    page_xy[curved] = refine_page_xy(sheet, mesh, camera, face[curved], page_xy[curved], np.stack(curved[::-1], axis=1))
    seen = interpolate_to_pixels(face, weights, faces, points)
    seen[curved] = sheet.bend(page_xy[curved])
    normal_map = np.zeros_like(seen)
    normal_map[..., 2] = 1.0
    on_sheet = np.isfinite(page_xy[..., 0])
    normal_map[on_sheet] = interpolate_to_pixels(face, weights, mesh.faces, normals(sheet, mesh.page_xy))[on_sheet]
    back = on_sheet & ~np.append(front, True)[np.where(face < len(front), face, -1)]
    normal_map[back] *= -1
    page_xy[back] = np.nan
    return SceneView(seen, normal_map, page_xy)


def lit_mask(sheet: Sheet, lamp: Camera, points: Floats, lamp_xy: NDArray[np.float32]) -> Bools:
    """Which points of a scene are lit by a projector, not in the shadow of the sheet (shadow map).

    Parameters
    ----------
    sheet : Sheet
    lamp : Camera
    points : (..., 3) float64 [mm]
    lamp_xy : (..., 2) float32 [px]
        Their projector pixels.

    Returns
    -------
    (...) bool
    """
    _, scene, faces = _scene(sheet)
    pixel_xy, depth = project(lamp, scene)
    face, weights = rasterize(pixel_xy, faces, lamp.shape_rc, nearness=1 / depth, perspective=True)
    rendered_depth = interpolate_to_pixels(face, weights, faces, depth[:, None])[..., 0]
    farthest = ndimage.maximum_filter(np.nan_to_num(rendered_depth, nan=np.inf), 3)
    flat = points.reshape(-1, 3)
    column, row = np.rint(np.nan_to_num(lamp_xy.reshape(-1, 2), nan=-1)).T
    distance_to_lamp = depths(lamp, flat)
    inside = (
        (row >= 0)
        & (row < len(rendered_depth))
        & (column >= 0)
        & (column < rendered_depth.shape[1])
        & (distance_to_lamp > 0)
    )
    visible = np.zeros(len(flat), bool)
    visible[inside] = (
        distance_to_lamp[inside] <= farthest[row[inside].astype(int), column[inside].astype(int)] + SHADOW_MM
    )
    return visible.reshape(points.shape[:-1])


def reflectance(seen: SceneView, page: Page, gamma: float = 2.2) -> Floats:
    """Reflectance at each pixel, (rows, cols, 3): print, blank paper or table."""
    printed = page.pixels if page.pixels.ndim == 3 else np.repeat(page.pixels[..., None], 3, axis=2)
    known = np.isfinite(seen.page_xy[..., 0])
    reflected = np.where(np.isfinite(seen.points[..., :1]), TABLE, 0.0)
    at = seen.page_xy[known][:, ::-1].T * mm_to_px(1, page.dpi) - 0.5
    for k in range(3):
        light = (printed[..., k].astype(np.float32) / 255) ** gamma
        reflected[known, k] = PAPER[k] * (INK + (1 - INK) * ndimage.map_coordinates(light, at, order=1, mode="nearest"))
    return np.asarray(reflected)


def bin_pixels(values: Floats, zoom: int) -> Floats:
    """Mean over zoom x zoom pixels."""
    rows, cols = values.shape[0] // zoom, values.shape[1] // zoom
    return np.asarray(values.reshape(rows, zoom, cols, zoom, *values.shape[2:]).mean(axis=(1, 3)))


def _scene(sheet: Sheet) -> tuple[FineMesh, Floats, Ints]:
    """Mesh of the sheet, and points and faces of sheet and table."""
    mesh = fine_mesh(sheet, CELL_MM)
    x = np.linspace(-TABLE_MM, TABLE_MM, 1 + round(2 * TABLE_MM / TABLE_CELL_MM))
    table = np.stack(np.meshgrid(x, x, [-TABLE_DEPTH_MM]), axis=-1).reshape(-1, 3)
    index = len(mesh.points) + np.arange(len(table), dtype=np.int32).reshape(len(x), len(x))
    a, b, c, d = (k.ravel() for k in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    table_faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([c, b, d], axis=1)])
    return mesh, np.concatenate([mesh.points, table]), np.concatenate([mesh.faces, table_faces])
