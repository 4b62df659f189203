"""Limited-memory BFGS with a preconditioner as the first guess of the Hessian."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.parallel import BLOCK, ParallelFor
from planish.types import Floats, Outcome

MEMORY = 4
"""Steps remembered; each costs two passes over all points a step. With 2 some sheets take twice the steps, with 6 or 8
none takes fewer."""

ARMIJO, SHORTEST = 1e-4, 1e-4
"""A step is halved until the energy falls by this part of what its slope promises, and no further than this."""

SPAN, LEVEL = 10, 1e-7
"""The sheet is at rest, too, when so many steps have lowered its energy by no more than this part. For a sheet whose
lengths are off by 1e-3 that is a bend of an arm by a thousandth of a millimetre."""

Objective = Callable[[Floats], tuple[float, Floats]]
Preconditioning = Callable[[Floats], Floats]
Float32s = NDArray[np.float32]
History = list[tuple[Float32s, Float32s, float]]
"""Step, change of the gradient, and their product, of the latest steps."""


def minimize(
    objective: Objective,
    xy: Floats,
    precondition: Preconditioning,
    *,
    max_steps: int,
    still_mm: float,
    parallel_for: ParallelFor,
    progress: Callable[[float], None] | None = None,
    level: float = LEVEL,
) -> tuple[Floats, Outcome, Floats]:
    """Minimize an energy of points in the plane.

    In the preconditioner's eyes the energy curves nearly alike in all directions, so the length of the step that is
    proposed next tells how far off the minimum is. Where it is short enough it is not even made.

    Parameters
    ----------
    objective : callable
        Places (n, 2) to the energy and its gradient (n, 2).
    xy : (n, 2) float64 [mm]
        A first layout.
    precondition : callable
        A force (n, 2) to the step (n, 2) that it asks for: symmetric and positive definite.
    max_steps : int
    still_mm : float
        At rest when the next step would move the points by no more than this, rms.
    parallel_for : callable
        See `planish.parallel`.
    progress : callable, optional
        Told the share of the way that is done, before each step.
    level : float
        Also at rest when the last SPAN steps have lowered the energy by no more than this part.

    Returns
    -------
    xy : (n, 2) float64 [mm]
    outcome : Outcome
        SETTLED, OUT_OF_STEPS, or DIVERGED where the energy, its gradient or a step is no finite number; then `xy` is
        the last place where they were.
    energies : (steps + 1,) float64
        Before and after each step.
    """
    history: History = []
    value, gradient = objective(xy)
    values, lengths = [value], []
    if not np.isfinite(value):
        return xy, Outcome.DIVERGED, np.array(values)
    outcome = Outcome.OUT_OF_STEPS
    while len(values) <= max_steps:
        step = _next_step(gradient, history, precondition, parallel_for)
        length = np.sqrt(_dot(step, step, parallel_for) / len(xy))
        if not np.isfinite(length):
            if history:
                history = []
                continue
            outcome = Outcome.DIVERGED
            break
        lengths.append(length)
        if length <= still_mm:
            outcome = Outcome.SETTLED
            break
        if progress is not None:
            progress(_share_done(lengths, still_mm))
        share, new_value, new_gradient = _search(objective, xy, value, gradient, step, parallel_for)
        if share == 0.0 and not history:  # nothing lower can be told apart: the minimum, to the last digit
            outcome = Outcome.SETTLED
            break
        if share == 0.0:
            history = []
            continue
        if len(values) > SPAN and values[-SPAN] - new_value <= level * new_value:
            outcome = Outcome.SETTLED
            break
        history = _remember(history, share * step, new_gradient - gradient, parallel_for)
        xy, value, gradient = xy + share * step, new_value, new_gradient
        values.append(value)
    return xy, outcome, np.array(values)


def _share_done(lengths: list[float], still: float) -> float:
    """Steps shorten by about the same factor each time."""
    return float(np.clip(np.log(lengths[0] / min(lengths)) / np.log(max(lengths[0] / still, 1.01)), 0.0, 1.0))


def _next_step(gradient: Floats, history: History, precondition: Preconditioning, parallel_for: ParallelFor) -> Floats:
    """The two loops of L-BFGS (Nocedal & Wright, Numerical Optimization, algorithm 7.4)."""
    q = -gradient
    alphas = []
    for taken, change, product in reversed(history):
        alphas.append(_dot(taken, q, parallel_for) / product)
        _add(q, -alphas[-1], change, parallel_for)
    r = precondition(q)
    for (taken, change, product), alpha in zip(history, reversed(alphas), strict=True):
        _add(r, alpha - _dot(change, r, parallel_for) / product, taken, parallel_for)
    return r


def _search(
    objective: Objective, xy: Floats, value: float, gradient: Floats, step: Floats, parallel_for: ParallelFor
) -> tuple[float, float, Floats]:
    """The greatest of 1, 1/2, 1/4 ... of a step that lowers the energy as its slope promises; 0 where none does."""
    slope = _dot(step, gradient, parallel_for)
    share = 1.0
    while share >= SHORTEST and slope < 0.0:
        new_value, new_gradient = objective(xy + share * step)
        if new_value <= value + ARMIJO * share * slope:
            return share, new_value, new_gradient
        share *= 0.5
    return 0.0, value, gradient


def _remember(history: History, taken: Floats, change: Floats, parallel_for: ParallelFor) -> History:
    product = _dot(taken, change, parallel_for)
    if not product > 0.0:
        return history
    return [*history[1 - MEMORY :], (taken.astype(np.float32), change.astype(np.float32), product)]


def _dot(a: Floats | Float32s, b: Floats | Float32s, parallel_for: ParallelFor) -> float:
    """Summed block by block, so that it does not depend on the number of threads."""
    parts = np.empty(len(a) // BLOCK + 1)
    parallel_for(_dot_block, len(a), a, b, parts)
    return float(parts[: -(-len(a) // BLOCK)].sum())


def _add(a: Floats, factor: float, b: Float32s, parallel_for: ParallelFor) -> None:
    parallel_for(_add_block, len(a), a, factor, b)


@njit(cache=True, nogil=True)
def _dot_block(first, last, a, b, parts):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(first, last):
        total += a[i, 0] * b[i, 0] + a[i, 1] * b[i, 1]
    parts[first // BLOCK] = total


@njit(cache=True, nogil=True)
def _add_block(first, last, a, factor, b):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        a[i, 0] += factor * b[i, 0]
        a[i, 1] += factor * b[i, 1]
