"""What is on a page: text lines and the way they run, two pages in a spread, ink, a sheet's outline in a photo."""

from planish.document.orientation import SURE, skew_degrees, upright_turn
from planish.document.page_split import find_spine, spine_of, split

__all__ = [
    "SURE",
    "find_spine",
    "skew_degrees",
    "spine_of",
    "split",
    "upright_turn",
]
