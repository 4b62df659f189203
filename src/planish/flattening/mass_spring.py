"""Brown & Seales' particle system: masses on a quad mesh, joined by springs, moved by explicit Euler steps.

The kernels work in units of the median spring, as those of the paper's own method do.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit

from planish.flattening.solution import Solution
from planish.flattening.verlet import CRUSHED
from planish.settings import MassSpringSettings
from planish.types import Mesh, Outcome, Sticks

WINDOW = 50
"""Steps a call of the kernel: milliseconds, so that Ctrl-C and progress get their turn."""
BURST = 10.0
"""A net whose springs are off by so many times their length, rms, has burst."""
LEVEL = 1e-3
"""Median springs above the plane that count as on it."""


def simulate_mass_spring(
    mesh: Mesh,
    springs: Sticks,
    settings: MassSpringSettings | None = None,
    progress: Callable[[float], None] | None = None,
) -> Solution:
    """Drop a net of masses and springs on the plane z = 0 and let it come to rest there.

    Parameters
    ----------
    mesh : Mesh
        The net above the plane, z >= 0.
    springs : Sticks
        All of one stiffness.
    settings : MassSpringSettings, optional
    progress : callable, optional
        Told the share of the steps that are done, now and then.
    """
    s = settings or MassSpringSettings()
    unit = float(np.median(springs.rest)) or 1.0
    x, v = mesh.points / unit, np.zeros_like(mesh.points)
    force = np.empty_like(x)
    net = springs.pairs, springs.rest / unit, s.stiffness, s.damping * np.sqrt(s.stiffness * s.mass)
    law = s.mass, s.time_step, s.gravity, s.drag, s.restitution
    residuals, heights, speeds = (np.empty(s.max_steps) for _ in range(3))
    done, outcome = 0, Outcome.OUT_OF_STEPS
    while done < s.max_steps:
        span = slice(done, min(done + WINDOW, s.max_steps))
        kept = x.copy()
        _steps(x, v, force, *net, *law, residuals[span], heights[span], speeds[span])
        done = span.stop
        if progress is not None:
            progress(done / s.max_steps)
        if not (residuals[done - 1] < BURST and np.isfinite(speeds[done - 1])):
            x, outcome = kept, Outcome.DIVERGED
            break
        if speeds[span].max() < s.tolerance:
            outcome = _come_to(residuals[done - 1], heights[done - 1])
            break
    return Solution(x * unit, outcome, done, residuals[:done].copy(), heights[:done] * unit)


def _come_to(residual: float, height: float) -> Outcome:
    """Where a net is that has stopped moving."""
    if height > LEVEL:
        return Outcome.STALLED
    return Outcome.SETTLED if residual < CRUSHED else Outcome.CRUSHED


@njit(cache=True)
def _steps(  # type: ignore[no-untyped-def]
    x, v, force, pairs, rest, stiffness, damping, mass, dt, gravity, drag, restitution, residuals, heights, speeds
):
    for step in range(len(residuals)):
        residuals[step] = pull(x, v, pairs, rest, stiffness, damping, force)
        weigh(v, mass, gravity, drag, force)
        heights[step], speeds[step] = move(x, v, force, mass, dt, restitution)


@njit(cache=True)
def pull(x, v, pairs, rest, stiffness, damping, force):  # type: ignore[no-untyped-def]
    """Forces of damped springs, f = (k (l - r) + d l') along each, on its two ends.

    Returns the root mean square of the relative errors of their lengths.
    """
    force[:] = 0.0
    total = 0.0
    for s in range(len(pairs)):
        i, j = pairs[s, 0], pairs[s, 1]
        ux, uy, uz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        length = np.sqrt(ux * ux + uy * uy + uz * uz)
        if length <= 0.0 or rest[s] <= 0.0:
            continue
        ux, uy, uz = ux / length, uy / length, uz / length
        rate = (v[j, 0] - v[i, 0]) * ux + (v[j, 1] - v[i, 1]) * uy + (v[j, 2] - v[i, 2]) * uz
        total += (length / rest[s] - 1.0) ** 2
        f = stiffness * (length - rest[s]) + damping * rate
        force[i, 0] += f * ux
        force[i, 1] += f * uy
        force[i, 2] += f * uz
        force[j, 0] -= f * ux
        force[j, 1] -= f * uy
        force[j, 2] -= f * uz
    return np.sqrt(total / max(len(pairs), 1))


@njit(cache=True)
def weigh(v, mass, gravity, drag, force):  # type: ignore[no-untyped-def]
    """Add gravity towards the plane (2) and the drag of the air, f = m g - m c v."""
    for i in range(len(v)):
        for k in range(3):
            force[i, k] -= mass * drag * v[i, k]
        force[i, 2] -= mass * gravity


@njit(cache=True)
def move(x, v, force, mass, dt, restitution):  # type: ignore[no-untyped-def]
    """One explicit step, x' = x + v dt (4) and v' = v + f / m dt (5), with the plane z = 0 in the way.

    A mass that falls through the plane is taken back to the time of its contact, and goes the rest of the step with
    the part `restitution` of its speed, upwards; one that got all its speed in the last steps rests.
    Returns the greatest height above the plane and the root mean square speed.
    """
    highest, total = 0.0, 0.0
    for i in range(len(x)):
        before, fall = x[i, 2], v[i, 2]
        for k in range(3):
            x[i, k] += v[i, k] * dt  # (4)
            v[i, k] += force[i, k] / mass * dt  # (5)
        if x[i, 2] < 0.0:
            left = 1.0 - before / (before - x[i, 2])  # share of the step after the contact
            rests = -fall <= 2.0 * abs(force[i, 2]) / mass * dt
            bounce = 0.0 if rests else -restitution * fall
            x[i, 2] = left * dt * bounce
            v[i, 2] = bounce + left * force[i, 2] / mass * dt
        if x[i, 2] == 0.0:
            v[i, 2] = max(v[i, 2], 0.0)  # the plane carries it
        highest = max(highest, x[i, 2])
        total += v[i, 0] ** 2 + v[i, 1] ** 2 + v[i, 2] ** 2
    return highest, np.sqrt(total / max(len(x), 1))
