"""The card with markers that tell the size of photographed pages, to be printed from the browser."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from planish.web.problems import HTTPProblem

MARKER_MM = 40.0


@cache
def card_pdf(paper: str) -> bytes:
    """PDF of four cards on a sheet of paper.

    Raises
    ------
    HTTPProblem
        404 for another paper than a4 and letter.
    """
    from planish.acquire.calibration.boards import PAPER_MM
    from planish.acquire.calibration.cards import card_page
    from planish.io.pdf import pdf_bytes

    if paper not in PAPER_MM:
        raise HTTPProblem(404, f"cards are drawn on {' or '.join(PAPER_MM)}")
    return pdf_bytes(Path("card.pdf"), [card_page(MARKER_MM, paper=paper)], None, pdfa=False, text=())
