"""Sheets on tables as a range camera sees them, for tests."""

from dataclasses import replace
from functools import cache

import numpy as np

from planish.acquire.grid_mesh import grid_mesh
from planish.gallery import sheet
from planish.gallery.scene_view import aim_camera, render_view
from planish.types import Scan, Texture

CAMERA = aim_camera((0, -60, 620), (0, 0, 0), 520, (240, 320))
FINE = aim_camera((0, -60, 620), (0, 0, 0), 460, (480, 640))
"""A pixel is 0.8 mm."""

SKIN = (200, 150, 130)


@cache
def viewed(name, camera):
    return render_view(sheet(name), camera)


def seen(name, table=70.0, with_table=True, camera=CAMERA, finger=None):
    """A range image of a sheet of blank paper on its table, and a photo by the same camera; a finger of some colour."""
    shown = viewed(name, camera)
    points, paper = shown.points.copy(), np.isfinite(shown.page_xy[..., 0])
    levels = np.where(paper[..., None], 215.0, table) * np.ones(3)
    if finger is not None:
        held = raise_finger(points, paper)
        levels[held], paper = finger, paper & ~held
    levels += np.random.default_rng(1).normal(0, 4, paper.shape)[..., None]
    mesh, photo_xy = grid_mesh(np.where(with_table | paper[..., None], points, np.nan), camera)
    photo = np.clip(levels, 0, 255).astype(np.uint8)
    return Scan(mesh, photo, photo_xy, camera), paper[tuple(photo_xy.astype(int).T[::-1])]


def raise_finger(points, paper):
    """Raise points to a finger 24 mm wide that comes from the left and reaches 20 mm over the sheet; its pixels."""
    x, y = points[..., 0], points[..., 1]
    rows, cols = np.nonzero(paper)
    left = x[int(np.median(rows)), cols.min() + 3] + 20
    across = np.abs(y - np.median(y[paper])) / 12
    held = (across < 1) & (x < left)
    top = points[paper, 2].max() if np.ptp(points[paper, 2]) < 5 else np.median(points[held & paper, 2])
    height = top + 14 * np.sqrt(np.clip(1 - across**2, 0, 1)) - points[..., 2]
    eye = np.array([0, -60, 620.0])
    towards = eye - points[held]
    points[held] += towards / towards[:, 2:] * height[held][:, None]
    return held


def as_textures(scan):
    """The same scan with its photo as four textures, a quarter of the view each."""
    places = scan.photo_xy[scan.mesh.faces]
    rows, cols = scan.photo.shape[:2]
    middle = places.mean(axis=1)
    number = (middle[:, 0] > cols / 2) + 2 * (middle[:, 1] > rows / 2)
    images = tuple(Texture((rows, cols), 8, lambda: scan.photo) for _ in range(4))
    return Scan(scan.mesh, photo_xy=places, textures=images, texture_of_face=number.astype(np.int32))


def as_colours(scan):
    column, row = scan.photo_xy.astype(int).T
    return Scan(scan.mesh, colours=scan.photo[row, column])


def without_photo(scan):
    return replace(scan, photo=None, photo_xy=None, camera=None)


def in_shadow(scan):
    rows, cols = np.mgrid[:240, :320]
    shadow = np.where(rows + 0.5 * cols > 150, 1.0, 0.3)[..., None]
    return replace(scan, photo=(scan.photo * shadow).astype(np.uint8))


def box_on_table(width=140.0, deep=60.0, high=180.0, noise_mm=1.0):
    """A range image of a box on a table, turned by 20 degrees, that shows three of its faces."""
    camera = aim_camera((0, -300, 600), (0, 0, 60), 380, (240, 320))
    col, row = np.meshgrid(np.arange(320.0), np.arange(240.0))
    rays = np.stack([col, row, np.ones_like(col)], axis=-1) @ np.linalg.inv(camera.matrix).T @ camera.rotation
    eye = -camera.rotation.T @ camera.translation
    turn = np.radians(20)
    axes = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    with np.errstate(divide="ignore"):
        low, high_ = (((side - [0, 0, high / 2]) - axes @ eye) / (rays @ axes.T) for side in _sides(width, deep, high))
    first, last = np.minimum(low, high_).max(axis=-1), np.maximum(low, high_).min(axis=-1)
    table = -eye[2] / rays[..., 2]
    reach = np.where((first < last) & (first > 0), np.minimum(first, table), table)
    reach = reach + np.random.default_rng(2).normal(0, noise_mm, reach.shape) / np.linalg.norm(rays, axis=-1)
    return Scan(grid_mesh(eye + rays * reach[..., None], camera, noise_mm=noise_mm)[0])


def _sides(width, deep, high):
    half = np.array([width, deep, high]) / 2
    return -half + [0, 0, high], half + [0, 0, high]
