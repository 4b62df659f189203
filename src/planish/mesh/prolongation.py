"""From the places of a few points, on the page or in space, to those of all: the way back from a sub-sampled mesh."""

from __future__ import annotations

import numpy as np
from numba import njit

from planish.geometry.guards import TINY
from planish.mesh.adjacency import faces_around
from planish.mesh.decimation import Coarse
from planish.parallel import thread_pool
from planish.types import Floats, Ints


def prolongate(coarse: Coarse, points: Floats, places: Floats, normals: Floats | None = None) -> Floats:
    """Give every point of the fine mesh its place, smoothly, from the places to which the coarse points went.

    Around each coarse point k the flattening is close to a linear map J_k, the mean of the maps of the faces around
    it. A fine point p in a face with corners k goes to  sum_k w_k (x_k + J_k (p - P_k)),  with weights w_k that
    change smoothly from corner to corner. Where all J_k agree this is the linear map itself; a point at P_k goes to
    x_k; a point outside the coarse border is carried on straight.

    Parameters
    ----------
    coarse : Coarse
    points : (n, 3) float64 [mm]
        Of the fine mesh, in the frame in which it was sub-sampled.
    places : (k, d) float64 [mm]
        Of the coarse points: on the page (d = 2), or in space, of one state of the sheet after the other.
    normals : (m, d) float64, optional
        Where the unit normals of the coarse faces went. With them fine points keep their distance from the faces;
        without, as on a page, it is dropped.

    Returns
    -------
    (n, d) float64 [mm]
    """
    mesh = coarse.mesh
    start, order = faces_around(mesh.faces, len(mesh.points))
    maps = _point_maps(mesh.points, mesh.faces, places, normals)
    out = np.empty((len(points), places.shape[1]))
    with thread_pool() as parallel_for:
        net = mesh.points, mesh.faces, order, start
        parallel_for(_carry, len(points), points, coarse.nearest, *net, maps, places, out)
    return out


def _point_maps(points: Floats, faces: Ints, places: Floats, normals: Floats | None) -> Floats:
    """(k, d, 3) linear map from space to places around every point: the mean over its faces, weighted by area."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    edges = np.stack([b - a, c - a], axis=2)  # (m, 3, 2)
    moved = np.stack([places[faces[:, k]] - places[faces[:, 0]] for k in (1, 2)], axis=2)  # (m, d, 2)
    upright = np.cross(b - a, c - a)
    area = 0.5 * np.linalg.norm(upright, axis=1)
    maps = moved @ np.linalg.pinv(edges, rcond=1e-6)  # zero along the normal
    if normals is not None:
        maps += normals[:, :, None] * (upright / np.maximum(2 * area, TINY)[:, None])[:, None, :]
    total = np.zeros((len(points), places.shape[1], 3))
    weight = np.full(len(points), TINY)
    for k in range(3):
        np.add.at(total, faces[:, k], area[:, None, None] * maps)
        np.add.at(weight, faces[:, k], area)
    return np.asarray(total / weight[:, None, None])


@njit(cache=True, nogil=True)
def _carry(first, last, points, nearest, corners, faces, order, start, maps, places, out):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        face, b0, b1, b2 = _closest_face(px, py, pz, nearest[i], corners, faces, order, start)
        out[i] = 0.0
        total = 0.0
        for k in range(3):
            b = b0 if k == 0 else (b1 if k == 1 else b2)
            c = faces[face, k]
            ax, ay, az = px - corners[c, 0], py - corners[c, 1], pz - corners[c, 2]
            w = b * b * (3.0 - 2.0 * b)
            for d in range(out.shape[1]):
                out[i, d] += w * (places[c, d] + maps[c, d, 0] * ax + maps[c, d, 1] * ay + maps[c, d, 2] * az)
            total += w
        for d in range(out.shape[1]):
            out[i, d] /= total


@njit(cache=True, nogil=True)
def _closest_face(px, py, pz, first, corners, faces, order, start):  # type: ignore[no-untyped-def]
    """The coarse face closest to p, found by walking from the faces of one of its points to those of the next.

    Returned with the barycentric place in it that is closest.
    """
    best, face = np.inf, order[start[first]]
    b0, b1, b2 = 1.0, 0.0, 0.0
    for walk in range(8):  # the right face is nearly always at the first point or beside it
        better = False
        from_face = face
        for corner in range(1 if walk == 0 else 3):
            at = first if walk == 0 else faces[from_face, corner]
            for q in range(start[at], start[at + 1]):
                f = order[q]
                d, w0, w1, w2 = _distance_to_face(px, py, pz, corners, faces[f, 0], faces[f, 1], faces[f, 2])
                if d < best:
                    best, face, b0, b1, b2, better = d, f, w0, w1, w2, True
        if not better:
            break
    return face, b0, b1, b2


@njit(cache=True, nogil=True)
def _dot(x0, y0, z0, x1, y1, z1):  # type: ignore[no-untyped-def]
    return x0 * x1 + y0 * y1 + z0 * z1


@njit(cache=True, nogil=True)
def _distance_to_face(px, py, pz, corners, a, b, c):  # type: ignore[no-untyped-def]
    """Squared distance of p to a triangle and the barycentric place of its closest point (Ericson 2005, 5.1.5)."""
    ax, ay, az = corners[a, 0], corners[a, 1], corners[a, 2]
    ux, uy, uz = corners[b, 0] - ax, corners[b, 1] - ay, corners[b, 2] - az  # a to b
    vx, vy, vz = corners[c, 0] - ax, corners[c, 1] - ay, corners[c, 2] - az  # a to c
    qx, qy, qz = px - ax, py - ay, pz - az
    uu, uv, vv = _dot(ux, uy, uz, ux, uy, uz), _dot(ux, uy, uz, vx, vy, vz), _dot(vx, vy, vz, vx, vy, vz)
    d1, d2 = _dot(ux, uy, uz, qx, qy, qz), _dot(vx, vy, vz, qx, qy, qz)
    d3, d4, d5, d6 = d1 - uu, d2 - uv, d1 - uv, d2 - vv
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        w1, w2 = 0.0, 0.0
    elif d3 >= 0 and d4 <= d3:
        w1, w2 = 1.0, 0.0
    elif d6 >= 0 and d5 <= d6:
        w1, w2 = 0.0, 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        w1, w2 = (d1 / (d1 - d3) if d1 > d3 else 0.5), 0.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        w1, w2 = 0.0, (d2 / (d2 - d6) if d2 > d6 else 0.5)
    elif va <= 0 and d4 >= d3 and d5 >= d6:
        along = d4 - d3 + d5 - d6
        w2 = (d4 - d3) / along if along > 0 else 0.5
        w1 = 1.0 - w2
    else:
        w1, w2 = vb / (va + vb + vc), vc / (va + vb + vc)
    rx, ry, rz = qx - w1 * ux - w2 * vx, qy - w1 * uy - w2 * vy, qz - w1 * uz - w2 * vz
    return _dot(rx, ry, rz, rx, ry, rz), 1.0 - w1 - w2, w1, w2
