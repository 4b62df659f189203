"""Pictures of every stage, as the paper's figures 4 and 5 show them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from planish.binarize import binarize
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
    "4-mesh-after": "The scan, laid flat",
    "6-restored-binary": "The page, black and white",
    "8-strain": "Strain",
}
"""Of the sheet of all pictures, in its order: colour above black and white, before left of after, maps last."""


def write_stages(folder: Path, done: Restoration) -> list[Path]:
    """Write the warped photo, the restored page, both in black and white, the mesh before and after, and all in one.

    Parameters
    ----------
    folder : Path
        Made if there is none.
    done : Restoration
        With a page.

    Returns
    -------
    list of Path
        The files written.
    """
    scan = done.prepared.scan
    assert scan.photo is not None
    assert done.rendered is not None
    photo = _as_page(scan.photo, done.report.page.effective_ppi_median or 300.0)
    page = done.unshaded or done.rendered
    prepared, flat = done.prepared, done.flattening
    faces = scan.mesh.faces
    page_xy, error, strain = (from_file_order(prepared, v) for v in (flat.page_xy, flat.error_mm, flat.local_strain))
    before, after = standing_and_lying(scan.mesh, page_xy)
    pictures: dict[str, Pixels | Bools] = {
        "1-warped": photo.pixels,
        "2-warped-binary": _in_black_and_white(photo),
        "3-mesh-before": relief(before, faces),
        "4-mesh-after": relief(after, faces),
        "5-restored": page.pixels,
        "6-restored-binary": done.binary.pixels if done.binary else _in_black_and_white(page),
        "7-expected-error": heat_map(page_xy, faces, error, flat.size_mm, "expected error, mm"),
        "8-strain": heat_map(page_xy, faces, 100 * strain, flat.size_mm, "strain, %"),
    }
    pictures["all"] = contact_sheet({said: pictures[name] for name, said in CAPTIONS.items()}, "From scan to page")
    make_folder(folder)
    written = []
    for name, pixels in pictures.items():
        path = folder / f"{name}.png"
        write_page(path, _as_page(pixels, page.dpi if "restored" in name else photo.dpi))
        written.append(path)
    return written


def write_certificate(path: Path, name: str, done: Restoration) -> None:
    """Write the quality certificate of a restoration, an A4 sheet."""
    write_page(path, _as_page(certificate(done, name), DPI))


def standing_and_lying(mesh: Mesh, page_xy: Floats) -> tuple[Floats, Floats]:
    """Points of the sheet on its table, and flat on it in the same place; the page's top is away from the viewer."""
    points, _, _ = onto_support_plane(mesh)
    page = (page_xy - page_xy.mean(axis=0)) * [1, -1]
    standing = points - [*points[:, :2].mean(axis=0), 0]
    standing[:, :2] = standing[:, :2] @ _rotation_onto(standing[:, :2], page).T
    return standing, np.c_[page, 0 * page[:, :1]]


def _rotation_onto(xy: Floats, target: Floats) -> Floats:
    """The rotation (2, 2) that brings centred places closest to others (Kabsch)."""
    u, _, vt = np.linalg.svd(target.T @ xy)
    return np.asarray(u @ np.diag([1, np.sign(np.linalg.det(u @ vt))]) @ vt)


def _as_page(pixels: Pixels | Bools, dpi: float) -> Page:
    return Page(pixels, np.ones(pixels.shape[:2], bool), dpi)


def _in_black_and_white(page: Page) -> Bools:
    return binarize(page).pixels  # type: ignore[return-value]
