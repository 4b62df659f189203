"""The photo drawn through the flattened mesh, at true size."""

from planish.mesh import project
from planish.render.draw import Rendered, draw, preview
from planish.render.missing import Missing, mask_of, missing_parts
from planish.render.resolution import Resolution
from planish.render.sense import SURE, skew_degrees, upright_turn
from planish.render.spine import find_spine, spine_of, split

__all__ = [
    "SURE",
    "Missing",
    "Rendered",
    "Resolution",
    "draw",
    "find_spine",
    "mask_of",
    "missing_parts",
    "preview",
    "project",
    "skew_degrees",
    "spine_of",
    "split",
    "upright_turn",
]
