"""Small sheets whose flat truth is known from geometry."""

import numpy as np


def grid(rows, cols, width=200.0, height=280.0):
    """Points (n, 2) in mm and faces (m, 3) of a rectangle, faces counter-clockwise seen from +z."""
    u, v = np.meshgrid(np.linspace(0, width, cols), np.linspace(0, height, rows))
    i = np.arange(rows * cols).reshape(rows, cols)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel()
    return np.c_[u.ravel(), v.ravel()], np.r_[np.c_[a, b, d], np.c_[a, d, c]].astype(np.int32)


def arch(uv, radius=60.0):
    """The sheet bent over a cylinder whose axis is the y axis; its long sides stand on the plane."""
    angle = (uv[:, 0] - uv[:, 0].mean()) / radius
    z = radius * np.cos(angle)
    return np.c_[radius * np.sin(angle), uv[:, 1], z - z.min()]


def rigid_rms(got, truth):
    """Root mean square distance in the plane after the best turn and shift, without scaling."""
    a, b = got - got.mean(0), truth - truth.mean(0)
    u, _, vt = np.linalg.svd(a.T @ b)
    turn = u @ np.diag([1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return np.sqrt(((a @ turn - b) ** 2).sum(1).mean())
