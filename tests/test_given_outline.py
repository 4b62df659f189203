"""Outlines that were given, by hand or as masks: a page is good only where they follow an edge of the sheet."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from planish.document.given_outline import doubtful_outline, share_without_edge
from planish.document.surroundings import cut_to_mask
from planish.gallery import typeset_page
from planish.job.photo_sheet import shapes_of_one
from planish.pipeline import prepare
from planish.settings import PhotoSettings
from scenes import CAMERA, seen, viewed


def paper(name="book"):
    """Where the camera of the scenes sees the sheet."""
    return np.isfinite(viewed(name, CAMERA).page_xy[..., 0])


def polygon(mask, corners):
    """A mask as somebody draws it who sets so many corners."""
    outline = max(cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=len)
    off = next(off for off in np.arange(0.5, 60, 0.5) if len(cv2.approxPolyDP(outline, off, True)) <= corners)
    drawn = np.zeros(mask.shape, np.uint8)
    return cv2.fillPoly(drawn, [cv2.approxPolyDP(outline, off, True)], 1) > 0


def grown(mask, px):
    kernel = np.ones((2 * abs(px) + 1, 2 * abs(px) + 1), np.uint8)
    return (cv2.dilate if px > 0 else cv2.erode)(mask.astype(np.uint8), kernel) > 0


def doubts(scan, mask):
    return [warning.code for warning in prepare(replace(scan, sheet=mask)).warnings if "doubt" in warning.code]


def test_a_page_cut_out_along_its_edge_is_not_doubted():
    scan, _ = seen("book")
    assert doubts(scan, paper()) == []


@pytest.mark.parametrize("table", [70.0, 215.0])
def test_an_outline_that_takes_ground_in_or_cuts_paper_off_is_doubted(table):
    """On a dark table and on one as white as the paper; by 4 % of the page on each side."""
    scan, _ = seen("letter", table=table)
    for px in (6, -6):
        assert doubts(scan, grown(paper("letter"), px)) == ["outline-doubtful"], px


def test_seven_corners_around_a_book_on_white_are_doubted_since_nothing_shows_where_it_ends():
    scan, _ = seen("book", table=215.0)
    assert doubts(scan, polygon(paper(), 7)) == ["outline-doubtful"]


def test_ground_beside_a_raised_corner_is_left_out_of_an_outline_of_seven_corners():
    """Seen from above it is a narrow strip; down to the table and along it, it made the page 4 % too high."""
    scan, on_paper = seen("book")
    drawn, _ = cut_to_mask(replace(scan, sheet=polygon(paper(), 7)))
    used = np.unique(drawn.mesh.faces)
    moved = (drawn.mesh.points != scan.mesh.points).any(axis=1)
    assert (on_paper | moved)[used].mean() > 0.995


def test_print_up_to_the_outline_is_no_edge():
    page = np.asarray(typeset_page(210, 297, 100)[0])
    photo = np.full((page.shape[0] + 200, page.shape[1] + 200, 3), 60, np.uint8)
    photo[100:-100, 100:-100] = page
    sheet = np.zeros(photo.shape[:2], bool)
    sheet[100:-100, 100:-100] = True
    assert share_without_edge(sheet, photo) == 0
    inner = np.zeros_like(sheet)
    inner[400:-400, 300:-300] = True  # within the text
    assert share_without_edge(inner, photo) > 0.8
    (warning,) = doubtful_outline(inner, photo)
    assert str(warning).startswith("along ")


def test_a_step_of_the_surface_is_an_edge_without_any_colour():
    scan, _ = seen("crumpled")
    mask = paper("crumpled")
    surface = scan.mesh, scan.photo_xy
    assert share_without_edge(mask, None, surface) < 0.1 < 0.5 < share_without_edge(grown(mask, 8), None, surface)


def test_where_the_scan_or_the_photo_ends_the_sheet_ends():
    scan, _ = seen("book", with_table=False)
    whole = np.ones(scan.photo.shape[:2], bool)
    assert doubts(scan, whole) == []
    assert doubts(scan, grown(paper(), 8)) == []


def test_the_outline_on_one_photo_is_looked_at_as_well(tmp_path, monkeypatch, restored_book):
    """Its ground is made black before the sheet is sought, so that an edge is found wherever the outline runs."""
    photo = np.full((300, 400, 3), 220, np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), photo)
    outline = np.zeros((300, 400), np.uint8)
    outline[40:260, 60:340] = 255
    found = SimpleNamespace(side=None, scan=None, report=SimpleNamespace(scale="paper"), warnings=())
    monkeypatch.setattr("planish.photo.find_shapes", lambda *_, **__: [found])
    (sheet,) = shapes_of_one(tmp_path / "photo.png", PhotoSettings(paper="a4"), lambda stage, share: None, outline)
    assert "outline-doubtful" in [warning.code for warning in sheet.complete(restored_book).warnings]
