"""Cameras, rays and small vectors: the geometry that knows no sheet."""

from planish.geometry.projection import depths, project

__all__ = [
    "depths",
    "project",
]
