"""Image layers of the HTML page: the page, the photo it comes from, and quality maps."""

from __future__ import annotations

import io
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from planish.color import to_uint8
from planish.document.cut_picture import cut_picture
from planish.geometry.rigid_fit import fit_similarity
from planish.mesh import rasterize
from planish.report.drawing import fitted, rgb_uint8
from planish.report.heat import TOP, over_page, round_above, round_span
from planish.types import Floats, Page, Restoration, Scan
from planish.view.fall_animation import FallAnimation

LONG_SIDE_PX = 2000
"""Long side of an image in pixels: more than a screen shows of a whole page."""
QUALITIES = (85, 75, 60, 45, 30)
MAX_BYTES = 1_500_000
"""Maximum size of one image. At quality 85 a page of text takes 0.8 MB; noise on a square page takes more."""
MARGIN_FRACTION = 0.06
"""Width of the margin as a fraction of the long side: in the photo, a bent sheet extends beyond its page."""
MAP_ROWS = 400
UNKNOWN = 255
"""Code value of a map where there is no data."""
MAX_RESIDUAL = 0.15
"""Largest RMS residual, as a fraction of the page diagonal, of the similarity from photo to page for a photo that shows
the sheet as a whole. A texture atlas, as photogrammetry makes them, exceeds it."""
BACKGROUND = (154, 154, 150)
"""Colour of pixels without data: a grey that is inconspicuous in light and dark mode."""


@dataclass(frozen=True)
class Picture:
    """An image of the page, with or without a margin around it.

    Attributes
    ----------
    name, title, description : str
        Element id, label, and one sentence on what it shows.
    mime : str
    data : bytes
    with_margin : bool
    """

    name: str
    title: str
    description: str
    mime: str
    data: bytes
    with_margin: bool = False


@dataclass(frozen=True, eq=False)
class Map:
    """A scalar map over the page.

    Attributes
    ----------
    name, title, unit, description : str
    values : (rows, cols) uint8
        0 to 254 from `low` to `high`; 255 where there is no data.
    low, high : float
    """

    name: str
    title: str
    unit: str
    description: str
    values: NDArray[np.uint8]
    low: float
    high: float


def margin_mm(size_mm: tuple[float, float]) -> float:
    """Width of the margin around the page [mm]."""
    return MARGIN_FRACTION * max(size_mm)


def page_pictures(restoration: Restoration) -> list[Picture]:
    """Rendered, unshaded and binarized page, as far as they exist."""
    pages = (
        ("restored", "Restored", "The photo drawn on the flat page, with its own light.", restoration.rendered),
        ("unshaded", "Unshaded", "The page with the illumination of the photo divided out.", restoration.unshaded),
        ("binary", "Black and white", "The page in black and white.", restoration.binary),
    )
    return [
        Picture(name, title, sentence, *_encode_jpeg(_thumbnail(page), _profile(page)))
        for name, title, sentence, page in pages
        if page is not None
    ]


def warped_picture(restoration: Restoration, page_xy: Floats, animation: FallAnimation) -> Picture:
    """Image of the sheet before flattening: its photo, aligned with the page; otherwise the scan from above.

    Parameters
    ----------
    restoration : Restoration
        With a rendered page.
    page_xy : (n, 2) float64 [mm]
        Flattened positions of the points of the repaired mesh.
    animation : FallAnimation
        Of that sheet, for the view from above.
    """
    overlay = _photo_over_page(restoration.prepared.scan, page_xy, restoration.flattening.size_mm)
    if overlay is not None:
        pixels, description = overlay, "The photo, rotated and scaled to match the page as well as possible."
        title = "Photo"
    else:
        pixels, title = _top_view(restoration, animation), "From above"
        description = "The scan seen from above; its texture is in patches, not one photo."
    icc = restoration.prepared.scan.icc if pixels.ndim == 3 else None
    return Picture("warped", title, description, *_encode_jpeg(pixels, icc), with_margin=True)


def left_out_picture(restoration: Restoration) -> Picture | None:
    """The whole scan with what was left out of it dark; None where nothing was."""
    pixels = cut_picture(restoration.prepared)
    if pixels is None:
        return None
    _, _, (width, height) = _frame(restoration.flattening.size_mm)
    inner = fitted(rgb_uint8(pixels), width, height)
    rows, cols = inner.shape[:2]
    framed = np.full((height, width, 3), BACKGROUND, np.uint8)
    top, left = (height - rows) // 2, (width - cols) // 2
    framed[top : top + rows, left : left + cols] = inner
    description = "The whole scan; what is dark was left out, as it does not belong to the sheet."
    icc = restoration.prepared.source.icc
    return Picture("left-out", "Left out", description, *_encode_jpeg(framed, icc), with_margin=True)


def quality_maps(restoration: Restoration, page_xy: Floats, strain: Floats, error: Floats) -> list[Map]:
    """Maps of strain, effective resolution and expected error; `strain` and `error` are per point."""
    strain_and_error = over_page(
        page_xy,
        restoration.prepared.scan.mesh.faces,
        np.c_[100 * strain, error],
        restoration.flattening.size_mm,
        rows=MAP_ROWS,
    )
    description = "Relative difference between lengths on the page and on the paper (rms around each point)."
    maps = [_map("strain", "Strain", "%", description, strain_and_error[..., 0])]
    if restoration.ppi is not None and np.isfinite(restoration.ppi).any():
        description = "Photo pixels per inch of page, in the direction of lowest resolution."
        low, high = round_span(restoration.ppi, 20)
        maps.append(_map("ppi", "Effective ppi", "ppi", description, restoration.ppi.astype(np.float64), low, high))
    description = "Expected distance of each point from its true position, estimated from strain and scan noise."
    return [*maps, _map("error", "Expected error", "mm", description, strain_and_error[..., 1])]


def _map(
    name: str, title: str, unit: str, description: str, values: Floats, low: float = 0.0, high: float | None = None
) -> Map:
    valid = np.isfinite(values)
    if high is None:
        high = round_above(float(np.quantile(values[valid], TOP)) if valid.any() else 0.0)
    fraction = np.clip((np.where(valid, values, 0.0) - low) / (high - low), 0, 1)
    codes = np.where(valid, np.round(fraction * (UNKNOWN - 1)), UNKNOWN).astype(np.uint8)
    return Map(name, title, unit, description, codes, low, high)


def _thumbnail(page: Page) -> NDArray[np.uint8]:
    """A page reduced to screen size, 8 bit; binary pages become grey."""
    pixels = to_uint8(page.pixels)
    rows, cols = pixels.shape[:2]
    scale = LONG_SIDE_PX / max(rows, cols)
    if scale >= 1:
        return pixels
    size = max(1, round(cols * scale)), max(1, round(rows * scale))
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)


def _profile(page: Page) -> bytes | None:
    return page.icc if page.pixels.ndim == 3 else None


def _encode_jpeg(pixels: NDArray[np.uint8], icc: bytes | None) -> tuple[str, bytes]:
    """Encode as JPEG at the best quality within `MAX_BYTES`: (media type, bytes)."""
    picture = Image.fromarray(pixels)
    for quality in QUALITIES:
        file = io.BytesIO()
        picture.save(file, "JPEG", quality=quality, optimize=True, icc_profile=icc)
        if file.tell() <= MAX_BYTES:
            break
    return "image/jpeg", file.getvalue()


def _frame(size_mm: tuple[float, float]) -> tuple[float, float, tuple[int, int]]:
    """Image with margin: width of the margin in mm, pixels per mm, (width, height) in pixels."""
    margin = margin_mm(size_mm)
    wide, high = size_mm[0] + 2 * margin, size_mm[1] + 2 * margin
    scale = LONG_SIDE_PX / max(wide, high)
    return margin, scale, (max(1, round(wide * scale)), max(1, round(high * scale)))


def _photo_over_page(scan: Scan, page_xy: Floats, size_mm: tuple[float, float]) -> NDArray[np.uint8] | None:
    """Photo warped to the page by the best similarity; None if the residual exceeds `MAX_RESIDUAL`."""
    if scan.photo is None or scan.photo_xy is None:
        return None
    photo_xy = scan.photo_xy
    target = page_xy if photo_xy.ndim == 2 else page_xy[scan.mesh.faces].reshape(-1, 2)
    source = photo_xy.reshape(-1, 2)
    finite = np.isfinite(source).all(axis=1)
    if not finite.any():
        return None
    source, target = source[finite], target[finite]
    linear, shift = fit_similarity(source, target)
    residual = np.sqrt(((source @ linear.T + shift - target) ** 2).sum(axis=1).mean())
    if residual > MAX_RESIDUAL * np.hypot(*size_mm):
        return None
    margin, scale, size = _frame(size_mm)
    photo = rgb_uint8(scan.photo)
    linear, shift = linear * scale, (shift + margin) * scale - 0.5
    shrink = min(1.0, float(np.sqrt(abs(np.linalg.det(linear)))))
    rows, cols = photo.shape[:2]
    width, height = max(1, round(cols * shrink)), max(1, round(rows * shrink))
    small = cv2.resize(photo, (width, height), interpolation=cv2.INTER_AREA)
    back = np.diag([cols / width, rows / height])  # from small photo to photo pixels
    middle = np.array([cols / width, rows / height]) / 2 - 0.5
    matrix = np.c_[linear @ back, linear @ middle + shift]
    return np.asarray(
        cv2.warpAffine(
            small, matrix, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=BACKGROUND
        ),
        np.uint8,
    )


def _top_view(restoration: Restoration, animation: FallAnimation) -> NDArray[np.uint8]:
    """Orthographic view of the scanned sheet from above, textured with the page."""
    assert restoration.rendered is not None
    size_mm = restoration.flattening.size_mm
    margin, scale, (width, height) = _frame(size_mm)
    scanned, flat = (state[:, :2] * [1, -1] + np.array(size_mm) / 2 for state in animation.states[[0, -1]])
    faces = animation.faces
    face, w = rasterize((scanned + margin) * scale - 0.5, faces, (height, width), nearness=animation.states[0, :, 2])
    weights = np.concatenate([1 - w.sum(axis=2, keepdims=True), w], axis=2)
    page_xy = np.einsum("rck,rckd->rcd", weights, flat[faces[np.maximum(face, 0)]])
    page = _thumbnail(restoration.rendered)
    pixel_xy = page_xy * [page.shape[1] / size_mm[0], page.shape[0] / size_mm[1]] - 0.5
    image = cv2.remap(page, pixel_xy.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    image = rgb_uint8(np.asarray(image))
    image[face < 0] = BACKGROUND
    return image
