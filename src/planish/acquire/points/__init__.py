"""Unorganised point clouds, for instance from photogrammetry."""
