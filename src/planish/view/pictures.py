"""What can be laid over the page: pictures of it, the photo it came from, and maps of how good it is."""

from __future__ import annotations

import io
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from planish.color import to_uint8
from planish.mesh import rasterize
from planish.report.drawing import rgb_uint8
from planish.report.heat import TOP, over_page, round_above, round_span
from planish.types import Floats, Page, Restoration, Scan
from planish.view.settling import Settling

LONG_SIDE = 2000
"""Pixels of the long side of a picture: more than a screen shows of a whole page."""
QUALITIES = (85, 75, 60, 45, 30)
MOST_BYTES = 1_500_000
"""Of one picture. At quality 85 a page of text takes 0.8 MB; only noise all over a square page takes more."""
MARGIN = 0.06
"""Of the page's long side, around the page: a bent sheet reaches over its own page in the photo."""
MAP_ROWS = 400
UNKNOWN = 255
"""Of a map's code values, where nothing is known."""
ALIKE = 0.15
"""A photo whose places are off the page's by less than this part of its diagonal (rms), after it was turned, shifted
and scaled, shows the sheet as a whole. A texture in patches, as photogrammetry makes them, does not."""
GROUND = (154, 154, 150)
"""Where a picture shows nothing: a grey that is dull on light and on dark pages alike."""


@dataclass(frozen=True)
class Picture:
    """A picture of the page, or of the page with the margin around it.

    Attributes
    ----------
    name, title, said : str
        Its place in the file; its name for people; and what it shows, in a sentence.
    mime : str
    data : bytes
    with_margin : bool
    """

    name: str
    title: str
    said: str
    mime: str
    data: bytes
    with_margin: bool = False


@dataclass(frozen=True, eq=False)
class Map:
    """A value over the page.

    Attributes
    ----------
    name, title, unit, said : str
    values : (rows, cols) uint8
        0 to 254 from `low` to `high`; 255 where nothing is known.
    low, high : float
    """

    name: str
    title: str
    unit: str
    said: str
    values: NDArray[np.uint8]
    low: float
    high: float


def margin_of(size_mm: tuple[float, float]) -> float:
    """Width of the margin around the page [mm]."""
    return MARGIN * max(size_mm)


def page_pictures(done: Restoration) -> list[Picture]:
    """The page as the photo shows it, without shade, and in black and white, as far as they were made."""
    said = (
        ("restored", "Restored", "The photo drawn on the flat page, with its own light.", done.rendered),
        ("unshaded", "Unshaded", "The page with the light of the photo divided out.", done.unshaded),
        ("binary", "Black and white", "The page in black and white.", done.binary),
    )
    return [
        Picture(name, title, sentence, *_encoded(_small(page), _profile(page)))
        for name, title, sentence, page in said
        if page is not None
    ]


def warped_picture(done: Restoration, page_xy: Floats, fall: Settling) -> Picture:
    """The sheet before it was laid flat: its photo, turned and scaled to the page; else the scan from above.

    Parameters
    ----------
    done : Restoration
        With a page.
    page_xy : (n, 2) float64 [mm]
        Of the points of the repaired mesh.
    fall : Settling
        Of that sheet.
    """
    placed = _photo_on_page(done.prepared.scan, page_xy, done.flattening.size_mm)
    if placed is not None:
        pixels, said = placed, "The photo, turned and scaled to lie over the page as well as that can."
        title = "Photo"
    else:
        pixels, title = _from_above(done, fall), "From above"
        said = "The scan seen from above, as it lay on the table; its texture is in patches, not one photo."
    icc = done.prepared.scan.icc if pixels.ndim == 3 else None
    return Picture("warped", title, said, *_encoded(pixels, icc), with_margin=True)


def quality_maps(done: Restoration, page_xy: Floats, strain: Floats, error: Floats) -> list[Map]:
    """Maps of strain, effective resolution and expected error, from values at the points of the repaired mesh."""
    both = over_page(
        page_xy, done.prepared.scan.mesh.faces, np.c_[100 * strain, error], done.flattening.size_mm, rows=MAP_ROWS
    )
    said = "How far lengths on the page are from those of the paper (rms around each point)."
    maps = [_map("strain", "Strain", "%", said, both[..., 0])]
    if done.ppi is not None and np.isfinite(done.ppi).any():
        said = "Photo pixels per inch of page, in the direction where they are fewest."
        low, high = round_span(done.ppi, 20)
        maps.append(_map("ppi", "Effective ppi", "ppi", said, done.ppi.astype(np.float64), low, high))
    said = "How far each point is expected to be from its true place, as far as strain and the scan's noise tell."
    return [*maps, _map("error", "Expected error", "mm", said, both[..., 1])]


def _map(
    name: str, title: str, unit: str, said: str, values: Floats, low: float = 0.0, high: float | None = None
) -> Map:
    known = np.isfinite(values)
    if high is None:
        high = round_above(float(np.quantile(values[known], TOP)) if known.any() else 0.0)
    share = np.clip((np.where(known, values, 0.0) - low) / (high - low), 0, 1)
    codes = np.where(known, np.round(share * (UNKNOWN - 1)), UNKNOWN).astype(np.uint8)
    return Map(name, title, unit, said, codes, low, high)


def _small(page: Page) -> NDArray[np.uint8]:
    """A page as a picture of the size of a screen, grey where it is black and white."""
    pixels = to_uint8(page.pixels)
    rows, cols = pixels.shape[:2]
    scale = LONG_SIDE / max(rows, cols)
    if scale >= 1:
        return pixels
    size = max(1, round(cols * scale)), max(1, round(rows * scale))
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)


def _profile(page: Page) -> bytes | None:
    return page.icc if page.pixels.ndim == 3 else None


def _encoded(pixels: NDArray[np.uint8], icc: bytes | None) -> tuple[str, bytes]:
    """Pixels as JPEG, as good as the room for one picture allows: (media type, bytes)."""
    picture = Image.fromarray(pixels)
    for quality in QUALITIES:
        file = io.BytesIO()
        picture.save(file, "JPEG", quality=quality, optimize=True, icc_profile=icc)
        if file.tell() <= MOST_BYTES:
            break
    return "image/jpeg", file.getvalue()


def _frame(size_mm: tuple[float, float]) -> tuple[float, float, tuple[int, int]]:
    """The picture with its margin: mm around the page, pixels per mm, (width, height) in pixels."""
    margin = margin_of(size_mm)
    wide, high = size_mm[0] + 2 * margin, size_mm[1] + 2 * margin
    scale = LONG_SIDE / max(wide, high)
    return margin, scale, (max(1, round(wide * scale)), max(1, round(high * scale)))


def _photo_on_page(scan: Scan, page_xy: Floats, size_mm: tuple[float, float]) -> NDArray[np.uint8] | None:
    """The photo in the page's frame by the best similarity; None where its parts lie too differently for that."""
    if scan.photo is None or scan.photo_xy is None:
        return None
    places = scan.photo_xy
    target = page_xy if places.ndim == 2 else page_xy[scan.mesh.faces].reshape(-1, 2)
    source = places.reshape(-1, 2)
    good = np.isfinite(source).all(axis=1)
    if not good.any():
        return None
    source, target = source[good], target[good]
    turn, shift = _similarity(source, target)
    off = np.sqrt(((source @ turn.T + shift - target) ** 2).sum(axis=1).mean())
    if off > ALIKE * np.hypot(*size_mm):
        return None
    margin, scale, size = _frame(size_mm)
    photo = rgb_uint8(scan.photo)
    turn, shift = turn * scale, (shift + margin) * scale - 0.5
    shrink = min(1.0, float(np.sqrt(abs(np.linalg.det(turn)))))
    rows, cols = photo.shape[:2]
    width, height = max(1, round(cols * shrink)), max(1, round(rows * shrink))
    small = cv2.resize(photo, (width, height), interpolation=cv2.INTER_AREA)
    back = np.diag([cols / width, rows / height])  # from places on the small photo to those on the photo
    middle = np.array([cols / width, rows / height]) / 2 - 0.5
    matrix = np.c_[turn @ back, turn @ middle + shift]
    return np.asarray(
        cv2.warpAffine(small, matrix, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=GROUND),
        np.uint8,
    )


def _similarity(source: Floats, target: Floats) -> tuple[Floats, Floats]:
    """The matrix (2, 2) and shift (2,) that turn, scale and move places closest to others (Umeyama 1991)."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    u, s, vt = np.linalg.svd(b.T @ a)
    sign = np.diag([1, np.sign(np.linalg.det(u @ vt))])
    turn = (s * np.diag(sign)).sum() / max((a**2).sum(), 1e-300) * (u @ sign @ vt)
    return turn, target.mean(axis=0) - turn @ source.mean(axis=0)


def _from_above(done: Restoration, fall: Settling) -> NDArray[np.uint8]:
    """The sheet on its table from straight above, with what the page shows of it."""
    assert done.rendered is not None
    size_mm = done.flattening.size_mm
    margin, scale, (width, height) = _frame(size_mm)
    standing, lying = (state[:, :2] * [1, -1] + np.array(size_mm) / 2 for state in fall.states[[0, -1]])
    faces = fall.faces
    face, w = rasterize((standing + margin) * scale - 0.5, faces, (height, width), nearness=fall.states[0, :, 2])
    weights = np.concatenate([1 - w.sum(axis=2, keepdims=True), w], axis=2)
    place = np.einsum("rck,rckd->rcd", weights, lying[faces[np.maximum(face, 0)]])
    page = _small(done.rendered)
    at = place * [page.shape[1] / size_mm[0], page.shape[0] / size_mm[1]] - 0.5
    seen = cv2.remap(page, at.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    seen = rgb_uint8(np.asarray(seen))
    seen[face < 0] = GROUND
    return seen
