"""Sticks: what keeps a sheet's lengths (edges) and resists its bending (pairs of triangles)."""

from planish.sticks.build import bending_pairs, make_sticks, unfolded_distance

__all__ = ["bending_pairs", "make_sticks", "unfolded_distance"]
