"""Gray code and phase shift: captures decoded, checked, triangulated and meshed."""
