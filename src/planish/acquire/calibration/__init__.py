"""Calibration of cameras and projectors from photos of a board."""
