"""From several photos of a sheet to a scan."""
