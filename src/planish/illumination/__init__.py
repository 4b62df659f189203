"""Illumination: the light on the sheet, estimated from its shape and divided out."""

from planish.illumination.remove_shading import EvenlyLit, ShadingFit, remove_shading

__all__ = ["EvenlyLit", "ShadingFit", "remove_shading"]
