"""Small systems of linear equations inside kernels, where LAPACK costs more to compile and to call than it saves."""

from __future__ import annotations

from numba import njit

from planish.geometry.guards import TINY


@njit(cache=True, nogil=True, error_model="numpy")
def solve_symmetric(matrix):  # type: ignore[no-untyped-def]
    """Solve a positive definite system in place.

    Parameters
    ----------
    matrix : (n, n + d) float64
        Its upper half with the d right sides beside it, which become the solutions; the rest is scratch. Diagonals
        grow by a 10^-9 part, so that a singular system has a finite solution.

    Examples
    --------
    >>> import numpy as np
    >>> system = np.array([[2.0, 1, 5], [0, 3, 10]])
    >>> solve_symmetric(system)
    >>> system[:, 2].round(6).tolist()
    [1.0, 3.0]
    """
    n, width = matrix.shape
    for x in range(n):
        matrix[x, x] += 1e-9 * (matrix[0, 0] + matrix[x, x]) + TINY
        for y in range(x):
            matrix[x, y] = matrix[y, x]
    for x in range(n):
        for y in range(n):
            if y != x:
                factor = matrix[y, x] / matrix[x, x]
                for c in range(x, width):
                    matrix[y, c] -= factor * matrix[x, c]
    for x in range(n):
        for c in range(n, width):
            matrix[x, c] /= matrix[x, x]
