"""The photo drawn through the flattened mesh, at true size."""

from planish.render.draw import Rendered, draw, preview
from planish.render.missing import Missing, mask_of, missing_parts
from planish.render.resolution import Resolution

__all__ = [
    "Missing",
    "Rendered",
    "Resolution",
    "draw",
    "mask_of",
    "missing_parts",
    "preview",
]
