"""Points in rows and columns: depth cameras and range scanners."""
