"""Images of every stage (`--stages`), like figures 4 and 5 of the paper, and the quality certificate."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from planish.binarize import binarize
from planish.document.cut_picture import cut_picture
from planish.geometry.rigid_fit import fit_rigid
from planish.io import make_folder, write_page
from planish.mesh import from_file_order, onto_support_plane
from planish.report import certificate, contact_sheet, heat_map, relief
from planish.report.certificate import DPI
from planish.types import Bools, Floats, Mesh, Page, Pixels, Restoration

CAPTIONS = {
    "1-warped": "The photo",
    "3-mesh-before": "The scan",
    "5-restored": "The page",
    "7-expected-error": "Expected error",
    "2-warped-binary": "The photo, black and white",
    "4-mesh-after": "The scan, flattened",
    "6-restored-binary": "The page, black and white",
    "8-strain": "Strain",
    "9-measured": "Measured or bridged",
    "0-sheet": "The scan without what was left out",
}
"""Captions of the contact sheet in its order: colour above binary, before left of after, maps last."""


def write_stages(folder: Path, restoration: Restoration, measured: Floats | None = None) -> list[Path]:
    """Write photo, page, both binarized, mesh before and after, quality maps, and a contact sheet of all of them.

    Where surroundings were left out, a picture in which they are dark comes along. The images of the photo are omitted
    for scans with several textures or with colours of points only.

    Parameters
    ----------
    folder : Path
        Created if it does not exist.
    restoration : Restoration
        With a rendered page.
    measured : (n,) float64, optional
        Of the scan's points: 1 where several photos measured the surface, 0 where it is bridged.

    Returns
    -------
    list of Path
        The files written.
    """
    scan = restoration.prepared.scan
    warped: dict[str, Pixels | Bools] = {}
    photo_dpi = restoration.report.page.effective_ppi_median or 300.0
    if scan.photo is not None:
        photo = _as_page(scan.photo, photo_dpi)
        warped = {"1-warped": photo.pixels, "2-warped-binary": _binary_image(photo)}
    kept = cut_picture(restoration.prepared)
    if kept is not None:
        warped["0-sheet"] = kept
    page = restoration.page
    assert page is not None
    prepared, flat = restoration.prepared, restoration.flattening
    faces = scan.mesh.faces
    page_xy, error, strain = (from_file_order(prepared, v) for v in (flat.page_xy, flat.error_mm, flat.local_strain))
    before, after = before_and_after(scan.mesh, page_xy)
    pictures: dict[str, Pixels | Bools] = {
        **warped,
        "3-mesh-before": relief(before, faces),
        "4-mesh-after": relief(after, faces),
        "5-restored": page.pixels,
        "6-restored-binary": restoration.binary.pixels if restoration.binary else _binary_image(page),
        "7-expected-error": heat_map(page_xy, faces, error, flat.size_mm, "expected error, mm"),
        "8-strain": heat_map(page_xy, faces, 100 * strain, flat.size_mm, "strain, %"),
    }
    if measured is not None:
        share = from_file_order(prepared, measured)
        pictures["9-measured"] = heat_map(page_xy, faces, share, flat.size_mm, "1 measured, 0 bridged")
    pictures["all"] = contact_sheet(
        {caption: pictures[name] for name, caption in CAPTIONS.items() if name in pictures}, "From scan to page"
    )
    make_folder(folder)
    written = []
    for name, pixels in pictures.items():
        path = folder / f"{name}.png"
        write_page(path, _as_page(pixels, page.dpi if "restored" in name else photo_dpi))
        written.append(path)
    return written


def write_certificate(path: Path, name: str, restoration: Restoration) -> None:
    """Write the quality certificate of a restoration, one A4 page."""
    write_page(path, _as_page(certificate(restoration, name), DPI))


def before_and_after(mesh: Mesh, page_xy: Floats) -> tuple[Floats, Floats]:
    """Points of the scan on its support plane, and of the flattened page aligned with them; page top at +y."""
    points, _, _ = onto_support_plane(mesh)
    page = (page_xy - page_xy.mean(axis=0)) * [1, -1]
    scanned = points - [*points[:, :2].mean(axis=0), 0]
    scanned[:, :2] = scanned[:, :2] @ fit_rigid(scanned[:, :2], page)[0].T
    return scanned, np.c_[page, 0 * page[:, :1]]


def _as_page(pixels: Pixels | Bools, dpi: float) -> Page:
    return Page.owned(pixels, np.ones(pixels.shape[:2], bool), dpi)


def _binary_image(page: Page) -> Bools:
    return binarize(page).pixels  # type: ignore[return-value]
