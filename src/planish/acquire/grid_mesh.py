"""Mesh an organised point map, one point per camera pixel, without joining points across depth discontinuities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planish.display.one_line import one_line
from planish.errors import InputError
from planish.mesh import grid_faces, without_small_components
from planish.types import Bools, Camera, Diagnostic, Floats, Mesh, Scan, freeze

STEEPEST = 8.0
"""Largest depth step between joined neighbours, in pixel widths (a slope of 83 degrees): steeper paper is neither lit
nor seen."""

NOISE_STEPS = 6.0
"""Depth steps below so many standard deviations of the noise are never a discontinuity."""


@dataclass(frozen=True, eq=False)
class AcquiredScan:
    """An acquired scan with its quality.

    Attributes
    ----------
    scan : Scan
    confidence : (n,) float64
        Confidence of every point, 0 to 1.
    noise_mm : float
        Typical standard deviation of the points, across the surface.
    warnings : tuple of Diagnostic
    noise_length_mm : float or None
        Distance over which the noise of two points is alike (their correlation is a half), where it was measured.
    """

    scan: Scan
    confidence: Floats
    noise_mm: float
    warnings: tuple[Diagnostic, ...] = ()
    noise_length_mm: float | None = None

    __repr__ = one_line

    def __post_init__(self) -> None:
        freeze(self)


def grid_mesh(points: Floats, camera: Camera, *, noise_mm: float = 0.0) -> tuple[Mesh, Floats]:
    """Triangulate the points of neighbouring pixels, except across depth discontinuities.

    Discontinuities are relative to the depth. Components below a hundredth of the whole are removed, and so are single
    pixels between a near and a far surface.

    Parameters
    ----------
    points : (rows, cols, 3) float64 [mm]
        In world coordinates, along the camera's rays; NaN where nothing was measured.
    camera : Camera
        Its pixels are the pixels of the map.
    noise_mm : float
        Standard deviation along the rays: steps of up to `NOISE_STEPS` times that are joined.

    Returns
    -------
    mesh : Mesh
        Faces counter-clockwise as the camera sees them.
    photo_xy : (n, 2) float64 [px]
        Column and row of the pixel of each point.

    Raises
    ------
    InputError
        If no three neighbouring pixels are joined.

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
    relative = np.column_stack([camera_points[:, :2] / depth[:, None], np.log(depth)])  # relative to the depth
    typical = float(np.median(depth)) if len(depth) else 1.0
    return mesh_from_grid(
        points, known, relative, max(STEEPEST / camera.matrix[0, 0], NOISE_STEPS * noise_mm / typical)
    )


def mesh_from_grid(points: Floats, known: Bools, relative: Floats, step: float) -> tuple[Mesh, Floats]:
    """Triangulate neighbouring pixels of a point map whose distances differ by at most a step.

    Parameters
    ----------
    points : (rows, cols, 3) float64 [mm]
    known : (rows, cols) bool
        Pixels with a point.
    relative : (k, d) float64
        Coordinates of the known points across the line of sight, in units of `step`; the last one is the distance.
    step : float

    Returns
    -------
    mesh : Mesh
        Without small components.
    pixel_xy : (n, 2) float64 [px]

    Raises
    ------
    InputError
        If no three neighbouring pixels are joined.
    """
    index = np.full(known.shape, -1, np.int32)
    index[known] = np.arange(len(relative), dtype=np.int32)
    faces = grid_faces(index, relative, step)
    if not len(faces):
        raise InputError(
            f"{known.sum():,} of {known.size:,} pixels have a depth, and no three neighbours form a surface; "
            "is the unit of the depth right, and the sheet in view?"
        )
    used, faces = without_small_components(faces, len(relative))
    return Mesh.owned(points[known][used], faces), np.argwhere(known)[used][:, ::-1].astype(np.float64)
