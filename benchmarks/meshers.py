"""The mesh that `planish acquire points` makes, beside Open3D's Poisson reconstruction and ball pivoting.

300,000 random points with 0.1 mm of noise on a book page and a letter folded in three, alone and without strays. All
get the same normals. Poisson's surface is cut off farther than two spacings from the points. The error of the page is
over all points of the mesh 2 mm and more from the border. Needs open3d-cpu. Prints a Markdown table.
"""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree

import planish
from acquire import nearest_places
from machine import machine
from planish.acquire.points.normals import fit_tangent_planes, orient_normals
from planish.acquire.points.surface import CELL, reconstruct_surface
from planish.errors import PlanishError
from planish.gallery import Sheet, sheet, sheet_mesh
from planish.mesh import without_small_components
from planish.types import Mesh
from truth import rigid_rms

INSIDE_MM = 2.0


def meshes(points: np.ndarray, normals: np.ndarray, spacing: float) -> Iterator[tuple[str, Mesh, float]]:
    start = perf_counter()
    yield "planish", reconstruct_surface(points, normals, spacing), perf_counter() - start
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    start = perf_counter()
    made, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, width=CELL * spacing, n_threads=2)
    vertices, faces = np.asarray(made.vertices), np.asarray(made.triangles)
    near = cKDTree(points).query(vertices, workers=2)[0] < 2 * spacing
    yield "Poisson", cleaned(vertices, faces[near[faces].all(axis=1)]), perf_counter() - start
    start = perf_counter()
    radii = o3d.utility.DoubleVector([spacing * k for k in (1.0, 1.5, 2.5)])
    made = o3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, radii)
    yield "ball pivoting", cleaned(np.asarray(made.vertices), np.asarray(made.triangles)), perf_counter() - start


def cleaned(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    used, faces = without_small_components(faces.astype(np.int32), len(vertices))
    return Mesh(vertices[used], faces)


def row(bent: Sheet, name: str, mesh: Mesh, seconds: float) -> str:
    true_xy, height = nearest_places(bent, np.asarray(mesh.points))
    size = np.array([bent.width_mm, bent.height_mm])
    inside = ((true_xy > INSIDE_MM) & (true_xy < size - INSIDE_MM)).all(axis=1)
    start = f"| {bent.name} | {name} | {len(mesh.points):,} | {np.sqrt((height[inside] ** 2).mean()):.3f} | "
    try:
        page_xy = planish.flatten(mesh.points, mesh.faces).page_xy
    except PlanishError as problem:
        return f"{start}refused: {problem} | {seconds:.1f} |"
    return f"{start}{rigid_rms(page_xy[inside], true_xy[inside]):.3f} | {seconds:.1f} |"


def main() -> None:
    print(machine(), "\n")
    print(
        "| sheet | mesher | points of the mesh | surface, rms mm | page, rms mm | seconds |\n|---|---|---|---|---|---|"
    )
    for name in ("book", "letter"):
        bent = sheet(name)
        points = np.asarray(sheet_mesh(bent, layout="delaunay", noise_mm=0.1)[0].points)
        found = fit_tangent_planes(points)
        points = points[found.kept]
        up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
        normals = orient_normals(points, found.normals, found.spacing_mm, up)
        for mesher, mesh, seconds in meshes(points, normals, found.spacing_mm):
            print(row(bent, mesher, mesh, seconds), flush=True)


if __name__ == "__main__":
    main()
