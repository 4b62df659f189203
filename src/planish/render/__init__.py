"""The photo drawn through the flattened mesh, at true size."""

from planish.mesh import project
from planish.render.draw import Rendered, draw
from planish.render.resolution import Resolution
from planish.render.sense import skew_degrees, upright_turn

__all__ = ["Rendered", "Resolution", "draw", "project", "skew_degrees", "upright_turn"]
