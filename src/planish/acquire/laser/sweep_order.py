"""Check that the photos of a laser sweep are in the order of their planes."""

from __future__ import annotations

import numpy as np

from planish.acquire.laser.crossings import Sweep
from planish.errors import InputError
from planish.geometry import project
from planish.geometry.triangulation import meet_plane, rays
from planish.types import Camera, Floats

MIN_STEP = 0.05
"""Least relative step of a line between photos; below it they show the same position."""


def check_order(sweep: Sweep, camera: Camera, planes: Floats, inverse: Floats, names: list[str]) -> None:
    """Refuse shuffled or duplicated photos.

    On a visible surface the order of laser lines on the photo is the order of their planes, so from plane to plane the
    line must move in one direction.

    Parameters
    ----------
    sweep : Sweep
    camera : Camera
    planes : (frames, lines, 4) float64
    inverse : (frames, count, lines) float64 [1/mm]
        Inverse depths of the crossings.
    names : list of str

    Raises
    ------
    InputError
    """
    seen = np.flatnonzero(np.isfinite(sweep.at[..., 0]).any(axis=1))
    expected = _expected_positions(sweep, camera, planes[seen, 0], 1 / float(np.nanmedian(inverse)))
    seen, expected = seen[np.isfinite(expected)], expected[np.isfinite(expected)]
    order = np.argsort(expected)
    seen, expected = seen[order], np.diff(expected[order])
    steps = _median_steps(sweep.at[seen, :, 0])
    typical, typical_expected = np.nanmedian(steps), np.nanmedian(expected)
    unmoved = (np.abs(steps) < MIN_STEP * abs(typical)) & (expected > 0.5 * typical_expected)
    for k in np.flatnonzero(unmoved)[:1]:
        raise InputError(
            f"{names[seen[k]]} and {names[seen[k + 1]]} show the laser in the same place, but their planes differ; was "
            "one photo doubled, and another lost?"
        )
    backward = np.flatnonzero(steps < 0)
    if len(backward) > max(2, len(steps) / 4):
        raise InputError(
            f"the photos are not in the order of their planes: in {len(backward)} of {len(steps)} steps from plane to "
            f"plane the laser jumps back, first from {names[seen[backward[0]]]} to {names[seen[backward[0] + 1]]}; "
            "were they shuffled, or is this the calibration of another camera?"
        )
    if len(backward):
        raise InputError(
            f"the laser jumps back from {names[seen[backward[0]]]} to {names[seen[backward[0] + 1]]}, though its "
            "planes move on; are these photos in the wrong order?"
        )


def _expected_positions(sweep: Sweep, camera: Camera, planes: Floats, depth: float) -> Floats:
    """Expected crossing of each plane with the central row (column), on a wall at median depth: (frames,)."""
    rows, cols = camera.shape_rc
    along = np.linspace(0, cols - 1, 2) if sweep.along == "rows" else np.linspace(0, rows - 1, 2)
    middle = (rows - 1) / 2 if sweep.along == "rows" else (cols - 1) / 2
    xy = np.column_stack([along, [middle] * 2] if sweep.along == "rows" else [[middle] * 2, along])
    directions, eye = rays(camera, xy)
    wall = np.array([*camera.rotation[2], np.ravel(camera.translation)[2] - depth])
    near, far = meet_plane(eye, directions, wall)
    span = far - near
    share = -(planes[:, :3] @ near + planes[:, 3]) / (planes[:, :3] @ span)
    crossings = project(camera, near + share[:, None] * span)
    return np.asarray(crossings[:, 0 if sweep.along == "rows" else 1])


def _median_steps(at: Floats) -> Floats:
    """Median step of the line between consecutive frames; NaN without common rows."""
    steps = np.full(len(at) - 1, np.nan)
    for k in range(len(steps)):
        step = at[k + 1] - at[k]
        step = step[np.isfinite(step)]
        if len(step):
            steps[k] = np.median(step)
    return steps
