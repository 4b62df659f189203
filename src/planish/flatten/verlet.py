"""The paper's particle system: gravity, Verlet integration, sticks and plane made good in turn.

Kernels work in units of the median stick, so that the same sheet given in other units, or scanned more finely,
falls by the same rules.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

from planish.settings import VerletSettings
from planish.types import Floats, Ints, Outcome, Sticks

WINDOW = 50
"""Steps a call of the kernel: a fraction of a second, so that Ctrl-C and progress get their turn."""


def settle(
    points: Floats,
    sticks: Sticks,
    settings: VerletSettings | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Floats, Outcome, int, Floats, Floats]:
    """Let a sheet fall on the plane z = 0 and come to rest there.

    Parameters
    ----------
    points : (n, 3) float64 [mm]
        The sheet above the plane, z >= 0.
    sticks : Sticks
    settings : VerletSettings, optional
    progress : callable, optional
        Told the share of the steps that are done, now and then.

    Returns
    -------
    points : (n, 3) float64 [mm]
    outcome : Outcome
    steps : int
    residuals : (steps,) float64
        Root mean square relative error of the sticks after each step.
    heights : (steps,) float64 [mm]
        Greatest height above the plane after each step.
    """
    s = settings or VerletSettings()
    unit = float(np.median(sticks.rest)) or 1.0
    x = points / unit
    before = x.copy()  # eq. (7): the sheet starts at rest
    rest = sticks.rest / unit
    order = _shuffled(len(rest))
    pairs, rest, weight = sticks.pairs[order], rest[order], sticks.weight[order]
    residuals, heights = np.empty(s.max_steps), np.empty(s.max_steps)
    done = 0
    outcome = Outcome.OUT_OF_STEPS
    while done < s.max_steps:
        block = min(WINDOW, s.max_steps - done)
        span = slice(done, done + block)
        kept = x.copy()
        _steps(x, before, pairs, rest, weight, s.time_step, s.gravity, s.rounds, residuals[span], heights[span])
        done += block
        if progress is not None:
            progress(done / s.max_steps)
        if not np.isfinite(residuals[done - 1]) or residuals[done - 1] > 1e3:
            x, outcome = kept, Outcome.DIVERGED
            break
        now, then = residuals[done - 1], residuals[done - block]
        if abs(then - now) <= s.tolerance * now or now < 1e-9:
            if heights[done - 1] == 0.0:
                outcome = Outcome.SETTLED
                break
            if heights[done - block] - heights[done - 1] <= s.tolerance * heights[done - 1]:
                outcome = Outcome.STALLED
                break
    return x * unit, outcome, done, residuals[:done].copy(), heights[:done] * unit


def _shuffled(count: int) -> Ints:
    """Order in which sticks are visited: shuffled once, so that no side of the sheet comes first."""
    return np.random.default_rng(20050829).permutation(count).astype(np.int32)


@njit(cache=True)
def _steps(x, before, pairs, rest, weight, dt, gravity, rounds, residuals, heights):  # type: ignore[no-untyped-def]
    for step in range(len(residuals)):
        fall(x, before, dt, gravity)
        for turn in range(rounds):
            residuals[step] = relax(x, pairs, rest, weight, turn % 2 == 1)
            heights[step] = project(x)


@njit(cache=True)
def fall(x, before, dt, gravity):  # type: ignore[no-untyped-def]
    """One step of time: x' = 2x - xp + a dt^2 (6), xp = x (7), with a = f/m = g (2) towards the plane."""
    for i in range(len(x)):
        for k in range(3):
            now = x[i, k]
            x[i, k] = 2.0 * now - before[i, k]  # (6)
            before[i, k] = now  # (7)
        x[i, 2] -= gravity * dt * dt  # (2) and (6)


@njit(cache=True)
def relax(x, pairs, rest, weight, backwards):  # type: ignore[no-untyped-def]
    """One round over the sticks, each brought to its length by moving both ends alike (1).

    Returns the root mean square of the relative errors as they were met. Every other round runs backwards, which
    undoes what little drift the order causes.
    """
    total = 0.0
    count = len(pairs)
    for at in range(count):
        s = count - 1 - at if backwards else at
        i, j = pairs[s, 0], pairs[s, 1]
        dx, dy, dz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        if length <= 0.0 or rest[s] <= 0.0:
            continue
        error = (length - rest[s]) / length
        total += (error * length / rest[s]) ** 2
        half = 0.5 * weight[s] * error
        x[i, 0] += half * dx
        x[i, 1] += half * dy
        x[i, 2] += half * dz
        x[j, 0] -= half * dx
        x[j, 1] -= half * dy
        x[j, 2] -= half * dz
    return np.sqrt(total / max(count, 1))


@njit(cache=True)
def project(x):  # type: ignore[no-untyped-def]
    """Put what fell below the plane back on it: z' = max(z, 0) (3). Returns the greatest height left."""
    highest = 0.0
    for i in range(len(x)):
        x[i, 2] = max(x[i, 2], 0.0)
        highest = max(highest, x[i, 2])
    return highest
