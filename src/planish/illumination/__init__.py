"""Shade taken off the page: the light found from the sheet's shape and divided out."""

from planish.illumination.remove_shading import ShadingFit, Unshaded, unshade

__all__ = ["ShadingFit", "Unshaded", "unshade"]
