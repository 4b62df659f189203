"""The corners of a squared sheet on a photo, numbered: known places on paper that may be bent."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from planish.geometry.guards import TINY_SHARE
from planish.types import Floats, Pixels

LINE_PX = 7
"""Length of the averaging filter along printed lines."""

BACKGROUND_PX = 31
"""Side of the neighbourhood for the brightness of the paper."""

MIN_CONTRAST = 0.02
"""Least darkness of both lines at a corner, relative to the paper."""

TOLERANCE = 0.3
"""Largest distance of a corner from its predicted position, in squares."""

MIN_CORNERS = 60
"""Least corners of a lattice; smaller ones are print that resembles squares."""


class Squares(NamedTuple):
    """One lattice of squares.

    Attributes
    ----------
    ij : (n, 2) int
        Column and row of every corner in the lattice, from an arbitrary origin.
    xy : (n, 2) float64 [photo px]
    """

    ij: NDArray[np.int64]
    xy: Floats


def find_squares(photo: Pixels) -> list[Squares]:
    """Detect the lattices of squared sheets in a photo, from left to right.

    Corners are crossings of a dark horizontal and a dark vertical line; lattices grow from corner to corner, each step
    predicted by the previous one. The green channel is ignored because of laser light.

    Parameters
    ----------
    photo : (rows, cols, 3) uint8 or uint16
        Lines within 25 degrees of its rows and columns, squares of 8 pixels or more.

    Examples
    --------
    >>> photo = np.full((300, 400, 3), 220, np.uint8)
    >>> photo[20::20], photo[:, 20::20] = 90, 90
    >>> [squares] = find_squares(photo)
    >>> len(squares.xy), bool(np.allclose(squares.xy, 20 + 20 * (squares.ij - squares.ij.min(axis=0)), atol=0.05))
    (266, True)
    """
    corners = _corners(photo)
    found: list[Squares] = []
    unused = np.ones(len(corners), bool)
    while unused.sum() >= MIN_CORNERS:
        lattice = _grow_lattice(corners, unused)
        if lattice is None:
            break
        rows, ij = lattice
        unused[rows] = False
        if len(rows) >= MIN_CORNERS:
            found.append(Squares(ij, corners[rows]))
    return sorted(found, key=lambda squares: float(squares.xy[:, 0].mean()))


def _corners(photo: Pixels) -> Floats:
    """Line crossings (n, 2), the strongest first."""
    red_blue = (photo[..., 0].astype(np.float32) + photo[..., 2]) / 2
    paper = cv2.GaussianBlur(cv2.dilate(red_blue, np.ones((BACKGROUND_PX, BACKGROUND_PX))), (0, 0), BACKGROUND_PX / 2)
    dark = cv2.GaussianBlur(1 - red_blue / np.maximum(paper, 1), (0, 0), 0.8)
    across, down = (cv2.blur(dark, size) for size in ((LINE_PX, 1), (1, LINE_PX)))
    # a line is darker than what lies three pixels to either side of it
    ridge_across = across - np.maximum(np.roll(across, 3, axis=0), np.roll(across, -3, axis=0))
    ridge_down = down - np.maximum(np.roll(down, 3, axis=1), np.roll(down, -3, axis=1))
    response = cv2.GaussianBlur(np.minimum(ridge_across, ridge_down), (0, 0), 1.0)
    top = (response >= cv2.dilate(response, np.ones((5, 5)))) & (response > MIN_CONTRAST)
    top[:4], top[-4:], top[:, :4], top[:, -4:] = False, False, False, False
    rows, cols = np.nonzero(top)
    order = np.argsort(-response[rows, cols])
    rows, cols = rows[order], cols[order]
    position = np.column_stack([cols, rows]).astype(np.float64)
    for axis, (r, c) in enumerate(((0, 1), (1, 0))):  # vertex of a parabola through three pixels
        before, here, behind = response[rows - r, cols - c], response[rows, cols], response[rows + r, cols + c]
        curvature = np.minimum(before + behind - 2 * here, -TINY_SHARE)
        position[:, axis] += np.clip((before - behind) / (2 * curvature), -0.5, 0.5)
    return position


def _grow_lattice(corners: Floats, unused: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Grow a lattice from the strongest unused corner with four neighbours: corner indices and their (i, j)."""
    tree = cKDTree(corners)
    for seed in np.flatnonzero(unused):
        steps = _lattice_steps(corners, tree, int(seed))
        if steps is not None:
            return _walk_lattice(corners, unused, tree, int(seed), steps)
    return None


def _lattice_steps(corners: Floats, tree: cKDTree, seed: int) -> tuple[Floats, Floats] | None:
    """Lattice steps to the right and down at a corner, from its four neighbours; None if these are irregular."""
    _, near = tree.query(corners[seed], k=9)
    step_vector = corners[near[1:]] - corners[seed]
    steps = []
    for axis in (0, 1):
        straight = np.abs(step_vector[:, 1 - axis]) < 0.5 * np.abs(step_vector[:, axis])
        forward, backward = (
            step_vector[straight & (step_vector[:, axis] > 0)],
            step_vector[straight & (step_vector[:, axis] < 0)],
        )
        if not len(forward) or not len(backward):
            return None
        forward, backward = forward[0], backward[0]  # nearest first
        if np.linalg.norm(forward + backward) > TOLERANCE * np.linalg.norm(forward):
            return None
        steps.append((forward - backward) / 2)
    return steps[0], steps[1]


def _walk_lattice(
    corners: Floats, unused: NDArray[np.bool_], tree: cKDTree, seed: int, steps: tuple[Floats, Floats]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Breadth-first search from corner to corner; every corner keeps the steps that led to it."""
    position = {(0, 0): seed}
    visited = {seed}
    queue = [((0, 0), steps)]
    for (i, j), (right, down) in queue:  # grows while it is walked
        here = corners[position[i, j]]
        for di, dj, step in ((1, 0, right), (-1, 0, -right), (0, 1, down), (0, -1, -down)):
            there = (i + di, j + dj)
            if there in position:
                continue
            distance, k = tree.query(here + step)
            if distance > TOLERANCE * np.linalg.norm(step) or k in visited or not unused[k]:
                continue
            position[there] = int(k)
            visited.add(int(k))
            step_vector = (corners[k] - here) * (di + dj)
            queue.append((there, (step_vector, down) if di else (right, step_vector)))
    return np.array(list(position.values())), np.array(list(position.keys()))
