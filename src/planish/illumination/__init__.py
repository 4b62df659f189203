"""Shade taken off the page: the light found from the sheet's shape and divided out."""

from planish.illumination.remove_shading import EvenlyLit, ShadingFit, remove_shading

__all__ = ["EvenlyLit", "ShadingFit", "remove_shading"]
