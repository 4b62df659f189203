"""Guards against division by zero, with their units: once for all rooms.

They catch quantities that are exactly or practically zero (coincident points, empty faces, blank images) and leave any
other result as it is. A threshold that decides something about a scan does not belong here, but beside the decision.
"""

from __future__ import annotations

import numpy as np

from planish.types import Floats

TINY = 1e-300
"""Of any unit: the least divisor where 0 / 0 shall give 0. No sum of squares of a scan comes near it."""
TINY_MM = 1e-9
"""[mm] Lengths below a picometre are 0. Scans are accurate to a micrometre at best."""
TINY_PX = 1e-9
"""[px] Distances on images below it are 0. Corners are found to 0.01 px at best."""
TINY_AREA_PX = 1e-12
"""[px^2] Triangles on an image with less than it, twice their area, cover no pixel."""
TINY_SHARE = 1e-12
"""[1] Weights and shares below it are 0: rounding of a sum of float64 values near 1 leaves 1e-16 for each of them."""
SINGULAR = 1e-12
"""[1] A matrix is singular where its determinant is less than this part of the product of its columns' sizes."""


def normalize(vectors: Floats) -> Floats:
    """Scale vectors along the last axis to length 1; those without length stay 0.

    Examples
    --------
    >>> normalize(np.array([[3.0, 4.0], [0.0, 0.0]]))
    array([[0.6, 0.8],
           [0. , 0. ]])
    """
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), TINY))
