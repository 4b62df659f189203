"""Cameras and projectors from photos of a board."""
