"""`planish calibrate card`."""

from __future__ import annotations

from typing import Literal

from planish.cli.options import Output


def card(
    *,
    output: Output,
    marker_mm: float = 40.0,
    cards: int = 4,
    paper: Literal["a4", "letter"] = "a4",
    overwrite: bool = True,
) -> None:
    """Draw cards with ArUco markers, to be printed at 100 %, cut out and laid flat beside a sheet.

    Photos that show one or more of them tell the size of the page.

    Parameters
    ----------
    output
        .pdf, or .png or .tif with its dpi as metadata.
    marker_mm
        Side of the black squares. Measure the print, and give the measured value with the photos.
    cards
        How many, each with a number of its own; two or three beside a sheet tell its size better than one.
    paper
        Paper size.
    overwrite
        Whether an existing file may be replaced.
    """
    from planish.acquire.calibration.cards import card_page
    from planish.io import check_page_name, check_writable, write_page

    check_page_name(output)
    check_writable(output, overwrite=overwrite)
    write_page(output, card_page(marker_mm, cards, paper))
