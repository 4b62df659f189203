"""A lit sheet, its table and marker cards, ready to be photographed from anywhere.

The light stands still, so what every place sends out is worked out once, on maps of the page, its back and the table;
a photo only looks it up. Photos are drawn with 2 x 2 samples a pixel, so that edges of the sheet, of what hides it and
of the cards have the right grey.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from planish.dpi import mm_to_px
from planish.gallery.light import Light, irradiance, visibility
from planish.gallery.marker_card import MarkerCard, card_cells
from planish.gallery.photograph import FLAT_MM, INK, PAPER
from planish.gallery.pixel_to_page import (
    FineMesh,
    front_facing,
    interpolate_to_pixels,
    pixels_showing,
    project,
    refine_page_xy,
)
from planish.gallery.sheets import Sheet, normals
from planish.mesh import rasterize
from planish.parallel import thread_pool
from planish.types import Camera, Floats, Page

ZOOM = 2
"""Samples per pixel, each way. With 4 the grey at edges is off by half as much, in four times the time."""

BAND = 256
"""Rows of the photo drawn at a time."""

SHADE_MM = 0.5
"""Grid of the light on the page: shade at creases is sharp to this."""

PENUMBRA_MM = 1.5
"""Standard deviation of the blur of shadows on the sheet."""

SHADOW_CELL_MM = 3.0
"""Grid of the light on the table."""

PAPER_LIFT_MM = 0.1
"""The table's light is worked out so far below z = 0, which keeps the sheet from shading itself there."""

FloatMap = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LitScene:
    """Everything a photo shows, in linear light.

    Attributes
    ----------
    sheet : Sheet
    mesh : FineMesh
    front, back : (rows, cols, 3) float32
        What both sides of the sheet send out, over the page.
    page_px, back_px : float
        Cells of both per millimetre.
    table : (n, n, 3) float32
        What the table sends out.
    light : (n, n) float32
        What falls on it, for the cards.
    half_mm : float
        Half the side of the square that the table's maps cover; beyond it they repeat, mirrored.
    cards : tuple of MarkerCard
    gamma : float
    """

    sheet: Sheet
    mesh: FineMesh
    front: FloatMap
    back: FloatMap
    page_px: float
    back_px: float
    table: FloatMap
    light: FloatMap
    half_mm: float
    cards: tuple[MarkerCard, ...]
    gamma: float


def lit_scene(
    sheet: Sheet,
    mesh: FineMesh,
    page: Page,
    cards: tuple[MarkerCard, ...],
    table: FloatMap,
    half_mm: float,
    light: Light,
) -> LitScene:
    """Work out what sheet and table send out.

    Parameters
    ----------
    sheet, mesh : Sheet, FineMesh
    page : Page
        The print; uint8, grey or colour.
    cards : tuple of MarkerCard
    table : (n, n, 3) float32
        Its reflectance, from `table_top`.
    half_mm : float
        Half the side of its square.
    light : Light
    """
    reach = min(half_mm, 400.0)
    x = np.linspace(-reach, reach, 1 + round(2 * reach / SHADOW_CELL_MM))
    ground = np.stack(np.meshgrid(x, x, [-PAPER_LIFT_MM]), axis=-1).reshape(-1, 3)
    points = np.concatenate([mesh.points, ground])
    upward = np.concatenate([normals(sheet, mesh.page_xy), np.tile([0.0, 0.0, 1.0], (len(ground), 1))])
    lit = visibility(light, points, upward, np.concatenate([mesh.faces, _grid_faces(len(x), len(mesh.points))]))
    on_sheet, on_ground = lit[: len(mesh.points)], lit[len(mesh.points) :].reshape(len(x), len(x))

    shade_xy, shape = _page_grid(sheet, SHADE_MM)
    at, facing = sheet.bend(shade_xy), normals(sheet, shade_xy)
    share = _over_page(mesh, sheet, on_sheet, shade_xy)
    above, below = (irradiance(light, at, side * facing, share).reshape(shape) for side in (1.0, -1.0))
    gain = light.exposure / above.max()

    density = mm_to_px(1, page.dpi)
    print_ = np.asarray(page.pixels if page.pixels.ndim == 3 else np.repeat(page.pixels[..., None], 3, axis=2))
    level = (INK + (1 - INK) * (np.arange(256.0) / 255) ** light.gamma)[:, None] * PAPER
    front = np.empty(print_.shape, np.float32)
    table_light = _table_light(light, on_ground, reach, half_mm, len(table)) * np.float32(gain)
    with thread_pool() as parallel_for:
        shaded = print_, (gain * level).astype(np.float32), above.astype(np.float32), 1 / (density * SHADE_MM), front
        parallel_for(_shade_print, len(front), *shaded, block=64)
    back = (gain * below[..., None] * PAPER).astype(np.float32)
    sent = table * table_light[..., None]
    return LitScene(sheet, mesh, front, back, density, 1 / SHADE_MM, sent, table_light, half_mm, cards, light.gamma)


def draw_scene(scene: LitScene, camera: Camera) -> FloatMap:
    """Draw what a camera sees, without its faults: (rows, cols, 3) float32 in linear light."""
    rows, cols = camera.shape_rc
    pixel_xy, depth = project(camera, scene.mesh.points, ZOOM)
    front = front_facing(pixel_xy, scene.mesh.faces)
    cells, places = _cards_for_kernel(scene.cards)
    lens = np.zeros(5)
    lens[: len(camera.distortion)] = camera.distortion
    eye = -camera.rotation.T @ camera.translation
    photo = np.empty((rows, cols, 3), np.float32)
    for top in range(0, rows, BAND):
        bottom = min(top + BAND, rows)
        shape = ((bottom - top) * ZOOM, cols * ZOOM)
        face, weights = rasterize(
            pixel_xy, scene.mesh.faces, shape, nearness=1 / depth, perspective=True, top=top * ZOOM
        )
        page_xy = interpolate_to_pixels(face, weights, scene.mesh.faces, scene.mesh.page_xy)
        curved = pixels_showing(face, scene.mesh.sagitta_mm > FLAT_MM)
        target = np.stack([curved[1], curved[0] + top * ZOOM], axis=1)
        page_xy[curved] = refine_page_xy(scene.sheet, scene.mesh, camera, face[curved], page_xy[curved], target, ZOOM)
        view = camera.matrix, camera.rotation, eye, lens, scene.half_mm, scene.table, scene.light, cells, places
        sides = face, page_xy, front, scene.front, scene.page_px, scene.back, scene.back_px
        with thread_pool() as parallel_for:
            parallel_for(_draw_rows, bottom - top, top, *sides, *view, photo[top:bottom], block=32)
    return photo


def _page_grid(sheet: Sheet, cell_mm: float) -> tuple[Floats, tuple[int, int]]:
    """Centres of cells that cover the page, (k, 2) [mm], and how many there are down and across."""
    rows, cols = (int(np.ceil(side / cell_mm)) for side in (sheet.height_mm, sheet.width_mm))
    x, y = (np.minimum((np.arange(n) + 0.5) * cell_mm, side)
            for n, side in ((cols, sheet.width_mm), (rows, sheet.height_mm)))  # fmt: skip
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), (rows, cols)


def _over_page(mesh: FineMesh, sheet: Sheet, values: Floats, page_xy: Floats) -> Floats:
    """Interpolate values at the mesh's points to places of the page, blurred: lamps are no points."""
    cols = int(np.count_nonzero(mesh.page_xy[:, 1] == mesh.page_xy[0, 1]))
    grid = ndimage.gaussian_filter(values.reshape(-1, cols), PENUMBRA_MM / mesh.cell_mm, mode="nearest")
    step = np.array([sheet.height_mm / (len(grid) - 1), sheet.width_mm / (cols - 1)])
    return np.asarray(ndimage.map_coordinates(grid, (page_xy[:, ::-1] / step).T, order=1, mode="nearest"))


def _table_light(light: Light, lit: Floats, reach: float, half_mm: float, count: int) -> FloatMap:
    """Irradiance of the table (count, count); shadows only fall within `reach` of the origin."""
    x = np.linspace(-half_mm, half_mm, 1 + round(2 * half_mm / SHADOW_CELL_MM))
    at = np.stack(np.meshgrid(x, x, [0.0]), axis=-1).reshape(-1, 3)
    index = (at[:, 1::-1] + reach) / (2 * reach) * (len(lit) - 1)
    share = ndimage.map_coordinates(lit, index.T, order=1, mode="nearest")
    grid = irradiance(light, at, np.tile([0.0, 0.0, 1.0], (len(at), 1)), share).reshape(len(x), len(x))
    return np.asarray(ndimage.zoom(grid.astype(np.float32), count / len(grid), order=1, grid_mode=True, mode="nearest"))


def _grid_faces(count: int, first: int) -> NDArray[np.int32]:
    index = first + np.arange(count * count, dtype=np.int32).reshape(count, count)
    a, b, c, d = (k.ravel() for k in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([c, b, d], axis=1)])


def _cards_for_kernel(cards: tuple[MarkerCard, ...]) -> tuple[NDArray[np.uint8], Floats]:
    """Cells (m, 8, 8) of 0 and 1, with one ring of white, and rows (x, y, cos, sin, side, quiet) of the cards."""
    cells = np.ones((len(cards), 8, 8), np.uint8)
    places = np.zeros((len(cards), 6))
    for k, card in enumerate(cards):
        cells[k, 1:-1, 1:-1] = card_cells(card.number)
        angle = np.radians(card.turn_deg)
        places[k] = *card.centre_mm, np.cos(angle), np.sin(angle), card.side_mm, card.quiet_mm
    return cells, places


@njit(cache=True, nogil=True)
def _shade_print(begin, end, print_, level, shade, cells_per_px, front):  # type: ignore[no-untyped-def]
    """Light sent out by the print: reflectance times the light on the page, by bilinear interpolation."""
    for r in range(begin, end):
        y = min(max((r + 0.5) * cells_per_px - 0.5, 0.0), shade.shape[0] - 1.0)
        m = min(int(y), shade.shape[0] - 2)
        fy = y - m
        for q in range(print_.shape[1]):
            x = min(max((q + 0.5) * cells_per_px - 0.5, 0.0), shade.shape[1] - 1.0)
            n = min(int(x), shade.shape[1] - 2)
            fx = x - n
            light = (1 - fy) * ((1 - fx) * shade[m, n] + fx * shade[m, n + 1]) + fy * (
                (1 - fx) * shade[m + 1, n] + fx * shade[m + 1, n + 1]
            )
            for k in range(3):
                front[r, q, k] = light * level[print_[r, q, k], k]


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_rows(  # type: ignore[no-untyped-def]
    begin, end, top, face, page_xy, front, print_, page_px, back, back_px,
    matrix, rotation, eye, lens, half_mm, table, light, cells, places, photo
):  # fmt: skip
    sample, total = np.empty(3), np.empty(3)
    for r in range(begin, end):
        for q in range(photo.shape[1]):
            on_table = True
            for m in range(ZOOM):
                for n in range(ZOOM):
                    on_table &= face[r * ZOOM + m, q * ZOOM + n] < 0
            if on_table:
                x, y = _ground(q, top + r, matrix, rotation, eye, lens)
                if not _near_card(x, y, places):  # the table's own grain is coarser than pixels
                    _table_sample(x, y, half_mm, table, sample)
                    for k in range(3):
                        photo[r, q, k] = sample[k]
                    continue
            total[:] = 0.0
            for m in range(ZOOM):
                for n in range(ZOOM):
                    row, col = r * ZOOM + m, q * ZOOM + n
                    f = face[row, col]
                    if f < 0:
                        at_x, at_y = q + (n + 0.5) / ZOOM - 0.5, top + r + (m + 0.5) / ZOOM - 0.5
                        x, y = _ground(at_x, at_y, matrix, rotation, eye, lens)
                        if not _card_sample(x, y, half_mm, light, cells, places, sample):
                            _table_sample(x, y, half_mm, table, sample)
                    elif front[f]:
                        x, y = page_xy[row, col, 0], page_xy[row, col, 1]
                        _sample(print_, x * page_px - 0.5, y * page_px - 0.5, sample)
                    else:
                        x, y = page_xy[row, col, 0], page_xy[row, col, 1]
                        _sample(back, x * back_px - 0.5, y * back_px - 0.5, sample)
                    total += sample
            for k in range(3):
                photo[r, q, k] = total[k] / (ZOOM * ZOOM)


@njit(cache=True, error_model="numpy")
def _ground(x, y, matrix, rotation, eye, lens):  # type: ignore[no-untyped-def]
    """Where the ray of a pixel meets the table z = 0; NaN above the horizon."""
    u, v = (x - matrix[0, 2]) / matrix[0, 0], (y - matrix[1, 2]) / matrix[1, 1]
    a, b = u, v
    for _ in range(5):  # x <- (x_d - tangential) / radial: each step divides the error by about thirty
        rr = a * a + b * b
        radial = 1.0 / (1.0 + rr * (lens[0] + rr * (lens[1] + rr * lens[4])))
        tangent_a = 2.0 * lens[2] * a * b + lens[3] * (rr + 2.0 * a * a)
        tangent_b = lens[2] * (rr + 2.0 * b * b) + 2.0 * lens[3] * a * b
        a, b = (u - tangent_a) * radial, (v - tangent_b) * radial
    down = a * rotation[0, 2] + b * rotation[1, 2] + rotation[2, 2]
    if down >= -1e-3:
        return np.nan, np.nan
    t = -eye[2] / down
    return (
        eye[0] + t * (a * rotation[0, 0] + b * rotation[1, 0] + rotation[2, 0]),
        eye[1] + t * (a * rotation[0, 1] + b * rotation[1, 1] + rotation[2, 1]),
    )


@njit(cache=True)
def _near_card(x, y, places):  # type: ignore[no-untyped-def]
    """Whether a place of the table is within two millimetres of the circle around a card."""
    for k in range(len(places)):
        reach = 1.4143 * (places[k, 4] / 2 + places[k, 5]) + 2.0
        if (x - places[k, 0]) ** 2 + (y - places[k, 1]) ** 2 < reach * reach:
            return True
    return False


@njit(cache=True, error_model="numpy")
def _card_sample(x, y, half_mm, light, cells, places, sample):  # type: ignore[no-untyped-def]
    """What a card sends out at a place of the table; False where none lies."""
    for k in range(len(places)):
        dx, dy = x - places[k, 0], y - places[k, 1]
        across = dx * places[k, 2] + dy * places[k, 3]
        along = dx * places[k, 3] - dy * places[k, 2]  # down the card
        side = places[k, 4]
        if max(abs(across), abs(along)) <= side / 2 + places[k, 5]:
            m, n = int(np.floor(6 * along / side)) + 4, int(np.floor(6 * across / side)) + 4
            white = cells[k, min(max(m, 0), 7), min(max(n, 0), 7)]
            count = len(light)
            row, col = int(_mirrored(y, half_mm) * count), int(_mirrored(x, half_mm) * count)
            grey = light[min(row, count - 1), min(col, count - 1)] * (0.95 if white else INK)
            for channel in range(3):
                sample[channel] = grey * PAPER[channel]
            return True
    return False


@njit(cache=True)
def _table_sample(x, y, half_mm, table, sample):  # type: ignore[no-untyped-def]
    """What the table sends out; grey dusk above the horizon."""
    if np.isnan(x):
        sample[:] = 0.1
        return
    count = len(table)
    _sample(table, _mirrored(x, half_mm) * count - 0.5, _mirrored(y, half_mm) * count - 0.5, sample)


@njit(cache=True)
def _mirrored(x, half):  # type: ignore[no-untyped-def]
    """Place 0 to 1 in a square from -half to half that repeats mirrored."""
    t = (x + half) / (2.0 * half)
    t = abs(t) % 2.0
    return 2.0 - t if t > 1.0 else t


@njit(cache=True)
def _sample(image, x, y, sample):  # type: ignore[no-untyped-def]
    """Bilinear sample of a colour image."""
    rows, cols = image.shape[0], image.shape[1]
    x, y = min(max(x, 0.0), cols - 1.0), min(max(y, 0.0), rows - 1.0)
    q, r = min(int(x), cols - 2), min(int(y), rows - 2)
    fx, fy = x - q, y - r
    for k in range(3):
        sample[k] = (1 - fy) * ((1 - fx) * image[r, q, k] + fx * image[r, q + 1, k]) + fy * (
            (1 - fx) * image[r + 1, q, k] + fx * image[r + 1, q + 1, k]
        )
