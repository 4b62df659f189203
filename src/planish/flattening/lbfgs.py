"""Limited-memory BFGS on the energy of the sticks, with a preconditioner for its first guess of the Hessian."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.flattening.energy import Net, energy
from planish.flattening.multigrid_preconditioner import Preconditioner, precondition
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

Float32s = NDArray[np.float32]
History = list[tuple[Float32s, Float32s, float]]
"""Step, change of the gradient, and their product, of the latest steps."""


def minimise(
    net: Net,
    xy: Floats,
    preconditioner: Preconditioner,
    *,
    max_steps: int,
    still_mm: float,
    parallel_for: ParallelFor,
    progress: Callable[[float], None] | None = None,
) -> tuple[Floats, Outcome, Floats]:
    """Bring sticks to rest.

    In the preconditioner's eyes the energy curves nearly alike in all directions, so the length of the step that is
    proposed next tells how far off the minimum is. Where it is short enough it is not even made.

    Parameters
    ----------
    net : Net
    xy : (n, 2) float64 [mm]
        A first layout.
    preconditioner : Preconditioner
    max_steps : int
    still_mm : float
        The sheet is at rest when the next step would move its points by no more than this, rms.
    parallel_for : Crew
    progress : callable, optional
        Told the share of the way that is done, before each step.

    Returns
    -------
    xy : (n, 2) float64 [mm]
    outcome : Outcome
        SETTLED or OUT_OF_STEPS.
    residuals : (steps + 1,) float64
        Root mean square relative error of the sticks, weighted by their lengths squared, before and after each step.
    """
    history: History = []
    value, gradient = energy(net, xy, parallel_for)
    values, lengths = [value], []
    outcome = Outcome.OUT_OF_STEPS
    while len(values) <= max_steps:
        step = _next_step(gradient, history, preconditioner, parallel_for)
        lengths.append(np.sqrt(_dot(step, step, parallel_for) / len(xy)))
        if not lengths[-1] > still_mm:
            outcome = Outcome.SETTLED
            break
        if progress is not None:
            progress(_share_done(lengths, still_mm))
        share, new_value, new_gradient = _search(net, xy, value, gradient, step, parallel_for)
        if share == 0.0 and not history:  # nothing lower can be told apart: the minimum, to the last digit
            outcome = Outcome.SETTLED
            break
        if share == 0.0:
            history = []
            continue
        if len(values) > SPAN and values[-SPAN] - new_value <= LEVEL * new_value:
            outcome = Outcome.SETTLED
            break
        history = _remember(history, share * step, new_gradient - gradient, parallel_for)
        xy, value, gradient = xy + share * step, new_value, new_gradient
        values.append(value)
    square = max(float(np.sum(net.weight * net.rest * net.rest)), 1e-300)
    return xy, outcome, np.sqrt(2 * np.array(values) / square)


def _share_done(lengths: list[float], still: float) -> float:
    """Steps shorten by about the same factor each time."""
    return float(np.clip(np.log(lengths[0] / min(lengths)) / np.log(max(lengths[0] / still, 1.01)), 0.0, 1.0))


def _next_step(gradient: Floats, history: History, preconditioner: Preconditioner, parallel_for: ParallelFor) -> Floats:
    """The two loops of L-BFGS (Nocedal & Wright, Numerical Optimization, algorithm 7.4)."""
    q = -gradient
    alphas = []
    for taken, change, product in reversed(history):
        alphas.append(_dot(taken, q, parallel_for) / product)
        _add(q, -alphas[-1], change, parallel_for)
    r = precondition(preconditioner, q, parallel_for)
    for (taken, change, product), alpha in zip(history, reversed(alphas), strict=True):
        _add(r, alpha - _dot(change, r, parallel_for) / product, taken, parallel_for)
    return r


def _search(
    net: Net, xy: Floats, value: float, gradient: Floats, step: Floats, parallel_for: ParallelFor
) -> tuple[float, float, Floats]:
    """The greatest of 1, 1/2, 1/4 ... of a step that lowers the energy as its slope promises; 0 where none does."""
    slope = _dot(step, gradient, parallel_for)
    share = 1.0
    while share >= SHORTEST and slope < 0.0:
        new_value, new_gradient = energy(net, xy + share * step, parallel_for)
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
