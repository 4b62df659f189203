"""Document analysis: orientation, skew, page split, ink, and the outline of a sheet in a photo."""

from planish.document.mirrored import reads_backwards
from planish.document.orientation import SURE, detect_orientation, skew_angle, stem_ratio
from planish.document.page_split import find_gutter, gutter_of_surface, split_pages

__all__ = [
    "SURE",
    "detect_orientation",
    "find_gutter",
    "gutter_of_surface",
    "reads_backwards",
    "skew_angle",
    "split_pages",
    "stem_ratio",
]
