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
