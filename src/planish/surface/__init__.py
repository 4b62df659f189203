"""The scanned surface without its noise: normals, creases, rulings and the lengths measured along it."""

from planish.surface.smooth_lengths import Smoothing, SmoothLengths, smooth_lengths, smooth_normals

__all__ = [
    "SmoothLengths",
    "Smoothing",
    "smooth_lengths",
    "smooth_normals",
]
