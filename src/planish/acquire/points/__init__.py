"""Points in any order, as photogrammetry makes them."""
