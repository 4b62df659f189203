"""Whether the photos of a laser sweep stand in the order of their planes."""

from __future__ import annotations

import numpy as np

from planish.acquire.laser.crossings import Sweep
from planish.errors import InputError
from planish.geometry import project
from planish.geometry.triangulation import meet_plane, rays
from planish.types import Camera, Floats

STILL = 0.05
"""Of the usual step: two photos in which the line has moved by less show it in one place."""


def check_order(sweep: Sweep, camera: Camera, planes: Floats, inverse: Floats, names: list[str]) -> None:
    """Refuse photos that are shuffled or doubled.

    Seen from the camera, what the laser lights on a surface follows the order of its planes: a surface on which it
    did not would hide behind itself. So from one plane to the next the line must move the same way on the photo.

    Parameters
    ----------
    sweep : Sweep
    camera : Camera
    planes : (frames, lines, 4) float64
    inverse : (frames, count, lines) float64 [1/mm]
        Inverse depths of what was seen.
    names : list of str

    Raises
    ------
    InputError
    """
    seen = np.flatnonzero(np.isfinite(sweep.at[..., 0]).any(axis=1))
    expected = _expected(sweep, camera, planes[seen, 0], 1 / float(np.nanmedian(inverse)))
    seen, expected = seen[np.isfinite(expected)], expected[np.isfinite(expected)]
    order = np.argsort(expected)
    seen, expected = seen[order], np.diff(expected[order])
    moved = _moved(sweep.at[seen, :, 0])
    usual, usual_expected = np.nanmedian(moved), np.nanmedian(expected)
    still = (np.abs(moved) < STILL * abs(usual)) & (expected > 0.5 * usual_expected)
    for k in np.flatnonzero(still)[:1]:
        raise InputError(
            f"{names[seen[k]]} and {names[seen[k + 1]]} show the laser in the same place, but their planes differ; was "
            "one photo doubled, and another lost?"
        )
    back = np.flatnonzero(moved < 0)
    if len(back) > max(2, len(moved) / 4):
        raise InputError(
            f"the photos are not in the order of their planes: in {len(back)} of {len(moved)} steps from plane to "
            f"plane the laser jumps back, first from {names[seen[back[0]]]} to {names[seen[back[0] + 1]]}; were they "
            "shuffled, or is this the calibration of another camera?"
        )
    if len(back):
        raise InputError(
            f"the laser jumps back from {names[seen[back[0]]]} to {names[seen[back[0] + 1]]}, though its planes move "
            "on; are these photos in the wrong order?"
        )


def _expected(sweep: Sweep, camera: Camera, planes: Floats, depth: float) -> Floats:
    """Where each plane would cross the middle row (column) of the photo on a wall at the usual depth, (frames,)."""
    rows, cols = camera.shape_rc
    along = np.linspace(0, cols - 1, 2) if sweep.along == "rows" else np.linspace(0, rows - 1, 2)
    middle = (rows - 1) / 2 if sweep.along == "rows" else (cols - 1) / 2
    xy = np.column_stack([along, [middle] * 2] if sweep.along == "rows" else [[middle] * 2, along])
    directions, eye = rays(camera, xy)
    wall = np.array([*camera.rotation[2], np.ravel(camera.translation)[2] - depth])
    near, far = meet_plane(eye, directions, wall)
    way = far - near
    share = -(planes[:, :3] @ near + planes[:, 3]) / (planes[:, :3] @ way)
    places = project(camera, near + share[:, None] * way)
    return np.asarray(places[:, 0 if sweep.along == "rows" else 1])


def _moved(at: Floats) -> Floats:
    """Median over the rows of how far the line moves between frames that follow each other; NaN without a row."""
    moved = np.full(len(at) - 1, np.nan)
    for k in range(len(moved)):
        step = at[k + 1] - at[k]
        step = step[np.isfinite(step)]
        if len(step):
            moved[k] = np.median(step)
    return moved
