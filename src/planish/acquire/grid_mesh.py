"""A map of points, one for each pixel of a camera, becomes a mesh that joins nothing across a depth jump."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planish.errors import InputError
from planish.mesh import grid_faces, without_small_components
from planish.types import Bools, Camera, Diagnostic, Floats, Mesh, Scan, freeze

STEEPEST = 8.0
"""Neighbouring pixels whose depths differ by more than so many pixel widths (83 degrees) are not joined: neither
light nor a camera sees paper that steep."""

NOISE_STEPS = 6.0
"""Nor do depths count as a jump that differ by less than so many standard deviations of the noise."""


@dataclass(frozen=True, eq=False)
class AcquiredScan:
    """A scan made from light, and what is known of its quality.

    Attributes
    ----------
    scan : Scan
    confidence : (n,) float64
        Of every point of the scan, from 0 to 1.
    noise_mm : float
        Typical standard deviation of the points along the rays of the camera.
    warnings : tuple of Diagnostic
    """

    scan: Scan
    confidence: Floats
    noise_mm: float
    warnings: tuple[Diagnostic, ...] = ()

    def __post_init__(self) -> None:
        freeze(self)


def grid_mesh(points: Floats, camera: Camera, *, noise_mm: float = 0.0) -> tuple[Mesh, Floats]:
    """Join the points that neighbouring pixels see, except across a depth jump.

    A jump is told in parts of the depth, so that near and far things are treated alike. Small loose pieces, below a
    hundredth of the whole, are left out, and so are single pixels between a near and a far surface.

    Parameters
    ----------
    points : (rows, cols, 3) float64 [mm]
        In the world, along the camera's rays; NaN where nothing was measured.
    camera : Camera
        Its pixels are those of the map.
    noise_mm : float
        Standard deviation of the points' errors along the ray: differences of `NOISE_STEPS` times that are no jump.

    Returns
    -------
    mesh : Mesh
        Faces counter-clockwise as the camera sees them.
    photo_xy : (n, 2) float64 [px]
        Column and row of the pixel that each point came from.

    Raises
    ------
    InputError
        If no three neighbouring pixels see one surface.

    Examples
    --------
    Two flat halves, the right one 30 mm nearer:

    >>> camera = Camera(np.diag([100.0, 100, 1]), np.eye(3), np.zeros(3), (4, 6))
    >>> row, col = np.mgrid[:4, :6]
    >>> depth = np.where(col < 3, 200.0, 170.0)
    >>> mesh, photo_xy = grid_mesh(np.stack([col * depth / 100, row * depth / 100, depth], axis=-1), camera)
    >>> len(mesh.points), len(mesh.faces), photo_xy[:2].tolist()
    (24, 24, [[0.0, 0.0], [1.0, 0.0]])
    """
    known: Bools = np.asarray(np.isfinite(points).all(axis=2))
    camera_points = points[known] @ camera.rotation.T + np.ravel(camera.translation)
    depth = camera_points[:, 2]
    relative = np.column_stack(
        [camera_points[:, :2] / depth[:, None], np.log(depth)]
    )  # a step here is a part of the depth
    typical = float(np.median(depth)) if len(depth) else 1.0
    return mesh_from_grid(
        points, known, relative, max(STEEPEST / camera.matrix[0, 0], NOISE_STEPS * noise_mm / typical)
    )


def mesh_from_grid(points: Floats, known: Bools, relative: Floats, step: float) -> tuple[Mesh, Floats]:
    """Join neighbouring pixels of a map of points whose distances differ by no more than a step.

    Parameters
    ----------
    points : (rows, cols, 3) float64 [mm]
    known : (rows, cols) bool
        Which pixels hold a point.
    relative : (k, d) float64
        Of the known ones, in their order: where each is across the line of sight, in units of the step; the last
        number is how far away it is.
    step : float

    Returns
    -------
    mesh : Mesh
        Without small loose pieces.
    pixel_xy : (n, 2) float64 [px]

    Raises
    ------
    InputError
        If no three neighbouring pixels see one surface.
    """
    index = np.full(known.shape, -1, np.int32)
    index[known] = np.arange(len(relative), dtype=np.int32)
    faces = grid_faces(index, relative, step)
    if not len(faces):
        raise InputError(
            f"{known.sum():,} of {known.size:,} pixels have a depth, and no three neighbours make a surface; is "
            "the unit of the depth right, and the sheet in view?"
        )
    used, faces = without_small_components(faces, len(relative))
    return Mesh(points[known][used], faces), np.argwhere(known)[used][:, ::-1].astype(np.float64)
