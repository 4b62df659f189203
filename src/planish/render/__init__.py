"""Rendering: the photo drawn through the flattened mesh, at true size."""

from planish.render.draw import Rendered, draw, preview, render_page
from planish.render.missing import MissingRegions, mask_of, missing_regions
from planish.render.photo_view import PhotoView, moved_view, photo_views
from planish.render.resolution import Resolution
from planish.render.sharpen import sharpened

__all__ = [
    "MissingRegions",
    "PhotoView",
    "Rendered",
    "Resolution",
    "draw",
    "mask_of",
    "missing_regions",
    "moved_view",
    "photo_views",
    "preview",
    "render_page",
    "sharpened",
]
