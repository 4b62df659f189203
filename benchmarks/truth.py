"""Comparing a flat sheet with the true one."""

import numpy as np


def rigid_rms(page_xy: np.ndarray, truth_xy: np.ndarray) -> float:
    """Root mean square distance [mm] after the best turn, shift and, if need be, mirroring; never a scaling."""
    a, b = page_xy - page_xy.mean(0), truth_xy - truth_xy.mean(0)
    best = np.inf
    for mirror in (1, -1):
        u, _, vt = np.linalg.svd((a * [1, mirror]).T @ b)
        turn = u @ np.diag([1, np.sign(np.linalg.det(u @ vt))]) @ vt
        best = min(best, float(np.sqrt((((a * [1, mirror]) @ turn - b) ** 2).sum(1).mean())))
    return best
