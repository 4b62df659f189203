"""Slow, obvious versions of the kernels, written from the paper's formulas; the fast ones must agree with these."""

import numpy as np


def edges_of(faces):
    """Sorted unique edges, and for each the list of its faces."""
    found = {}
    for f, face in enumerate(faces):
        for k in range(3):
            edge = tuple(sorted((int(face[k]), int(face[(k + 1) % 3]))))
            found.setdefault(edge, []).append(f)
    return dict(sorted(found.items()))


def verlet_step(x, before, pairs, rest, dt, gravity, rounds):
    """One step of the paper: eq. (6), (7), then sticks (1) and plane (3) in turn; every other round backwards."""
    after = 2 * x - before + np.array([0, 0, -gravity]) * dt**2
    before = x
    x = after
    for turn in range(rounds):
        order = range(len(pairs)) if turn % 2 == 0 else reversed(range(len(pairs)))
        for s in order:
            i, j = pairs[s]
            arm = x[j] - x[i]
            length = np.linalg.norm(arm)
            correction = 0.5 * (length - rest[s]) / length * arm
            x[i] = x[i] + correction
            x[j] = x[j] - correction
        x[:, 2] = np.maximum(x[:, 2], 0)
    return x, before


def euler_step(x, v, pairs, rest, settings):
    """One explicit step of masses on springs above the plane: eq. (2), (4), (5), in plain words."""
    s = settings
    force = s.mass * (np.array([0, 0, -s.gravity]) - s.drag * v)
    for (i, j), r in zip(pairs, rest, strict=True):
        arm = x[j] - x[i]
        length = np.linalg.norm(arm)
        along = arm / length
        pull = s.stiffness * (length - r) + s.damping * (v[j] - v[i]) @ along
        force[i] += pull * along
        force[j] -= pull * along
    after = x + v * s.time_step
    faster = v + force / s.mass * s.time_step
    for i in np.flatnonzero(after[:, 2] < 0):
        since = after[i, 2] / v[i, 2]  # the contact
        built_up = abs(force[i, 2]) / s.mass * s.time_step
        up = 0.0 if -v[i, 2] <= 2 * built_up else -s.restitution * v[i, 2]
        after[i, 2] = since * up
        faster[i, 2] = up + force[i, 2] / s.mass * since
    faster[(after[:, 2] == 0) & (faster[:, 2] < 0), 2] = 0
    return after, faster
