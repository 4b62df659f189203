"""Flattening beside others: seconds, and how true the flat sheet is.

    python benchmarks/flattening.py [--points N ...] [--sheets NAME ...] [--noise MM ...] [--peers NAME ...] [--heavy]

Random Delaunay meshes of the gallery's sheets (random places in random order, slivers, errors the same in all
directions) are flattened by planish and, from the same points and faces in the same process, by libigl: LSCM, and ARAP
and SLIM from there with 8 iterations. Peers that would take minutes (SLIM over 100,000 points, all over 400,000) need
`--heavy`. Seconds are of the fastest of three runs for planish, whose kernels compile on the first, and of the only one
for peers, which are compiled. LSCM, which knows no size, is scaled to the area of the surface.

Strain: rms of edges against their lengths in space, which noise makes too long. rms mm: every point against the truth,
after a rigid fit without scaling. Prints a Markdown table; failures stay in it.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from time import perf_counter

import numpy as np

from machine import machine
from planish.flattening import flatten
from planish.flattening.overlaps import overlaps
from planish.gallery import sheet, sheet_mesh
from planish.geometry.distances import distances
from planish.mesh import Topology, area_vectors, topology
from planish.report import flipped_faces
from planish.settings import FlattenSettings
from planish.sticks import strain
from planish.types import Mesh
from truth import rigid_rms

Flatten = Callable[[Mesh], np.ndarray]


RUNS = 3
"""Of planish, of which the fastest counts: the first compiles the kernels, and machines are shared."""


def planish(mesh: Mesh, lengths: str) -> tuple[float, np.ndarray]:
    """Seconds from points and faces to their places, as in `flatten.seconds`: all but measuring how good they are."""
    start = perf_counter()
    found = topology(mesh.faces, len(mesh.points))
    seconds = perf_counter() - start
    flat = flatten(mesh, found, FlattenSettings(method="multigrid", lengths=lengths))
    return seconds + flat.seconds, flat.page_xy


def lscm(mesh: Mesh) -> np.ndarray:
    import igl

    faces = mesh.faces.astype(np.int64)
    loop = np.asarray(igl.boundary_loop(faces))
    first = loop[0]
    second = loop[np.argmax(np.linalg.norm(mesh.points[loop] - mesh.points[first], axis=1))]
    span = np.linalg.norm(mesh.points[second] - mesh.points[first])
    uv = igl.lscm(mesh.points, faces, np.array([first, second]), np.array([[0.0, 0.0], [span, 0.0]]))[0]
    return _to_size(mesh, np.asarray(uv))


def arap(mesh: Mesh) -> np.ndarray:
    import igl

    start = lscm(mesh)
    data = igl.ARAPData()
    data.max_iter = 8
    held = np.zeros(1, np.int32)  # without a point held its matrix is singular
    igl.arap_precomputation(mesh.points, mesh.faces.astype(np.int64), 2, held, data)
    return np.asarray(igl.arap_solve(start[held], data, start))


def slim(mesh: Mesh) -> np.ndarray:
    import igl

    uv = np.asfortranarray(lscm(mesh))
    data = igl.slim_precompute(
        np.asfortranarray(mesh.points),
        np.asfortranarray(mesh.faces, np.int32),
        uv,
        igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
        np.zeros(0, np.int32),
        np.asfortranarray(np.zeros((0, 2))),
        0.0,
    )
    return np.asarray(igl.slim_solve(data, 8))[:, :2]


def _to_size(mesh: Mesh, uv: np.ndarray) -> np.ndarray:
    """The flat sheet with the area of the surface, printed side up."""
    a, b, c = (uv[mesh.faces[:, k]] for k in range(3))
    flat = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum()
    surface = np.linalg.norm(area_vectors(mesh.points, mesh.faces), axis=1).sum()
    return uv * np.sqrt(surface / abs(flat)) * ([1, 1] if flat > 0 else [1, -1])


PEERS: dict[str, tuple[Flatten, int]] = {"LSCM": (lscm, 400_000), "ARAP": (arap, 100_000), "SLIM": (slim, 100_000)}
"""And up to how many points without --heavy."""


def rows(name: str, count: int, noise: float, peers: list[str], heavy: bool):
    mesh, truth = sheet_mesh(sheet(name), count, layout="delaunay", noise_mm=noise)
    found = topology(mesh.faces, len(mesh.points))
    head = f"| {name} | {len(mesh.points):,} | {noise:g} |"
    ours = None
    for label, lengths in (("planish", "smooth"), ("planish, raw lengths", "unfolded")):
        seconds, page_xy = min((planish(mesh, lengths) for _ in range(RUNS)), key=lambda run: run[0])
        ours = ours or seconds
        yield f"{head} {label} | {seconds:.2f} | {seconds / ours:.1f} | {judged(mesh, found, page_xy, truth)} |"
    for peer in peers:
        run, most = PEERS[peer]
        if len(mesh.points) > 1.1 * most and not heavy:
            continue
        start = perf_counter()
        try:
            uv = run(mesh)
        except Exception as error:  # a peer's failure is a result
            yield f"{head} libigl {peer} | failed: {error} | | | | | |"
            continue
        seconds = perf_counter() - start
        found_true = judged(mesh, found, uv * [1, -1], truth)
        yield f"{head} libigl {peer} | {seconds:.2f} | {seconds / ours:.0f} | {found_true} |"


def judged(mesh: Mesh, found: Topology, page_xy: np.ndarray, truth: np.ndarray) -> str:
    if not np.isfinite(page_xy).all():
        return "not finite | | |"
    raw = distances(mesh.points, found.edges)
    return (
        f"{strain(page_xy, found.edges, raw)[0]:.1e} | {rigid_rms(page_xy, truth):.3f} | "
        f"{flipped_faces(mesh.faces, page_xy):,} | {overlaps(mesh.faces, page_xy, found):,}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", nargs="*", type=int, default=[100_000, 300_000, 1_000_000])
    parser.add_argument("--sheets", nargs="*", default=["book", "miura"])
    parser.add_argument("--noise", nargs="*", type=float, default=[0.0, 0.05])
    parser.add_argument("--peers", nargs="*", default=list(PEERS), choices=list(PEERS))
    parser.add_argument("--heavy", action="store_true", help="peers that take minutes, too")
    asked = parser.parse_args()
    print(machine(), "\n")
    print("| sheet | points | noise, mm | method | s | times planish | rms strain | rms mm | flips | overlaps |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name in asked.sheets:
        for count in asked.points:
            for noise in asked.noise:
                for row in rows(name, count, noise, asked.peers, asked.heavy):
                    print(row, flush=True)


if __name__ == "__main__":
    main()
