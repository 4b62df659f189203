"""Values passed between stages: frozen dataclasses of read-only arrays, without behaviour beyond small properties.

Positions are (x, y[, z]) in millimetres; images are [row, col]. Arrays are read-only once a value is made.
"""

from planish.types.arrays import Bools, Floats, Ints, Pixels, freeze, read_only, trusted_replace
from planish.types.checks import check_place, known_places
from planish.types.diagnostic import Diagnostic, few_of_a_kind
from planish.types.page import Page, Restoration
from planish.types.prepared import PreparedScan, Topology
from planish.types.report import (
    Criterion,
    FlattenReport,
    GuidelineReport,
    PageReport,
    PartReport,
    PhotoReport,
    PhotosReport,
    Report,
    ScanReport,
    ShadingReport,
    Spine,
)
from planish.types.sheet import Camera, Doubt, Flattening, Mesh, Outcome, Scan, Sticks, View
from planish.types.summary import summary
from planish.types.texture import Texture
from planish.types.verdict import Verdict

__all__ = [
    "Bools",
    "Camera",
    "Criterion",
    "Diagnostic",
    "Doubt",
    "FlattenReport",
    "Flattening",
    "Floats",
    "GuidelineReport",
    "Ints",
    "Mesh",
    "Outcome",
    "Page",
    "PageReport",
    "PartReport",
    "PhotoReport",
    "PhotosReport",
    "Pixels",
    "PreparedScan",
    "Report",
    "Restoration",
    "Scan",
    "ScanReport",
    "ShadingReport",
    "Spine",
    "Sticks",
    "Texture",
    "Topology",
    "Verdict",
    "View",
    "check_place",
    "few_of_a_kind",
    "freeze",
    "known_places",
    "read_only",
    "summary",
    "trusted_replace",
]
