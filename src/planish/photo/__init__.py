"""The shape of a sheet from one photo: lines of text, borders or shade become a scan like any other."""

from planish.photo.shape import PhotoShape, find_shape

__all__ = ["PhotoShape", "find_shape"]
