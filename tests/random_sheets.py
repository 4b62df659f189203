"""Sheets of every kind that a scanner, a mesher or a user may hand in, made from a number."""

import numpy as np

import planish
from planish.errors import InputError
from planish.gallery import SHEETS, NoiseSpec, sheet, sheet_mesh
from planish.geometry.distances import distances
from planish.mesh import LEAST_HEIGHT, relative_heights, repair
from planish.types import Mesh, Scan

OUTLINES = (None, None, None, "c", "ring", "comb")


def random_sheet(seed: int) -> Mesh:
    """A bent sheet with some of: noise of every kind, holes, cuts, an odd outline, slivers, damage, a second piece."""
    rng = np.random.default_rng(seed)
    name = rng.choice([n for n in SHEETS if n != "roll" or rng.random() < 0.3])
    size = sheet(name).width_mm, sheet(name).height_mm
    mesh, _ = sheet_mesh(
        sheet(name),
        points=int(rng.integers(40, 2500)),
        layout=rng.choice(["range", "grid", "delaunay"]),
        outline=OUTLINES[rng.integers(len(OUTLINES))],
        holes=int(rng.integers(0, 5)) if rng.random() < 0.4 else 0,
        cuts=[tuple(map(tuple, rng.uniform(0, size, (2, 2)))) for _ in range(rng.integers(0, 3))],
        noise=_random_noise(np.random.default_rng([seed, 1]), white_mm=float(rng.choice([0, 0, 0.05, 0.2, 1.0]))),
        rng=seed,
    )
    points, faces = np.array(mesh.points), np.array(mesh.faces)
    if rng.random() < 0.3:  # drawn out into slivers
        points[:, 0] *= rng.uniform(0.05, 20)
    if rng.random() < 0.3:
        turned = rng.random(len(faces)) < 0.3
        faces[turned] = faces[turned, ::-1]
    if rng.random() < 0.2 and len(faces):
        faces = np.r_[faces, faces[rng.integers(len(faces), size=5)]]  # faces that stand twice
    if rng.random() < 0.2 and len(points):
        points[rng.integers(len(points), size=3)] = rng.choice([np.nan, np.inf])
    if rng.random() < 0.2:  # a triangle soup: every corner a point of its own
        points, faces = points[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)
    if rng.random() < 0.2:  # two sheets, one beside the other or over it
        faces = np.r_[faces, faces + len(points)]
        points = np.r_[points, points + rng.normal(0, 200, 3)]
    if rng.random() < 0.1:
        points *= 10.0 ** rng.uniform(-6, 6)
    if rng.random() < 0.1:
        points += rng.normal(0, 1e4, 3)
    return Mesh(points, faces)


def _random_noise(rng: np.random.Generator, white_mm: float) -> NoiseSpec:
    """White noise alone for half of all sheets, mixed with noise of the other kinds for the others."""
    if rng.random() < 0.5:
        return NoiseSpec(white_mm=white_mm)
    return NoiseSpec(
        white_mm=white_mm,
        correlated_mm=float(rng.choice([0, 0, 0.1, 0.5])),
        correlation_px=float(rng.uniform(1, 10)),
        ripple_mm=float(rng.choice([0, 0, 0.12, 0.5])),
        ripple_px=float(rng.uniform(4, 12)),
        ripple_deg=float(rng.uniform(0, 90)),
        step_mm=float(rng.choice([0, 0, 0.2, 1.0])),
        spikes=float(rng.choice([0, 0, 0.002, 0.02])),
    )


def check(seed: int) -> str:
    """Flatten one sheet: nothing infinite, no flip or overlap that is not told; returns how it ended."""
    scan = Scan(random_sheet(seed))
    try:
        done = planish.restore(scan)
    except InputError:
        return "refused"
    flat, said = done.flattening, done.report.flatten
    assert np.isfinite(flat.page_xy).all(), seed
    assert np.isfinite([*flat.size_mm, said.strain_rms, said.expected_error_mm]).all(), seed
    prepared = repair(scan)
    kept = prepared.mesh_rows >= 0
    page = np.zeros((len(prepared.scan.mesh.points), 2))
    page[prepared.mesh_rows[kept]] = flat.page_xy[kept]
    ab, ac = (page[prepared.scan.mesh.faces[:, k]] - page[prepared.scan.mesh.faces[:, 0]] for k in (1, 2))
    topo = prepared.topology
    lengths = distances(prepared.scan.mesh.points, topo.edges)
    with_area = relative_heights(lengths, topo.face_edges) >= LEAST_HEIGHT
    flips = int((ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0] >= 0)[with_area].sum())
    shared = any("touch in a point" in warning.sentence for warning in done.report.warnings)
    assert said.flipped_faces == flips or shared, seed
    for count, word in ((said.flipped_faces, "back up"), (said.overlaps, "over other parts")):
        assert not count or any(word in warning.sentence for warning in done.report.warnings), seed
    return flat.outcome.name
