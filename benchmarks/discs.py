"""Discs that are no paper, beside as-rigid-as-possible and SLIM: strain, flips, seconds.

    python benchmarks/discs.py [MESH.obj ...] [--slim N]

Flattens public meshes where they lie beside the checkout (../shared/data/field/meshes, ../shared/data/field/hulk), and
built ones otherwise: a dome, a saddle and one or many noses as a height over a rectangle. ARAP is libigl's, 100
iterations from its LSCM; SLIM is libigl's, symmetric Dirichlet, 8 iterations from the same LSCM, on meshes of up to N
points (5,000 unless told otherwise). Meshes are scaled to 1 m.

Strain is that of the edges against their lengths in space, rms and the greatest, without edges that belong only to
faces without area; flips are faces with area that lie on their back. A skirt comes with its sewing pattern; how far the
page is from that is printed beside, at the scale of 1 m. Prints a Markdown table; failures stay in it.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter

import numpy as np

import planish
from flattening import lscm, slim
from machine import machine
from planish.geometry.distances import distances
from planish.io import read_scan
from planish.mesh import edges_with_area, topology
from planish.report import flipped_faces
from planish.sticks import strain
from planish.types import Mesh
from truth import rigid_rms

SHARED = Path(__file__).resolve().parents[2] / "shared/data/field"
SIDE = 1000.0


def built() -> Iterator[tuple[str, Mesh]]:
    """Heights over a rectangle of 200 x 280 mm, 1,271 points."""
    u, v = np.meshgrid(np.linspace(-1, 1, 31), np.linspace(-1, 1, 41))
    i = np.arange(41 * 31).reshape(41, 31)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel()
    faces = np.r_[np.c_[a, b, d], np.c_[a, d, c]].astype(np.int32)
    r2 = u**2 + v**2
    heights = {
        "dome": 160 * np.sqrt(np.maximum(1 - 0.49 * r2, 0)),
        "nose": 260 * np.exp(-6 * r2),
        "noses": 120 * np.cos(7 * u) * np.cos(7 * v),
        "saddle": 120 * (u**2 - v**2),
    }
    for name, z in heights.items():
        yield f"{name} (built)", Mesh(np.c_[100 * u.ravel(), 140 * v.ravel(), z.ravel()], faces)


def read(path: Path) -> Mesh:
    """A mesh scaled to 1 m, whatever its unit."""
    error: planish.InputError | None = None
    for units in ("mm", "cm", "m"):
        try:
            mesh = read_scan(path, units=units).scan.mesh
            return Mesh(mesh.points * (SIDE / np.ptp(mesh.points, axis=0).max()), mesh.faces)
        except planish.InputError as refused:
            error = refused
    raise error or planish.InputError(f"{path} cannot be read")


def arap(mesh: Mesh) -> np.ndarray:
    import igl

    start = lscm(mesh)
    data = igl.ARAPData()
    data.max_iter = 100
    held = np.zeros(1, np.int32)  # without a point held its matrix is singular
    igl.arap_precomputation(mesh.points, mesh.faces.astype(np.int64), 2, held, data)
    return np.asarray(igl.arap_solve(start[held], data, start))


def ours(mesh: Mesh) -> np.ndarray:
    return planish.flatten(mesh).page_xy * [1, -1]


def judged(mesh: Mesh, uv: np.ndarray, pattern: np.ndarray | None) -> str:
    found = topology(mesh.faces, len(mesh.points))
    lengths = distances(mesh.points, found.edges)
    lengths[~edges_with_area(lengths, found.face_edges)] = 0.0
    rms, greatest = strain(uv, found.edges, lengths)
    flips = flipped_faces(mesh.faces, uv * [1, -1], mesh.points)
    off = "" if pattern is None else f"{rigid_rms(uv, pattern):.1f}"
    return f"{100 * rms:.2f} | {100 * greatest:.1f} | {flips:,} | {off}"


def pattern_of(path: Path, mesh: Mesh) -> np.ndarray | None:
    """The sewing pattern beside a mesh, scaled as the mesh was."""
    beside = path.with_name(path.name.replace("_3D_", "_UV_"))
    if beside == path or not beside.exists():
        return None
    here, there = (read_scan(one, units="cm").scan.mesh.points for one in (path, beside))
    return there[:, :2] * (np.ptp(mesh.points, axis=0).max() / np.ptp(here, axis=0).max())


def rows(name: str, mesh: Mesh, pattern: np.ndarray | None, most_slim: int) -> Iterator[str]:
    methods: list[tuple[str, Callable[[Mesh], np.ndarray]]] = [("planish", ours), ("libigl ARAP", arap)]
    if len(mesh.points) <= most_slim:
        methods.append(("libigl SLIM", slim))
    for label, run in methods:
        head = f"| {name} | {len(mesh.points):,} | {label} |"
        start = perf_counter()
        try:
            uv = run(mesh)
        except Exception as error:  # a peer's failure is a result
            yield f"{head} failed: {error} | | | | |"
            continue
        yield f"{head} {judged(mesh, uv, pattern)} | {perf_counter() - start:.1f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", nargs="*", type=Path)
    parser.add_argument("--slim", type=int, default=5000, metavar="N")
    options = parser.parse_args()
    paths = options.meshes or sorted([*SHARED.glob("meshes/*.obj"), *SHARED.glob("hulk/*.obj")])
    meshes = [(path.stem, read(path), path) for path in paths if "_UV_" not in path.name]
    print(machine())
    print()
    print("| mesh | points | method | strain, rms % | greatest % | flips | mm from the pattern | seconds |")
    print("|---|---|---|---|---|---|---|---|")
    ours(next(built())[1])  # compiles the kernels
    for name, mesh, path in meshes:
        for row in rows(name, mesh, pattern_of(path, mesh), options.slim):
            print(row, flush=True)
    if not paths:
        for name, mesh in built():
            for row in rows(name, mesh, None, options.slim):
                print(row, flush=True)


if __name__ == "__main__":
    main()
