"""Synthetic sheets with known flat shape and virtual scanners: ground truth for tests, benchmarks and the demo."""

from planish.gallery.light import Light
from planish.gallery.marker_card import MarkerCard
from planish.gallery.meshes import OUTLINES, sheet_mesh
from planish.gallery.noise import NoiseSpec
from planish.gallery.photo_shoot import PhotoShoot, photo_shoot
from planish.gallery.scanner import VirtualScan, virtual_scan
from planish.gallery.scripts import music_page, script_page
from planish.gallery.sheets import SHEETS, Sheet, sheet
from planish.gallery.typeset import typeset_page, typeset_sheet

__all__ = [
    "OUTLINES",
    "SHEETS",
    "Light",
    "MarkerCard",
    "NoiseSpec",
    "PhotoShoot",
    "Sheet",
    "VirtualScan",
    "music_page",
    "photo_shoot",
    "script_page",
    "sheet",
    "sheet_mesh",
    "typeset_page",
    "typeset_sheet",
    "virtual_scan",
]
