"""Points of the sheet's rim: places along the rays of one photo's outline that lie on the outline of the others too.

Blank margins have no print by which photos could be compared, but they end in a rim that all photos show.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numba import njit

from planish.acquire.photos.paper import Paper
from planish.acquire.photos.patch_matching import PhotoStack, project_point, stack_photos
from planish.geometry import camera_position, depths
from planish.parallel import thread_pool
from planish.types import Camera, Floats

OUTLINE_STEPS = 400
"""Rays of each photo, evenly along its outline: one in 3 mm around A4."""
ON_OUTLINE_PX = 3.0
"""A place lies on the outline of a photo if it is so near; paper in front of other paper lies on it in few photos."""
MIN_SHARE = 0.6
"""Of the other photos on whose outline a place must lie, and at least `FEWEST` of them."""
FEWEST = 2
"""With one other photo alone nearly every ray has such a place."""
DEPTH_STEPS = 600
"""Of a ray: half a millimetre over the 300 mm that are searched for A4."""
BEYOND = 0.25
"""Depths are tried so far beyond those of the sheet's points, in parts of the sheet's extent."""


def rim_points(papers: Sequence[Paper | None], cameras: Sequence[Camera], points: Floats) -> Floats:
    """Find points of the rim.

    Parameters
    ----------
    papers : sequence of Paper or None
    cameras : sequence of Camera
    points : (n, 3) float64 [mm]
        Of the sheet, for its depth in each photo.

    Returns
    -------
    (k, 3) float64 [mm]
    """
    pairs = [(paper, camera) for paper, camera in zip(papers, cameras, strict=True) if paper is not None]
    if len(pairs) <= FEWEST:
        return np.zeros((0, 3))
    outlines = [paper.inside_px.astype(np.float32) for paper, _ in pairs]
    stack = stack_photos(outlines, [camera for _, camera in pairs], [1.0] * len(pairs))
    beyond = BEYOND * float(np.linalg.norm(np.ptp(points, axis=0)))
    found = [
        _on_rays(stack, number, *_rays(paper, camera), _depth_range(camera, points, beyond))
        for number, (paper, camera) in enumerate(pairs)
    ]
    return np.concatenate(found)


def _rays(paper: Paper, camera: Camera) -> tuple[Floats, Floats]:
    """The camera's place (3,), and directions (k, 3) of depth 1 through pixels of the outline."""
    inside = (paper.inside_px > 0).astype(np.uint8)
    outlines = cv2.findContours(inside, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    pixels = max(outlines, key=len, default=np.zeros((0, 2))).reshape(-1, 2).astype(np.float64)
    rows, cols = inside.shape
    pixels = pixels[(pixels > 1).all(axis=1) & (pixels < [cols - 2, rows - 2]).all(axis=1)]
    pixels = pixels[:: max(1, len(pixels) // OUTLINE_STEPS)]
    eye = camera_position(camera)
    if not len(pixels):
        return eye, np.zeros((0, 3))
    lens = camera.distortion if camera.distortion.size else np.zeros(4)
    flat = cv2.undistortPoints(pixels[:, None], camera.matrix, lens).reshape(-1, 2)
    return eye, np.column_stack([flat, np.ones(len(flat))]) @ camera.rotation


def _depth_range(camera: Camera, points: Floats, beyond: float) -> tuple[float, float]:
    depth = depths(camera, points)
    low, high = np.quantile(depth, [0.02, 0.98])
    return max(float(low) - beyond, 0.1 * float(low)), float(high) + beyond


def _on_rays(stack: PhotoStack, photo: int, eye: Floats, rays: Floats, limits: tuple[float, float]) -> Floats:
    depth = np.full(len(rays), np.nan)
    with thread_pool() as parallel_for:
        parallel_for(
            _search, len(rays), stack.pixels, stack.first, stack.rows, stack.cols, stack.cameras, photo, eye, rays,
            limits[0], limits[1], depth, block=32,
        )  # fmt: skip
    found = np.isfinite(depth)
    return np.asarray(eye + depth[found, None] * rays[found])


@njit(cache=True, nogil=True)
def _search(begin, end, pixels, first, rows, cols, cameras, photo, eye, rays, low, high, depth):  # type: ignore[no-untyped-def]
    """For each ray the depth at which it is nearest to the outlines of the others, if it is on most of them."""
    for i in range(begin, end):
        best = 1e30
        for step in range(DEPTH_STEPS):
            d = low + (high - low) * step / (DEPTH_STEPS - 1)
            x, y, z = eye[0] + d * rays[i, 0], eye[1] + d * rays[i, 1], eye[2] + d * rays[i, 2]
            seen, near, total = 0, 0, 0.0
            for v in range(len(first)):
                if v == photo:
                    continue
                c, r, front = project_point(cameras[v], x, y, z)
                if front <= 0 or not (0 <= c < cols[v] - 1 and 0 <= r < rows[v] - 1):
                    continue
                seen += 1
                away = abs(pixels[first[v] + int(r + 0.5) * cols[v] + int(c + 0.5)])
                if away <= ON_OUTLINE_PX:
                    near += 1
                    total += away
            if near >= FEWEST and near >= MIN_SHARE * seen:
                score = total / near + ON_OUTLINE_PX * (seen - near) / seen
                if score < best:
                    best = score
                    depth[i] = d
