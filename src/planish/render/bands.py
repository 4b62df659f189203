"""Render the page in bands of rows, from one photo or from several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.color import code_values
from planish.parallel import thread_pool
from planish.render.blend import Blend
from planish.render.photo_view import PhotoView
from planish.render.rasterize_ids import rasterize_ids
from planish.render.sample import maps_of_faces, sample
from planish.types import Bools, Ints, Pixels

BAND_PIXELS = 4_000_000
"""Page pixels rendered at a time; working memory is about 16 bytes for each, with several photos 40."""
SLIGHT = 0.01
"""A share of a pixel below this is drawn only where no photo has more."""


def render_bands(
    views: Sequence[PhotoView], blend: Blend | None, shape_rc: tuple[int, int], px_per_mm: float
) -> tuple[Pixels, Bools]:
    """Draw all pixels of a page.

    Parameters
    ----------
    views : sequence of PhotoView
    blend : Blend or None
        How much of which to take; None for a single one.
    shape_rc : (int, int)
        Rows and columns of the page.
    px_per_mm : float

    Returns
    -------
    pixels : (rows, cols, 3) uint8 or uint16
        Not filled where nothing is known.
    known : (rows, cols) bool
    """
    rows, cols = shape_rc
    if views[0].textures:
        return _render_textures(views[0], shape_rc, px_per_mm)
    dtype = np.result_type(*(view.dtype for view in views))
    pixels, known = np.empty((rows, cols, 3), dtype), np.empty((rows, cols), np.bool_)
    samplers = [_Sampler(view, px_per_mm) for view in views]
    codes, band = code_values(dtype), max(1, BAND_PIXELS // cols)
    light = np.empty((min(band, rows), cols, 3), np.float32)
    for top in range(0, rows, band):
        here = slice(top, min(top + band, rows))
        if blend is None:
            samplers[0].sample(samplers[0].rasterize_ids((here.stop - top, cols), top), top, light, known[here])
        else:
            _mix(samplers, blend, top, px_per_mm, light, known[here])
        with thread_pool() as parallel_for:
            parallel_for(_encode, here.stop - top, light, known[here], codes, pixels[here], block=64)
    return pixels, known


def _render_textures(view: PhotoView, shape_rc: tuple[int, int], px_per_mm: float) -> tuple[Pixels, Bools]:
    """Draw the faces of each texture in turn, so that only one texture is in memory at a time."""
    rows, cols = shape_rc
    assert view.image is not None
    pixels, known = np.empty((rows, cols, 3), view.dtype), np.zeros((rows, cols), np.bool_)
    codes, band = code_values(view.dtype), max(1, BAND_PIXELS // cols)
    light, here = np.empty((min(band, rows), cols, 3), np.float32), np.empty((min(band, rows), cols), np.bool_)
    pixel_y = view.uv_map.page_xy[:, 1] * px_per_mm - 0.5
    for number, texture in enumerate(view.textures):
        faces = view.faces[view.image == number]
        if not len(faces):
            continue
        photo = texture.read()
        sampler = _Sampler(replace(view, photo=photo, textures=(), faces=faces), px_per_mm)
        low, high = pixel_y[faces].min(), pixel_y[faces].max()
        for top in range(0, rows, band):
            stop = min(top + band, rows)
            if high < top - 1 or low > stop:
                continue
            face = sampler.rasterize_ids((stop - top, cols), top)
            face[known[top:stop]] = -1
            drawn = here[: stop - top]
            sampler.sample(face, top, light, drawn)
            with thread_pool() as parallel_for:
                parallel_for(_encode, stop - top, light, drawn, codes, pixels[top:stop], block=64)
            known[top:stop] |= drawn
        del photo, sampler
    return pixels, known


class _Sampler:
    """A photo view prepared for a page of given resolution."""

    def __init__(self, view: PhotoView, px_per_mm: float) -> None:
        uv_map = view.uv_map
        assert view.photo is not None
        self.photo, self.faces = view.photo, view.faces
        self.pixel_xy = uv_map.page_xy * px_per_mm - 0.5
        self.maps = maps_of_faces(self.pixel_xy, uv_map.photo_xy, uv_map.jacobian / px_per_mm, view.faces)

    def rasterize_ids(self, shape_rc: tuple[int, int], top: int) -> Ints:
        return rasterize_ids(self.pixel_xy, self.faces, shape_rc, top=top)

    def sample(self, face: Ints, top: int, light: NDArray[np.float32], known: Bools) -> None:
        sample(self.photo, face, self.maps, top, light, known)


def _mix(
    samplers: Sequence[_Sampler], blend: Blend, top: int, px_per_mm: float, total: NDArray[np.float32], known: Bools
) -> None:
    """Fill a band with the weighted mean of what the photos show; what none shows well, from any that shows it."""
    rows, cols = known.shape
    light, here = np.empty((rows, cols, 3), np.float32), np.empty((rows, cols), np.bool_)
    mass = np.zeros((rows, cols), np.float32)
    total[:rows] = 0
    for slight in (False, True):
        for i, sampler in enumerate(samplers):
            face = sampler.rasterize_ids((rows, cols), top)
            place = top, px_per_mm * blend.cell_mm
            with thread_pool() as parallel_for:
                parallel_for(_choose, rows, face, blend.shares[i], *place, mass, slight, block=64)
                sampler.sample(face, top, light, here)
                parallel_for(
                    _add, rows, light, here, blend.shares[i], blend.gains[i], *place, slight, total, mass, block=64
                )
    known[:] = mass > 0
    with thread_pool() as parallel_for:
        parallel_for(_divide, rows, total, mass, block=64)


@njit(cache=True)
def _between(values, r, q, top, cell_px):  # type: ignore[no-untyped-def]
    """Where a page pixel lies between cells: the upper left cell and the parts of the way to the next."""
    y = min(max((r + top + 0.5) / cell_px - 0.5, 0.0), values.shape[0] - 1.0)
    x = min(max((q + 0.5) / cell_px - 0.5, 0.0), values.shape[1] - 1.0)
    i, j = min(int(y), max(values.shape[0] - 2, 0)), min(int(x), max(values.shape[1] - 2, 0))
    return i, j, np.float32(y - i), np.float32(x - j)


@njit(cache=True)
def _mean(values, i, j, down, across):  # type: ignore[no-untyped-def]
    below, right = min(i + 1, values.shape[0] - 1), min(j + 1, values.shape[1] - 1)
    upper = values[i, j] + across * (values[i, right] - values[i, j])
    lower = values[below, j] + across * (values[below, right] - values[below, j])
    return upper + down * (lower - upper)


@njit(cache=True, nogil=True)
def _choose(begin, end, face, share, top, cell_px, mass, slight):  # type: ignore[no-untyped-def]
    """Leave out the faces where this photo has next to no share; at last, those of pixels that are known already."""
    for r in range(begin, end):
        for q in range(face.shape[1]):
            if face[r, q] >= 0 and slight:
                if mass[r, q] > 0:
                    face[r, q] = -1
            elif face[r, q] >= 0 and _mean(share, *_between(share, r, q, top, cell_px)) < SLIGHT:
                face[r, q] = -1


@njit(cache=True, nogil=True)
def _add(begin, end, light, here, share, gain, top, cell_px, slight, total, mass):  # type: ignore[no-untyped-def]
    for r in range(begin, end):
        for q in range(here.shape[1]):
            if here[r, q]:
                i, j, down, across = _between(share, r, q, top, cell_px)
                part = np.float32(1) if slight else _mean(share, i, j, down, across)
                for k in range(3):
                    total[r, q, k] += part * _mean(gain[..., k], i, j, down, across) * light[r, q, k]
                mass[r, q] += part


@njit(cache=True, nogil=True)
def _divide(begin, end, total, mass):  # type: ignore[no-untyped-def]
    for r in range(begin, end):
        for q in range(mass.shape[1]):
            if mass[r, q] > 0:
                for k in range(3):
                    total[r, q, k] /= mass[r, q]


@njit(cache=True, nogil=True)
def _encode(begin, end, light, known, codes, pixels):  # type: ignore[no-untyped-def]
    for r in range(begin, end):
        for q in range(known.shape[1]):
            if known[r, q]:
                for k in range(3):
                    level = min(max(light[r, q, k], np.float32(0)), np.float32(1))
                    pixels[r, q, k] = codes[int(level * np.float32(65535) + np.float32(0.5))]
