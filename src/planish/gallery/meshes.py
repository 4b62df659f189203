"""Triangle meshes of the known sheets, like those of scanners and mesh programs, without a photo."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import spatial

from planish.errors import UsageError
from planish.gallery.noise import Noise, NoiseSpec, noise_at, noise_spec, rounded, thinned
from planish.gallery.sheets import Sheet
from planish.mesh import grid_faces, without_small_components
from planish.types import Bools, Floats, Ints, Mesh

Layout = Literal["range", "grid", "delaunay"]
Segment = tuple[tuple[float, float], tuple[float, float]]

SCANNER_MM = np.array([3.0, -2.0, 650.0])
"""Position of the gallery's range scanner above the table's origin."""

TURN_DEG = 7.0
"""Rotation of the pixel grid of layout "range" against the sheet, so that its border is stepped like that of a scan."""


def _ring(at: Floats) -> Bools:
    slit = (at[:, 0] > 0.5) & (np.abs(at[:, 1] - 0.5) < 0.01)
    inside: Bools = (np.abs(np.hypot(*(at - 0.5).T) - 0.4) < 0.09) & ~slit
    return inside


OUTLINES: dict[str, Callable[[Floats], Bools]] = {
    "c": lambda at: (at[:, 0] < 0.2) | (np.abs(at[:, 1] - 0.5) > 0.3),
    "ring": _ring,
    "comb": lambda at: (at[:, 0] < 0.15) | (np.floor(at[:, 1] * 15) % 2 == 0),
}
"""Slender outlines: (k, 2) positions, 0 to 1 in both directions -> inside or not."""


def sheet_mesh(
    sheet: Sheet,
    points: int = 300_000,
    *,
    layout: Layout = "range",
    outline: str | Callable[[Floats], Bools] | None = None,
    holes: int = 0,
    cuts: Sequence[Segment] = (),
    noise_mm: Noise = 0.0,
    noise_correlation_px: float = 0.0,
    noise: NoiseSpec | None = None,
    rng: np.random.Generator | int = 0,
) -> tuple[Mesh, Floats]:
    """Lay a triangle mesh over a whole sheet, also where no scanner would see it.

    Parameters
    ----------
    sheet : Sheet
    points : int
        About how many, before outline, holes and cuts take theirs.
    layout : {"range", "grid", "delaunay"}
        range: square pixels rotated by 7 degrees against the sheet, stepped border, errors along the ray to a scanner
        650 mm above. grid: rows and columns of the sheet from border to border, errors along the ray. delaunay:
        random places in random order, with slivers, whole border; errors the same in all three directions.
    outline : str or callable, optional
        "c", "ring" (cut open) or "comb"; or a function of (k, 2) places, 0 to 1 both ways, -> (k,) bool.
    holes : int
        Round ones, at random places.
    cuts : sequence of ((x, y), (x, y)) [mm on the page]
        Faces across these segments are taken out.
    noise_mm : float or (float, float)
        Standard deviation of the errors; two numbers: from the top left to the bottom right corner.
    noise_correlation_px : float
        Over how many points the errors are alike; see `NoiseSpec`.
    noise : NoiseSpec, optional
        Instead of these two: errors of every kind. Steps are those of the height over the table.
    rng : numpy.random.Generator or int
        Source of all that is random here, or its seed.

    Returns
    -------
    mesh : Mesh
    truth_xy : (n, 2) float64 [mm]
        Position of every point on the flat page.

    Examples
    --------
    >>> from planish.gallery import sheet
    >>> mesh, truth_xy = sheet_mesh(sheet("flat"), 1000, layout="grid")
    >>> np.ptp(mesh.points, axis=0).round(6), np.ptp(truth_xy, axis=0)
    (array([215.9, 279.4,   0. ]), array([215.9, 279.4]))
    """
    rng = np.random.default_rng(rng)
    size = np.array([sheet.width_mm, sheet.height_mm])
    page_xy, faces, lattice_rc = _LAYOUTS[layout](sheet, points, rng)
    keep = np.ones(len(faces), bool)
    for inside in _regions(outline, holes, rng):
        keep &= inside(page_xy / size)[faces].all(axis=1) & inside(page_xy[faces].mean(axis=1) / size)
    for cut in cuts:
        keep &= ~_cut_by(page_xy[faces], np.asarray(cut, np.float64))
    used, faces = without_small_components(faces[keep], len(page_xy))
    page_xy, lattice_rc = page_xy[used], lattice_rc[used]

    points_xyz = sheet.bend(page_xy)
    spec = noise_spec(noise, noise_mm, noise_correlation_px)
    error = noise_at(lattice_rc, page_xy / size, spec, rng, 3 if layout == "delaunay" else 1)
    if layout != "delaunay":
        ray = points_xyz - SCANNER_MM
        error = error * ray / np.linalg.norm(ray, axis=1, keepdims=True)
    points_xyz = points_xyz + error
    if spec.step_mm:
        points_xyz[:, 2] = rounded(points_xyz[:, 2], spec.step_mm)
    if spec.keep < 1:
        used, faces = thinned(page_xy, spec.keep, rng)
        points_xyz, page_xy = points_xyz[used], page_xy[used]
    return Mesh.owned(points_xyz, faces), page_xy


def _range_layout(sheet: Sheet, points: int, rng: np.random.Generator) -> tuple[Floats, Ints, NDArray[np.int64]]:
    size = np.array([sheet.width_mm, sheet.height_mm])
    spacing = np.sqrt(size.prod() / points)
    half = int(np.hypot(*size) / spacing / 2) + 1
    rows, cols = np.mgrid[-half : half + 1, -half : half + 1]
    cos, sin = np.cos(np.radians(TURN_DEG)), np.sin(np.radians(TURN_DEG))
    corner = size / 2 + spacing * rng.uniform(-0.5, 0.5, 2)
    page_xy = spacing * np.stack([cols * cos - rows * sin, cols * sin + rows * cos], axis=-1) + corner
    inside = ((page_xy >= 0) & (page_xy <= size)).all(axis=-1)
    index = np.where(inside, np.cumsum(inside).reshape(inside.shape) - 1, -1).astype(np.int32)
    page_xy = page_xy[inside]
    return page_xy, grid_faces(index, sheet.bend(page_xy)), np.argwhere(inside)


def _grid_layout(sheet: Sheet, points: int, rng: np.random.Generator) -> tuple[Floats, Ints, NDArray[np.int64]]:
    cols = max(2, round(np.sqrt(points * sheet.width_mm / sheet.height_mm)))
    rows = max(2, round(points / cols))
    x, y = np.meshgrid(np.linspace(0, sheet.width_mm, cols), np.linspace(0, sheet.height_mm, rows))
    page_xy = np.stack([x.ravel(), y.ravel()], axis=1)
    index = np.arange(rows * cols, dtype=np.int32).reshape(rows, cols)
    return page_xy, grid_faces(index, sheet.bend(page_xy)), np.argwhere(np.ones((rows, cols)))


def _delaunay_layout(sheet: Sheet, points: int, rng: np.random.Generator) -> tuple[Floats, Ints, NDArray[np.int64]]:
    size = np.array([sheet.width_mm, sheet.height_mm])
    spacing = np.sqrt(size.prod() / points)
    across, down = (np.linspace(0, n, max(2, round(n / spacing)), endpoint=False) for n in size)
    top, left = np.stack([across, 0 * across], axis=1), np.stack([0 * down, size[1] - down], axis=1)
    border = np.concatenate([top, size - top, left, size - left])
    page_xy = np.concatenate([border, rng.uniform(0, size, (max(0, points - len(border)), 2))])
    page_xy = rng.permutation(page_xy)
    faces = spatial.Delaunay(page_xy).simplices.astype(np.int32)
    u, v = page_xy[faces[:, 1]] - page_xy[faces[:, 0]], page_xy[faces[:, 2]] - page_xy[faces[:, 0]]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    faces = np.where((area < 0)[:, None], faces, faces[:, ::-1])  # y is down: counter-clockwise has area < 0
    return page_xy, faces[np.abs(area) > 1e-9], (page_xy[:, ::-1] / spacing).astype(np.int64)


_LAYOUTS = {"range": _range_layout, "grid": _grid_layout, "delaunay": _delaunay_layout}


def _regions(
    outline: str | Callable[[Floats], Bools] | None, holes: int, rng: np.random.Generator
) -> list[Callable[[Floats], Bools]]:
    """Collect the regions that bound a sheet, each a function of positions from 0 to 1."""
    regions: list[Callable[[Floats], Bools]] = []
    if callable(outline):
        regions.append(outline)
    elif outline is not None:
        if outline not in OUTLINES:
            raise UsageError(f"there is no outline {outline!r}; choose one of {', '.join(OUTLINES)}")
        regions.append(OUTLINES[outline])
    if holes:
        discs = np.column_stack([rng.uniform(0.08, 0.92, (holes, 2)), rng.uniform(0.015, 0.04, holes)])

        def outside(at: Floats) -> Bools:
            clear: Bools = np.logical_and.reduce([np.hypot(*(at - (x, y)).T) > radius for x, y, radius in discs])
            return clear

        regions.append(outside)
    return regions


def _cut_by(corners: Floats, cut: Floats) -> Bools:
    """Which triangles (m, 3, 2) are cut by a segment (2, 2)."""
    along = (cut[1] - cut[0]) / np.linalg.norm(cut[1] - cut[0])
    from_start = corners - cut[0]
    offset = from_start @ [-along[1], along[0]]
    position_along = from_start @ along
    straddles = (offset.min(axis=1) <= 0) & (offset.max(axis=1) >= 0)
    return (
        straddles & (position_along.max(axis=1) >= 0) & (position_along.min(axis=1) <= np.linalg.norm(cut[1] - cut[0]))
    )
