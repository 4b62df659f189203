"""Sticks: what keeps a sheet's lengths (edges) and resists its bending (pairs of triangles)."""

from planish.sticks.build import bending_pairs, make_sticks, unfolded_distance
from planish.sticks.smooth import Smoothing, SmoothLengths, smooth_lengths, smooth_normals
from planish.sticks.strain import distances, strain

__all__ = [
    "SmoothLengths",
    "Smoothing",
    "bending_pairs",
    "distances",
    "make_sticks",
    "smooth_lengths",
    "smooth_normals",
    "strain",
    "unfolded_distance",
]
