"""Cameras, rays, rigid fits and small vectors: geometry that knows nothing of sheets."""

from planish.geometry.projection import depths, project

__all__ = [
    "depths",
    "project",
]
