"""The paper's particle system: gravity, Verlet integration, sticks and plane made good in turn.

Kernels work in units of the median stick, so that the same sheet given in other units, or scanned more finely,
falls by the same rules.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

from planish.flattening.collide import keep_apart, mark_passed, near_pairs, slow_down
from planish.flattening.solution import Solution
from planish.mesh import neighbours
from planish.settings import VerletSettings
from planish.types import Floats, Ints, Mesh, Outcome, Sticks

WINDOW = 50
"""Steps a call of the kernel: a fraction of a second, so that Ctrl-C and progress get their turn."""
CRUSHED = 0.05
"""Sticks at rest with a greater rms error do not belong to a sheet that lies flat: paper does not stretch so far, and
the most ragged real scan here (301 points by hand-held depth camera) ends at 0.02."""
EASING_ROUNDS = 400
"""Of a settled sheet, with corrections that are halved after `EASING_START` rounds. Renumbering the points of a sheet
that is not quite developable then moves them by 0.007 mm (100 rounds: 0.011; none: 0.096) at the cost of 20 steps."""
EASING_START = 10
HEAVIEST = 16
"""Gravity is doubled where a sheet stalls arched, up to so many times the asked one. Four times brings down all
sheets of the gallery that stall (a spread, a crumpled sheet), with the same error as those that need none."""


def simulate_verlet(
    mesh: Mesh,
    sticks: Sticks,
    settings: VerletSettings | None = None,
    progress: Callable[[float], None] | None = None,
    watch: Callable[[Floats], None] | None = None,
) -> Solution:
    """Let a sheet fall on the plane z = 0 and come to rest there.

    Parameters
    ----------
    mesh : Mesh
        The sheet above the plane, z >= 0.
    sticks : Sticks
    settings : VerletSettings, optional
    progress : callable, optional
        Told the share of the steps that are done, now and then.
    watch : callable, optional
        Shown the points (n, 3) [mm] before the first step, after each, and at rest. Nothing else changes by it.
    """
    s = settings or VerletSettings()
    unit = float(np.median(sticks.rest)) or 1.0
    x = mesh.points / unit
    before = x.copy()  # eq. (7): the sheet starts at rest
    order = shuffled(len(sticks.rest))
    bound = sticks.pairs[order], sticks.rest[order] / unit, sticks.weight[order]
    layers = mesh.faces, *neighbours(sticks.pairs[: sticks.edges], len(x))
    thickness = s.thickness_mm / unit if s.self_collision else 0.0
    passed = np.zeros(len(x), bool)
    residuals, heights = np.empty(s.max_steps), np.empty(s.max_steps)
    done, gravity = 0, s.gravity
    show = (lambda: watch(x * unit)) if watch else (lambda: None)
    show()
    outcome = Outcome.OUT_OF_STEPS
    while done < s.max_steps:
        block = min(WINDOW, s.max_steps - done)
        span = slice(done, done + block)
        kept = x.copy()
        law = s.time_step, gravity, s.rounds, thickness
        for part in [slice(k, k + 1) for k in range(done, done + block)] if watch else [span]:
            _steps(x, before, *bound, *layers, *law, passed, residuals[part], heights[part])
            show()
        done += block
        if progress is not None:
            progress(done / s.max_steps)
        if not np.isfinite(residuals[done - 1]) or residuals[done - 1] > 1e3:
            x, outcome = kept, Outcome.DIVERGED
            break
        found = at_rest(residuals[span], heights[span], s.tolerance)
        if found is Outcome.STALLED and gravity < HEAVIEST * s.gravity:
            gravity *= 2
        elif found is not None:
            outcome = found
            if found is Outcome.SETTLED:
                residuals[done - 1] = _ease(x, *bound)
                show()
            break
    return Solution(x * unit, outcome, done, residuals[:done].copy(), heights[:done] * unit, passed)


def at_rest(residuals: Floats, heights: Floats, tolerance: float) -> Outcome | None:
    """Whether the sheet has come to rest over the last steps, and where."""
    now, then = residuals[-1], residuals[0]
    if abs(then - now) > tolerance * now and now >= 1e-9:
        return None
    if heights[-1] == 0.0:
        return Outcome.SETTLED if now < CRUSHED else Outcome.CRUSHED
    return Outcome.STALLED if heights[0] - heights[-1] <= tolerance * heights[-1] else None


def shuffled(count: int) -> Ints:
    """Order in which sticks are visited: shuffled once, so that no side of the sheet comes first."""
    return np.random.default_rng(20050829).permutation(count).astype(np.int32)


@njit(cache=True)
def _steps(  # type: ignore[no-untyped-def]
    x, before, pairs, rest, weight, faces, start, around, dt, gravity, rounds, thickness, passed, residuals, heights
):
    for step in range(len(residuals)):
        watched, side = near_pairs(x, faces, start, around)
        fall(x, before, dt, gravity)
        if thickness > 0.0:
            slow_down(x, before)
        for turn in range(rounds):
            residuals[step] = satisfy_constraints(x, pairs, rest, weight, turn % 2 == 1)
            if thickness > 0.0:
                keep_apart(x, faces, watched, side, thickness)
            heights[step] = project(x)
        mark_passed(x, faces, watched, side, passed)


@njit(cache=True)
def _ease(x, pairs, rest, weight):  # type: ignore[no-untyped-def]
    """Let go of a settled sheet slowly: rounds over the sticks with ever smaller corrections.

    Where sticks contradict each other, full corrections end where the last stick visited wants it. Corrections that
    die away as 1 / round end at the least sum of squares over all sticks, whatever the order (Robbins & Monro 1951).
    """
    slack = np.empty_like(weight)
    residual = 0.0
    for turn in range(EASING_ROUNDS):
        slack[:] = weight / (1.0 + turn / EASING_START)
        residual = satisfy_constraints(x, pairs, rest, slack, turn % 2 == 1)
    return residual


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
def satisfy_constraints(x, pairs, rest, weight, backwards):  # type: ignore[no-untyped-def]
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
