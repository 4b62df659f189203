"""Acquisition: depth cameras, range images, point clouds, structured light and laser lines, with their calibration."""
