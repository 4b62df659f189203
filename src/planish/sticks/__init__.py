"""Sticks: what keeps a sheet's lengths (edges) and resists its bending (pairs of triangles)."""

from planish.sticks.build import bending_pairs, make_sticks, unfolded_distance
from planish.sticks.distortion import face_distortion, face_strain
from planish.sticks.strain import strain
from planish.sticks.stretch import stretch, stretch_over_lengths

__all__ = [
    "bending_pairs",
    "face_distortion",
    "face_strain",
    "make_sticks",
    "strain",
    "stretch",
    "stretch_over_lengths",
    "unfolded_distance",
]
