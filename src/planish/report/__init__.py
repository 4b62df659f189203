"""Quality figures of a restoration, and how they are shown."""

from planish.report.build import build_report
from planish.report.certificate import certificate
from planish.report.contact import contact_sheet
from planish.report.distortion import Distortion, distortion
from planish.report.fadgi import graded, guideline
from planish.report.heat import heat_map
from planish.report.measures import flipped_faces
from planish.report.pictures import relief, side_by_side
from planish.types import summary
from planish.types.summary import usual

__all__ = [
    "Distortion",
    "build_report",
    "certificate",
    "contact_sheet",
    "distortion",
    "flipped_faces",
    "graded",
    "guideline",
    "heat_map",
    "relief",
    "side_by_side",
    "summary",
    "usual",
]
