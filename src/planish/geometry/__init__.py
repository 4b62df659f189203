"""Cameras, rays, rigid fits and small vectors: geometry that knows nothing of sheets."""

from planish.geometry.projection import camera_position, depths, project

__all__ = [
    "camera_position",
    "depths",
    "project",
]
