"""Render a photo from coloured points: the meshed sheet as seen by a distant camera above it."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from planish.geometry import depths, project
from planish.geometry.guards import TINY, normalize
from planish.mesh import point_normals, rasterize
from planish.types import Camera, Floats, Mesh, Pixels

FAR = 3.0
"""Distance of the camera, in extents of the sheet."""

PIXEL = 0.5
"""Pixel size, in point spacings: two pixels per point keep all detail of the colours."""

MOST_PIXELS = 40e6

MARGIN_PX = 8

BLENDED_POINTS = 4
"""Number of nearest points that are blended."""

BLOCK = 200_000


def camera_above(mesh: Mesh, pixel_mm: float) -> Camera:
    """Place a camera above the centre of a mesh, facing its printed side, with a given pixel size.

    Image columns follow the world's x axis as far as possible.
    """
    points = mesh.points
    upward = normalize(point_normals(points, mesh.faces).mean(axis=0))
    right = np.array([1.0, 0, 0]) if abs(upward[0]) < 0.9 else np.array([0.0, 1, 0])
    right -= (right @ upward) * upward
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(-upward, right), -upward])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    distance = FAR * float(np.linalg.norm(np.ptp(points, axis=0)))
    seen = (points - middle) @ rotation.T + [0, 0, distance]
    flat = seen[:, :2] / seen[:, 2:]
    span = np.ptp(flat, axis=0)
    focal = distance / pixel_mm
    focal = min(focal, float(np.sqrt(MOST_PIXELS / max(span.prod(), TINY))))
    cols, rows = (int(np.ceil(focal * side)) + 2 * MARGIN_PX for side in span)
    centre = MARGIN_PX - focal * flat.min(axis=0)
    matrix = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]])
    return Camera(matrix, rotation, np.array([0, 0, distance]) - rotation @ middle, (rows, cols))


def render_points(mesh: Mesh, camera: Camera, points: Floats, colours: Pixels) -> Pixels:
    """Render a mesh in the colours of the points it was made from.

    Outside of the mesh the nearest colours are repeated, since black would bleed into it.

    Parameters
    ----------
    mesh : Mesh
    camera : Camera
        Without distortion.
    points : (n, 3) float64 [mm]
    colours : (n, 3) uint8 or uint16
        Pixels blend the nearest four points by inverse squared distance.

    Returns
    -------
    (rows, cols, 3) uint8 or uint16
    """
    face, weights = rasterize(
        project(camera, mesh.points),
        mesh.faces,
        camera.shape_rc,
        nearness=1 / depths(camera, mesh.points),
        perspective=True,
    )
    row, col = np.nonzero(face >= 0)
    photo = np.zeros((*camera.shape_rc, 3), colours.dtype)
    if not len(row):
        return photo
    tree = cKDTree(points)
    for first in range(0, len(row), BLOCK):
        r, c = row[first : first + BLOCK], col[first : first + BLOCK]
        w = weights[r, c].astype(np.float64)
        shares = np.column_stack([1 - w.sum(axis=1), w])
        position = (shares[..., None] * mesh.points[mesh.faces[face[r, c]]]).sum(axis=1)
        distance, near = tree.query(position, min(BLENDED_POINTS, len(points)), workers=2)
        weight = 1 / np.maximum(distance.reshape(len(r), -1), 1e-6) ** 2
        blended = (weight[..., None] * colours[near.reshape(len(r), -1)]).sum(axis=1) / weight.sum(
            axis=1, keepdims=True
        )
        photo[r, c] = np.rint(blended)
    nearest = ndimage.distance_transform_edt(face < 0, return_distances=False, return_indices=True)
    return np.asarray(photo[nearest[0], nearest[1]])
