"""Pictures of every stage, as the paper's figures 4 and 5 show them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from planish.types import Bools, Floats, Mesh, Page, Pixels, Restoration, Scan

SHEET = ("1-warped", "3-mesh-before", "5-restored", "2-warped-binary", "4-mesh-after", "6-restored-binary")
"""The order on the sheet of all pictures: colour above black and white, before left of after."""


def write_stages(folder: Path, scan: Scan, done: Restoration) -> list[Path]:
    """Write the warped photo, the restored page, both in black and white, the mesh before and after, and all in one.

    Parameters
    ----------
    folder : Path
        Made if there is none.
    scan : Scan
    done : Restoration
        Of that scan, with a page.

    Returns
    -------
    list of Path
        The files written.
    """
    from planish.io import make_folder, write_page
    from planish.report import relief, side_by_side

    assert scan.photo is not None
    assert done.rendered is not None
    photo = _as_page(scan.photo, done.report.page.effective_ppi_median or 300.0)
    before, after = standing_and_lying(scan, done)
    page = done.unshaded or done.rendered
    pictures: dict[str, Pixels | Bools] = {
        "1-warped": photo.pixels,
        "2-warped-binary": _in_black_and_white(photo),
        "3-mesh-before": relief(before.points, before.faces),
        "4-mesh-after": relief(after.points, after.faces),
        "5-restored": page.pixels,
        "6-restored-binary": done.binary.pixels if done.binary else _in_black_and_white(page),
    }
    pictures["all"] = side_by_side([pictures[name] for name in SHEET], columns=3)
    make_folder(folder)
    written = []
    for name, pixels in pictures.items():
        path = folder / f"{name}.png"
        write_page(path, _as_page(pixels, page.dpi if "restored" in name else photo.dpi))
        written.append(path)
    return written


def standing_and_lying(scan: Scan, done: Restoration) -> tuple[Mesh, Mesh]:
    """The sheet on its table, and flat on it in the same place; the page's top is away from the viewer."""
    from planish.mesh import clean, stand_on_table

    cleaned = clean(scan)
    mesh = cleaned.scan.mesh
    points, _, _ = stand_on_table(mesh)
    kept = cleaned.place >= 0
    page = np.zeros((len(points), 2))
    page[cleaned.place[kept]] = done.flattening.page_xy[kept] * [1, -1]
    page -= page.mean(axis=0)
    standing = points - [*points[:, :2].mean(axis=0), 0]
    standing[:, :2] = standing[:, :2] @ _rotation_onto(standing[:, :2], page).T
    return Mesh(standing, mesh.faces), Mesh(np.c_[page, 0 * page[:, :1]], mesh.faces)


def _rotation_onto(xy: Floats, target: Floats) -> Floats:
    """The rotation (2, 2) that brings centred places closest to others (Kabsch)."""
    u, _, vt = np.linalg.svd(target.T @ xy)
    return np.asarray(u @ np.diag([1, np.sign(np.linalg.det(u @ vt))]) @ vt)


def _as_page(pixels: Pixels | Bools, dpi: float) -> Page:
    return Page(pixels, np.ones(pixels.shape[:2], bool), dpi)


def _in_black_and_white(page: Page) -> Bools:
    from planish.binarize import binarize

    return binarize(page).pixels  # type: ignore[return-value]
