"""Structured light with Gray code and phase shift: check, decode, triangulate and mesh captures."""
