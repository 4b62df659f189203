"""Shape from a single photo: text lines, sheet borders or shading give a scan like any other."""

from planish.photo.shape import PhotoShape, find_shape, find_shapes

__all__ = ["PhotoShape", "find_shape", "find_shapes"]
