"""How a sheet comes down to the page: states of the paper's particle system, for the points that are shown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planish.flattening import settle
from planish.mesh import Coarse, Topology, area_vectors, onto_support_plane, prolongate, subsample, topology
from planish.settings import VerletSettings
from planish.sticks import make_sticks
from planish.types import Floats, Ints, Mesh, Outcome

SHOWN_POINTS = 20_000
"""Of a sheet in space: 1.7 mm apart on a letter, finer than a fold looks."""
FALLING_POINTS = 1500
"""That the particle system moves; the others are carried along. All sheets of the gallery settle with so many."""
MOST_STATES = 40
SLOWLY = VerletSettings(time_step=0.05, max_steps=1500)
"""With the paper's step of 0.1 a page is nearly down in seven steps, too few to look at. Half as long ones settle the
same sheets; shorter ones leave crumpled sheets arched (benchmarks/view_fall.py)."""
NEAREST = 0.01
"""States that are nearer to each other than this part of the whole way look alike: a sheet that lies flat creeps on for
many steps."""
ENOUGH = 200
"""Points to tell from how far a sheet has moved."""
RUNAWAY = 3.0
"""A state so many times as wide as the sheet was comes from a run that is about to diverge, and is not shown."""


@dataclass(frozen=True, eq=False)
class Settling:
    """A sheet on its way from the scan to the page.

    Attributes
    ----------
    states : (t, n, 3) float64 [mm]
        The sheet on its table (z up, the middle of the page at 0, the page's top towards +y) in every state. The last
        one is the page as it was restored; those before are the particle system's.
    faces : (m, 3) int32
    outcome : Outcome
        Of the particle system.
    heights : (t,) float64 [mm]
        Of the highest point of the particle system in every state; 0 on the page.
    steps : (t - 1,) int32
        That had been taken at each of its states.
    moved_points : int
        How many points the particle system moved.
    """

    states: Floats
    faces: Ints
    outcome: Outcome
    heights: Floats
    steps: Ints
    moved_points: int


def settling(mesh: Mesh, topo: Topology, page_xy: Floats, size_mm: tuple[float, float]) -> Settling:
    """Let a sheet fall by the paper's method, and tell how the points that are shown move on the way to the page.

    Parameters
    ----------
    mesh : Mesh
        Clean.
    topo : Topology
        Of `mesh`.
    page_xy : (n, 2) float64 [mm]
        Where its points came to lie.
    size_mm : (float, float)
        Width and height of the page.
    """
    shown = _thinned(mesh, topo, SHOWN_POINTS)
    sheet = shown.mesh
    page = (page_xy[_rows(shown, mesh.points)] - np.array(size_mm) / 2) * [1, -1]
    falling = _thinned(sheet, topology(sheet.faces, len(sheet.points)), FALLING_POINTS)
    history, outcome = _fallen(falling.mesh)
    kept = evenly_apart(history, MOST_STATES)
    states = _lying_on(history[kept].astype(np.float64), page[_rows(falling, sheet.points)])
    end = np.c_[page, np.zeros(len(page))]
    return Settling(
        np.concatenate([_carried(falling, sheet.points, states), end[None]]),
        sheet.faces,
        outcome,
        np.append(states[..., 2].max(axis=1), 0.0),
        kept.astype(np.int32),
        len(falling.mesh.points),
    )


def evenly_apart(history: NDArray[np.float32], most: int) -> NDArray[np.intp]:
    """Rows of at most so many states, the first and the last among them, each about as far from the one before.

    There may be fewer, where more would not be told apart.

    Parameters
    ----------
    history : (t, n, 3)
    most : int
        At least 3.

    Examples
    --------
    >>> falls = np.linspace(1, 0, 101, dtype=np.float32) ** 2
    >>> kept = evenly_apart(falls[:, None, None] * np.ones((1, 4, 3), np.float32), 5)
    >>> [f"{height:.1f}" for height in falls[kept]]
    ['1.0', '0.7', '0.5', '0.2', '0.0']
    """
    looked_at = history[:, :: max(1, history.shape[1] // ENOUGH)]
    high = float(_apart(looked_at[0], looked_at).max())
    low = NEAREST * high
    if len(_at_least_apart(looked_at, low)) <= most:
        return _at_least_apart(looked_at, low)
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (low, middle) if len(_at_least_apart(looked_at, middle)) <= most else (middle, high)
    return _at_least_apart(looked_at, high)


def _at_least_apart(history: NDArray[np.float32], distance: float) -> NDArray[np.intp]:
    kept, last = [0], len(history) - 1
    while True:
        far = np.flatnonzero(_apart(history[kept[-1]], history[kept[-1] + 1 :]) > distance)
        if not len(far):
            break
        kept.append(kept[-1] + 1 + int(far[0]))
    return np.array(kept if kept[-1] == last else [*kept, last])


def _apart(state: NDArray[np.float32], others: NDArray[np.float32]) -> NDArray[np.float32]:
    """Rms distance of the points of a state from those of others."""
    moved = others - state
    return np.asarray(np.sqrt(np.einsum("tnk,tnk->t", moved, moved) / len(state)))


def _thinned(mesh: Mesh, topo: Topology, count: int) -> Coarse:
    if len(mesh.points) <= count:
        return Coarse(mesh, np.arange(len(mesh.points), dtype=np.int32))
    return subsample(mesh, topo, count)


def _rows(coarse: Coarse, points: Floats) -> NDArray[np.intp]:
    """Rows of the coarse points among those that they were taken from."""
    same = np.flatnonzero((points == coarse.mesh.points[coarse.nearest]).all(axis=1))
    return same[np.unique(coarse.nearest[same], return_index=True)[1]]


def _fallen(mesh: Mesh) -> tuple[NDArray[np.float32], Outcome]:
    """Every state of a falling sheet (t, n, 3), and how it ended."""
    sticks = make_sticks(mesh, topology(mesh.faces, len(mesh.points)), "unfolded")
    history: list[NDArray[np.float32]] = []
    standing = Mesh(onto_support_plane(mesh)[0], mesh.faces)
    done = settle(standing, sticks, SLOWLY, watch=lambda points: history.append(points.astype(np.float32)))
    states = np.array(history)
    width = np.ptp(states, axis=1).max(axis=1)
    sane = np.isfinite(width) & (width < RUNAWAY * width[0])
    return states[: len(sane) if sane.all() else int(np.argmin(sane))], done.outcome


def _lying_on(states: Floats, page: Floats) -> Floats:
    """All states turned and shifted alike on the table, so that the last lies on the page as well as it can (Kabsch).

    Parameters
    ----------
    states : (t, k, 3) float64 [mm]
    page : (k, 2) float64 [mm]
    """
    lying = states[-1, :, :2]
    middle, target = lying.mean(axis=0), page.mean(axis=0)
    u, _, vt = np.linalg.svd((page - target).T @ (lying - middle))
    turn = u @ np.diag([1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return np.concatenate([(states[..., :2] - middle) @ turn.T + target, states[..., 2:]], axis=2)


def _carried(coarse: Coarse, points: Floats, states: Floats) -> Floats:
    """States (t, n, 3) of fine points from those of the coarse ones."""
    count, faces = len(states), coarse.mesh.faces
    upright = np.stack([area_vectors(state, faces) for state in states], axis=1)  # (m, t, 3)
    upright /= np.maximum(np.linalg.norm(upright, axis=2, keepdims=True), 1e-300)
    places = states.transpose(1, 0, 2).reshape(-1, 3 * count)
    carried = prolongate(coarse, points, places, upright.reshape(-1, 3 * count))
    return carried.reshape(-1, count, 3).transpose(1, 0, 2)
