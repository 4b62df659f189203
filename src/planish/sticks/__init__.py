"""Sticks: what keeps a sheet's lengths (edges) and resists its bending (pairs of triangles)."""

from planish.sticks.build import bending_pairs, make_sticks, unfolded_distance
from planish.sticks.strain import strain

__all__ = [
    "bending_pairs",
    "make_sticks",
    "strain",
    "unfolded_distance",
]
