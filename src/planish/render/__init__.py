"""The photo drawn through the flattened mesh, at true size."""

from planish.render.draw import Rendered, draw, preview
from planish.render.missing import MissingRegions, mask_of, missing_regions
from planish.render.resolution import Resolution

__all__ = [
    "MissingRegions",
    "Rendered",
    "Resolution",
    "draw",
    "mask_of",
    "missing_regions",
    "preview",
]
