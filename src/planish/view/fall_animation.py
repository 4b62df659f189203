"""Animation of a sheet falling flat: states of the paper's Verlet particle system, interpolated to the shown points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planish.flattening import simulate_verlet
from planish.geometry.guards import normalize
from planish.geometry.rigid_fit import fit_rigid
from planish.mesh import Coarse, Topology, area_vectors, onto_support_plane, prolongate, subsample, topology
from planish.settings import VerletSettings
from planish.sticks import make_sticks
from planish.types import Floats, Ints, Mesh, Outcome

SHOWN_POINTS = 20_000
"""Points of the animated sheet: 1.7 mm apart on a letter-size page, finer than a fold."""
SIMULATED_POINTS = 1500
"""Points of the particle system; the others are interpolated. All sheets of the gallery settle with so many."""
MAX_STATES = 40
ANIMATION_SETTINGS = VerletSettings(time_step=0.05, max_steps=1500)
"""With the paper's time step of 0.1 a page is almost flat after seven steps, too few for an animation. Half the step
settles the same sheets; shorter ones leave crumpled sheets arched (benchmarks/view_fall.py)."""
MIN_SPACING = 0.01
"""Minimum distance of two keyframes, as a fraction of the largest distance from the first state; a flat sheet keeps
creeping for many steps that look alike."""
SAMPLED_POINTS = 200
"""Points from which the distance of two states is computed."""
MAX_WIDTH_RATIO = 3.0
"""A state wider than the initial sheet by this factor belongs to a diverging run and is not shown."""


@dataclass(frozen=True, eq=False)
class FallAnimation:
    """States of a sheet from the scan to the flat page.

    Attributes
    ----------
    states : (t, n, 3) float64 [mm]
        Points in every state, in the frame of the support plane: z up, page centre at the origin, page top at +y. The
        last state is the restored page, the earlier ones are those of the particle system.
    faces : (m, 3) int32
    outcome : Outcome
        Of the particle simulation.
    heights : (t,) float64 [mm]
        Height of the highest particle in every state; 0 for the page.
    steps : (t - 1,) int32
        Number of time steps taken at each simulated state.
    moved_points : int
        Number of simulated particles.
    """

    states: Floats
    faces: Ints
    outcome: Outcome
    heights: Floats
    steps: Ints
    moved_points: int


def simulate_fall(mesh: Mesh, topo: Topology, page_xy: Floats, size_mm: tuple[float, float]) -> FallAnimation:
    """Simulate a falling sheet by the paper's method, and interpolate its states to the shown points.

    Parameters
    ----------
    mesh : Mesh
        Repaired mesh.
    topo : Topology
        Of `mesh`.
    page_xy : (n, 2) float64 [mm]
        Flattened positions of its points.
    size_mm : (float, float)
        Width and height of the page.
    """
    shown = _decimated(mesh, topo, SHOWN_POINTS)
    sheet = shown.mesh
    page = (page_xy[_coarse_rows(shown, mesh.points)] - np.array(size_mm) / 2) * [1, -1]
    simulated = _decimated(sheet, topology(sheet.faces, len(sheet.points)), SIMULATED_POINTS)
    history, outcome = _simulate_verlet(simulated.mesh)
    kept = select_keyframes(history, MAX_STATES)
    states = _align_to_page(history[kept].astype(np.float64), page[_coarse_rows(simulated, sheet.points)])
    end = np.c_[page, np.zeros(len(page))]
    return FallAnimation(
        np.concatenate([_interpolate_states(simulated, sheet.points, states), end[None]]),
        sheet.faces,
        outcome,
        np.append(states[..., 2].max(axis=1), 0.0),
        kept.astype(np.int32),
        len(simulated.mesh.points),
    )


def select_keyframes(states: NDArray[np.float32], max_count: int) -> NDArray[np.intp]:
    """Select at most `max_count` states at about equal distances, including the first and the last.

    Fewer are returned if more could not be distinguished (`MIN_SPACING`).

    Parameters
    ----------
    states : (t, n, 3)
    max_count : int
        At least 3.

    Examples
    --------
    >>> falls = np.linspace(1, 0, 101, dtype=np.float32) ** 2
    >>> kept = select_keyframes(falls[:, None, None] * np.ones((1, 4, 3), np.float32), 5)
    >>> [f"{height:.1f}" for height in falls[kept]]
    ['1.0', '0.7', '0.5', '0.2', '0.0']
    """
    sampled = states[:, :: max(1, states.shape[1] // SAMPLED_POINTS)]
    high = float(_rms_distances(sampled[0], sampled).max())
    low = MIN_SPACING * high
    if len(_spaced_frames(sampled, low)) <= max_count:
        return _spaced_frames(sampled, low)
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (low, middle) if len(_spaced_frames(sampled, middle)) <= max_count else (middle, high)
    return _spaced_frames(sampled, high)


def _spaced_frames(states: NDArray[np.float32], distance: float) -> NDArray[np.intp]:
    kept, last = [0], len(states) - 1
    while True:
        far = np.flatnonzero(_rms_distances(states[kept[-1]], states[kept[-1] + 1 :]) > distance)
        if not len(far):
            break
        kept.append(kept[-1] + 1 + int(far[0]))
    return np.array(kept if kept[-1] == last else [*kept, last])


def _rms_distances(state: NDArray[np.float32], others: NDArray[np.float32]) -> NDArray[np.float32]:
    """RMS point distances of a state to others."""
    moved = others - state
    return np.asarray(np.sqrt(np.einsum("tnk,tnk->t", moved, moved) / len(state)))


def _decimated(mesh: Mesh, topo: Topology, count: int) -> Coarse:
    if len(mesh.points) <= count:
        return Coarse(mesh, np.arange(len(mesh.points), dtype=np.int32))
    return subsample(mesh, topo, count)


def _coarse_rows(coarse: Coarse, points: Floats) -> NDArray[np.intp]:
    """Indices of the coarse points among the fine points."""
    same = np.flatnonzero((points == coarse.mesh.points[coarse.nearest]).all(axis=1))
    return same[np.unique(coarse.nearest[same], return_index=True)[1]]


def _simulate_verlet(mesh: Mesh) -> tuple[NDArray[np.float32], Outcome]:
    """Simulate a falling sheet: all states (t, n, 3), and the outcome."""
    sticks = make_sticks(mesh, topology(mesh.faces, len(mesh.points)), "unfolded")
    history: list[NDArray[np.float32]] = []
    standing = Mesh.owned(onto_support_plane(mesh)[0], mesh.faces)
    result = simulate_verlet(
        standing, sticks, ANIMATION_SETTINGS, watch=lambda points: history.append(points.astype(np.float32))
    )
    states = np.array(history)
    width = np.ptp(states, axis=1).max(axis=1)
    sane = np.isfinite(width) & (width < MAX_WIDTH_RATIO * width[0])
    return states[: len(sane) if sane.all() else int(np.argmin(sane))], result.outcome


def _align_to_page(states: Floats, page: Floats) -> Floats:
    """Apply one rigid motion in the plane to all states that fits the last one to the page.

    Parameters
    ----------
    states : (t, k, 3) float64 [mm]
    page : (k, 2) float64 [mm]
    """
    rotation, shift = fit_rigid(states[-1, :, :2], page)
    return np.concatenate([states[..., :2] @ rotation.T + shift, states[..., 2:]], axis=2)


def _interpolate_states(coarse: Coarse, points: Floats, states: Floats) -> Floats:
    """Interpolate states of the coarse points to the fine points (t, n, 3)."""
    count, faces = len(states), coarse.mesh.faces
    upright = normalize(np.stack([area_vectors(state, faces) for state in states], axis=1))  # (m, t, 3)
    places = states.transpose(1, 0, 2).reshape(-1, 3 * count)
    carried = prolongate(coarse, points, places, upright.reshape(-1, 3 * count))
    return carried.reshape(-1, count, 3).transpose(1, 0, 2)
