"""The usual length of an edge: the unit in which a mesh is fine or coarse."""

from __future__ import annotations

import numpy as np

from planish.types import Floats

SAMPLE = 10_001
"""Edges that the median is taken of."""


def median_edge(edge_rest: Floats) -> float:
    """Median length [mm] of edges, of a sample where there are many."""
    return float(np.median(edge_rest[:: len(edge_rest) // SAMPLE + 1]))
