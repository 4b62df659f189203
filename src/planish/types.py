"""The values that travel between the rooms: arrays kept together, with no behaviour of their own.

Positions are (x, y[, z]) in millimetres; images are [row, col]. Arrays are read-only once a value is made.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]
Pixels = NDArray[np.uint8]


def _freeze(value: object) -> None:
    """Make every array field of a dataclass contiguous and read-only."""
    for f in fields(value):  # type: ignore[arg-type]
        array = getattr(value, f.name)
        if isinstance(array, np.ndarray):
            frozen = np.ascontiguousarray(array).view()
            frozen.flags.writeable = False
            object.__setattr__(value, f.name, frozen)


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh of the printed side of a sheet.

    Attributes
    ----------
    points : (n, 3) float64 [mm]
    faces : (m, 3) int32
        Rows of `points`, counter-clockwise seen from the printed side.
    """

    points: Floats
    faces: Ints

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", np.asarray(self.points, np.float64).reshape(-1, 3))
        object.__setattr__(self, "faces", np.asarray(self.faces, np.int32).reshape(-1, 3))
        _freeze(self)


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera with OpenCV's distortion: pixel ~ matrix @ (rotation @ point + translation).

    Attributes
    ----------
    matrix : (3, 3) float64 [px]
        Focal lengths, principal point (pixel centres at integers).
    rotation : (3, 3) float64
        World to camera; the camera looks along +z, y down.
    translation : (3,) float64 [mm]
    distortion : (k,) float64
        OpenCV's k1 k2 p1 p2 k3 ...; empty for none.
    shape_rc : (int, int)
        Rows and columns of the photo that the numbers belong to.
    """

    matrix: Floats
    rotation: Floats
    translation: Floats
    shape_rc: tuple[int, int]
    distortion: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        _freeze(self)


@dataclass(frozen=True, eq=False)
class Scan:
    """A mesh and the photo that was taken with it.

    Attributes
    ----------
    mesh : Mesh
    photo : (rows, cols, 3) uint8, sRGB, or None
    photo_xy : (n, 2) per point or (m, 3, 2) per face corner, float64 [photo px], or None
        x right, y down, pixel centres at integers.
    camera : Camera or None
        Where the photo was taken from, when that is known.
    """

    mesh: Mesh
    photo: Pixels | None = None
    photo_xy: Floats | None = None
    camera: Camera | None = None

    def __post_init__(self) -> None:
        _freeze(self)


@dataclass(frozen=True, eq=False)
class Sticks:
    """Pairs of points and the distance that each pair must keep: (p1 - p0).(p1 - p0) = rest**2 (eq. 1).

    Attributes
    ----------
    pairs : (s, 2) int32
        The mesh's edges first, then the bending sticks.
    rest : (s,) float64 [mm]
    weight : (s,) float64
    edges : int
        How many of the sticks are edges of the mesh.
    """

    pairs: Ints
    rest: Floats
    weight: Floats
    edges: int

    def __post_init__(self) -> None:
        _freeze(self)


class Outcome(Enum):
    """How a flattening ended; the value is the sentence for the user."""

    SETTLED = "The sheet lies flat on the plane and its sticks have come to rest."
    STALLED = "The sheet stopped moving before all of it reached the plane; it stands arched somewhere."
    OUT_OF_STEPS = "The sheet was still moving when the steps ran out."
    DIVERGED = "The simulation became unstable and was stopped; the last finite state was kept."


@dataclass(frozen=True, eq=False)
class Flattening:
    """Where every point of a mesh lies on the page.

    Attributes
    ----------
    page_xy : (n, 2) float64 [mm]
        x right, y down, origin at the top left corner of the page.
    outcome : Outcome
    method : str
    iterations : int
    residuals : (iterations recorded,) float64
        Root mean square of the sticks' relative error, through the solving.
    heights : (iterations recorded,) float64 [mm]
        Greatest height above the plane, through the solving.
    solved_points : int
        How many points the solver itself moved (fewer than n after decimation).
    seconds : float
        From the mesh in memory to `page_xy` in memory.
    """

    page_xy: Floats
    outcome: Outcome
    method: str
    iterations: int
    residuals: Floats
    heights: Floats
    solved_points: int
    seconds: float

    def __post_init__(self) -> None:
        _freeze(self)


@dataclass(frozen=True, eq=False)
class Page:
    """An image of the flat page.

    Attributes
    ----------
    pixels : (rows, cols) or (rows, cols, 3) uint8, or (rows, cols) bool (True is paper)
    known : (rows, cols) bool
        False where no scanned surface was seen.
    dpi : float
        True pixels per 25.4 mm of page.
    """

    pixels: Pixels | Bools
    known: Bools
    dpi: float

    def __post_init__(self) -> None:
        _freeze(self)
