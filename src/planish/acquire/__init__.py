"""From light to scan: depth cameras, Gray code and laser lines, and the calibration that they need."""
