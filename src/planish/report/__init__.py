"""An honest account of a restoration: what was measured, and how it reads."""

from planish.report.measures import flipped_faces, signed_areas, strain, stretch
from planish.report.table import summary

__all__ = ["flipped_faces", "signed_areas", "strain", "stretch", "summary"]
