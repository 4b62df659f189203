"""Rest lengths judged alone: how far a page would be out if its sticks were solved perfectly.

    python benchmarks/rest_lengths.py [SHEET ...] [--noise KIND ...]

Pieces of the gallery's sheets, about 60,000 points 0.5 mm apart, are scanned virtually with several kinds of noise.
The sticks' energy is minimised from the true layout, so that no solver's fault shows, and the layout is compared with
the truth of every point (rigid fit, no scaling). `floor` is the same for lengths along the true surface between the
feet of the noisy points: noise moves the feet, and no lengths can undo that.
White, correlated (Gaussian, so many pixels wide) and growing noise (0.02 to 0.15 mm across the sheet) lie along the
scanner's rays; `delaunay` is a random mesh with slivers, and noise in all directions. `rays known` is the error when
smoothing is told where the scanner stood, and so moves points along their rays. Seconds are of a second run.
Prints a Markdown table, in some six minutes.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from machine import machine
from planish.gallery import Sheet, sheet, sheet_mesh, virtual_scan
from planish.gallery.meshes import SCANNER_MM
from planish.geometry.distances import distances
from planish.mesh import Topology, topology
from planish.sticks import make_sticks, unfolded_distance
from planish.surface import smooth_lengths
from planish.types import Mesh, Page, Sticks
from truth import rigid_rms

SPACING_MM = 0.5

SHEETS = {
    "book": sheet("book", width_mm=130.0, height_mm=110.0),
    "spread": sheet("spread", width_mm=150.0, height_mm=100.0),
    "wave": sheet("wave", width_mm=110.0, height_mm=140.0, waves=1.5),
    "letter": sheet("letter", width_mm=110.0, height_mm=140.0),
    "letter, folds of 1.5 mm radius": sheet("letter", width_mm=110.0, height_mm=140.0, radius_mm=1.5),
    "miura": sheet("miura", width_mm=110.0, height_mm=140.0, cells=(3.0, 3.0)),
    "curl": sheet("curl", width_mm=110.0, height_mm=140.0, length_mm=80.0),
    "crumpled": sheet("crumpled", width_mm=110.0, height_mm=140.0, folds=6),
    "roll": sheet("roll", width_mm=60.0, height_mm=240.0),
}

NOISE: dict[str, dict] = {
    "none": {},
    "white 0.05": {"noise_mm": 0.05},
    "white 0.07": {"noise_mm": 0.07},
    "white 0.2": {"noise_mm": 0.2},
    "1 px, 0.07": {"noise_mm": 0.07, "noise_correlation_px": 1.0},
    "3 px, 0.07": {"noise_mm": 0.07, "noise_correlation_px": 3.0},
    "0.02 to 0.15": {"noise_mm": (0.02, 0.15)},
    "delaunay 0": {"layout": "delaunay"},
    "delaunay 0.05": {"layout": "delaunay", "noise_mm": 0.05},
}


@dataclass
class Case:
    mesh: Mesh
    topology: Topology
    truth_xy: np.ndarray
    feet_xy: np.ndarray
    eye: np.ndarray | None


def scanned(paper: Sheet, layout: str = "range", **noise) -> Case:
    """A roll has an inside that no scanner sees; its range image is laid over it by force."""
    points = int(paper.width_mm * paper.height_mm / SPACING_MM**2)
    if layout == "delaunay" or paper.name == "roll":
        mesh, truth_xy = sheet_mesh(paper, points, layout=layout, rng=1, **noise)
        eye = None if layout == "delaunay" else SCANNER_MM
    else:
        shape = round(paper.height_mm), round(paper.width_mm)
        blank = Page(np.full(shape, 255, np.uint8), np.ones(shape, bool), 25.4)
        made = virtual_scan(paper, points=points, photo_px=None, printed=(blank, ""), rng=1, **noise)
        mesh, truth_xy, camera = made.scan.mesh, made.truth_xy, made.scan.camera
        eye = -camera.rotation.T @ camera.translation
    feet_xy = feet(paper, truth_xy, mesh.points) if noise else truth_xy
    return Case(mesh, topology(mesh.faces, len(mesh.points)), truth_xy, feet_xy, eye)


def feet(paper: Sheet, start_xy: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Places on the page whose points of the sheet are nearest to the given ones.

    As the sheet keeps lengths, its tangents are orthonormal and the distance along them is the step to take; where a
    crease stops that, a shrinking pattern of steps goes on.
    """

    def distance(xy, which):
        return np.linalg.norm(paper.bend(xy) - points[which], axis=1)

    def slope(xy):
        shift = 1e-5 * np.eye(2)
        off = points - paper.bend(xy)
        return np.stack([((paper.bend(xy + s) - paper.bend(xy - s)) / 2e-5 * off).sum(axis=1) for s in shift], axis=1)

    xy = start_xy.copy()
    for _ in range(10):
        xy += np.clip(0.95 * slope(xy), -0.3, 0.3)
    every = np.arange(len(xy))
    lost = np.flatnonzero(
        (distance(xy, every) > distance(start_xy, every) + 1e-9) | (np.abs(slope(xy)).max(axis=1) > 1e-3)
    )
    pattern = np.stack(np.meshgrid(*[np.linspace(-1, 1, 7)] * 2), axis=-1).reshape(-1, 2)
    for reach in 0.5 * 0.45 ** np.arange(14):
        tried = np.stack([distance(xy[lost] + reach * step, lost) for step in pattern])
        xy[lost] += reach * pattern[tried.argmin(axis=0)]
    return xy


def solved(truth_xy: np.ndarray, sticks: Sticks, rest: np.ndarray, factor: SuperLU, rounds: int = 4) -> np.ndarray:
    """The layout of least squares, sum of w (l - rest)^2, from the true one, by Newton steps with the matrix there."""
    x, pairs = truth_xy.copy(), sticks.pairs
    rigid = rigid_motions(x)
    for _ in range(rounds):
        d = x[pairs[:, 1]] - x[pairs[:, 0]]
        length = np.maximum(np.linalg.norm(d, axis=1), 1e-9)
        pull = (sticks.weight * (1 - rest / length))[:, None] * d
        ends = [(pairs[:, end], sign) for end, sign in ((1, 1), (0, -1))]
        gradient = np.stack([sum(s * np.bincount(at, pull[:, k], len(x)) for at, s in ends) for k in (0, 1)], axis=1)
        step = factor.solve(gradient.ravel())
        x -= (step - rigid @ (rigid.T @ step)).reshape(-1, 2)
    return x


def rigid_motions(xy: np.ndarray) -> np.ndarray:
    """(2 n, 3) orthonormal: the moves that no length resists."""
    dx, dy = (xy - xy.mean(axis=0)).T
    moves = np.zeros((3, len(xy), 2))
    moves[0, :, 0] = moves[1, :, 1] = 1
    moves[2] = np.stack([-dy, dx], axis=1)
    flat = moves.reshape(3, -1)
    return (flat / np.linalg.norm(flat, axis=1, keepdims=True)).T


def factored(xy: np.ndarray, sticks: Sticks) -> SuperLU:
    """Gauss-Newton matrix of the sticks' energy in the true layout, with a breath of mass against rigid moves."""
    pairs = sticks.pairs
    d = xy[pairs[:, 1]] - xy[pairs[:, 0]]
    along = d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-9)
    rows = np.repeat(np.arange(len(pairs)), 4)
    cols = np.stack([2 * pairs[:, 0], 2 * pairs[:, 0] + 1, 2 * pairs[:, 1], 2 * pairs[:, 1] + 1], axis=1).ravel()
    jacobian = sparse.csr_matrix((np.hstack([-along, along]).ravel(), (rows, cols)), shape=(len(pairs), 2 * len(xy)))
    matrix = (jacobian.T @ sparse.diags(sticks.weight) @ jacobian + 1e-6 * sparse.eye(2 * len(xy))).tocsc()
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def with_bending(case: Case, edge_rest: np.ndarray, turned: np.ndarray | None) -> np.ndarray:
    """Lengths of all sticks from those of the edges, and from which faces noise has turned over."""
    inner = np.flatnonzero(case.topology.edge_uses == 2).astype(np.int32)
    return np.concatenate([edge_rest, unfolded_distance(edge_rest, inner, case.mesh.faces, case.topology, turned)])


def truly_turned(case: Case) -> np.ndarray:
    """Faces whose feet run clockwise on the sheet; pages have y down."""
    a, b, c = (case.feet_xy[case.mesh.faces[:, k]] for k in range(3))
    return (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] > 0


def row(name: str, kind: str) -> str:
    case = scanned(SHEETS[name], **NOISE[kind])
    sticks = make_sticks(case.mesh, case.topology, "smooth")  # from here on the kernels are compiled
    start = perf_counter()
    smoothed = smooth_lengths(case.mesh.points, case.mesh.faces, case.topology)
    seconds = perf_counter() - start
    factor = factored(case.truth_xy, sticks)
    floor, _ = judged(case, distances(case.feet_xy, case.topology.edges), truly_turned(case), sticks, factor)
    raw, raw_size = judged(case, distances(case.mesh.points, case.topology.edges), None, sticks, factor)
    rms, size = judged(case, smoothed.rest, smoothed.turned, sticks, factor)
    times = f"{rms / floor:.1f}" if floor > 0.001 else ""
    known = ""
    if case.eye is not None:
        told = smooth_lengths(case.mesh.points, case.mesh.faces, case.topology, eye=case.eye)
        known = f"{judged(case, told.rest, told.turned, sticks, factor)[0]:.3f}"
    return (
        f"| {name} | {kind} | {len(case.truth_xy):,} | {floor:.3f} | {raw:.3f} | {raw_size:+.3f} | **{rms:.3f}** "
        f"| {times} | {size:+.3f} | {known} | {smoothed.typical_noise_mm:.3f} | {smoothed.smoothing.name.lower()} "
        f"| {seconds:.2f} |"
    )


def judged(
    case: Case, edge_rest: np.ndarray, turned: np.ndarray | None, sticks: Sticks, factor: SuperLU
) -> tuple[float, float]:
    """Rms error [mm] and error of the size [%] of the layout that lengths of the edges lead to."""
    x = solved(case.truth_xy, sticks, with_bending(case, edge_rest, turned), factor)
    return rigid_rms(x, case.truth_xy), 100 * (span(x) / span(case.truth_xy) - 1)


def span(xy: np.ndarray) -> float:
    return float(np.sqrt(((xy - xy.mean(axis=0)) ** 2).sum()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sheets", nargs="*", default=list(SHEETS), metavar="SHEET")
    parser.add_argument("--noise", nargs="+", default=list(NOISE), metavar="KIND")
    asked = parser.parse_args()
    print(machine(), "\n")
    print(
        "| sheet | noise, mm | points | floor, mm | raw lengths, mm | size, % | smooth lengths, mm | times the floor "
        "| size, % | rays known, mm | noise found, mm | smoothing | seconds |"
    )
    print("|" + 13 * "---|")
    for name in asked.sheets:
        for kind in asked.noise:
            print(row(name, kind), flush=True)


if __name__ == "__main__":
    main()
