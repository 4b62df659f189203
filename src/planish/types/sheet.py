"""A sheet: as it was scanned, as sticks, and laid flat."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from planish.types.arrays import Bools, Floats, Ints, Pixels, freeze
from planish.types.diagnostic import Diagnostic
from planish.types.texture import Texture


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
        freeze(self)


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
        freeze(self)


@dataclass(frozen=True, eq=False)
class View:
    """A further photo of a sheet.

    Attributes
    ----------
    photo : (rows, cols, 3) uint8 or uint16
    camera : Camera
        That took it.
    """

    photo: Pixels
    camera: Camera

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, eq=False)
class Scan:
    """A mesh and the photo that was taken with it.

    Attributes
    ----------
    mesh : Mesh
    photo : (rows, cols, 3) uint8 or uint16, or None
        In the colour space that `icc` names; sRGB where it is None.
    photo_xy : (n, 2) per point or (m, 3, 2) per face corner, float64 [photo px], or None
        x right, y down, pixel centres at integers; with `textures`, per face corner on the image of the face.
    camera : Camera or None
        Where the photo was taken from, when that is known.
    icc : bytes or None
        Colour profile of the photo, handed on to the page.
    others : tuple of View
        Further photos of the same sheet, for what `photo` shows less well or not at all.
    upright : float
        How sure it is that the mesh's y axis points to the head of the text [standard deviations]; 0 where nothing
        but the page itself can tell.
    textures : tuple of Texture
        Instead of `photo`: several images, each shown by a part of the faces.
    texture_of_face : (m,) int32 or None
        The number of each face's image in `textures`; -1 for none.
    colours : (n, 3) uint8 or uint16, sRGB, or None
        Of the points, to be drawn where there is neither a photo nor a texture.
    viewpoint : (3,) float64 [mm] or None
        Where the scanner's rays come from, if it is known that its errors lie along them.
    """

    mesh: Mesh
    photo: Pixels | None = None
    photo_xy: Floats | None = None
    camera: Camera | None = None
    icc: bytes | None = None
    others: tuple[View, ...] = ()
    upright: float = 0.0
    textures: tuple[Texture, ...] = ()
    texture_of_face: Ints | None = None
    colours: Pixels | None = None
    viewpoint: Floats | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def has_picture(self) -> bool:
        """Whether there is anything to draw a page from."""
        return self.photo is not None or bool(self.textures) or self.colours is not None


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
    noise_mm : (n,) float64 [mm] or None
        Standard deviation of the scanner's noise around every point, where it was measured.
    noise_left : float
        Part of it, 0 to 1, that is still in the lengths.
    turned : (m,) bool or None
        Faces of the mesh that noise turned over, where that was looked for: by these lengths their back is up.
    normals : (n, 3) float32 or None
        Of the surface without noise, where they were sought.
    noise_length_mm : float or None
        Distance over which the noise is alike, where there is any.
    spikes : int
        Points far off the surface, which were not counted.
    """

    pairs: Ints
    rest: Floats
    weight: Floats
    edges: int
    noise_mm: Floats | None = None
    noise_left: float = 1.0
    turned: Bools | None = None
    normals: NDArray[np.float32] | None = None
    noise_length_mm: float | None = None
    spikes: int = 0

    def __post_init__(self) -> None:
        freeze(self)


class Outcome(Enum):
    """How a flattening ended; the value is the sentence for the user."""

    SETTLED = "The sheet lies flat on the plane and its sticks have come to rest."
    STALLED = "The sheet stopped moving before all of it reached the plane; it stands arched somewhere."
    CRUSHED = "The sheet lies on the plane, but crushed: its sticks are far from their lengths."
    OUT_OF_STEPS = "The sheet was still moving when the steps ran out."
    DIVERGED = "The simulation became unstable and was stopped; the last finite state was kept."


@dataclass(frozen=True, eq=False)
class Flattening:
    """Where every point of a mesh lies on the page.

    Attributes
    ----------
    page_xy : (n, 2) float64 [mm]
        x right, y down, origin at the top left corner of the page.
    size_mm : (float, float)
        Width and height of the page.
    outcome : Outcome
    method, lengths : str
    solved_points : int
        How many points the solver itself moved; fewer than n after decimation.
    iterations : int
    residuals : (iterations,) float64
        Root mean square of the sticks' relative error, through the solving.
    heights : (iterations,) float64 [mm]
        Greatest height above the plane, through the solving; empty for methods that never leave the plane.
    strain : (float, float)
        Root mean square and greatest relative error of the edges against the rest lengths used.
    error_mm : (n,) float64 [mm]
        Expected distance of every point from its true place, see `planish.flattening.expected`.
    local_strain : (n,) float64
        Root mean square strain of the edges around every point.
    seconds : float
        From the mesh in memory to `page_xy` in memory.
    noise_mm : float or None
        Typical standard deviation of the scanner's noise, where it was measured.
    noise_length_mm : float or None
        Distance over which the noise of two points is alike (correlation 1/2), where there is any.
    spikes : int
        Points far off the surface, which were not counted.
    overlaps : int
        Faces that lie over other parts of the page.
    passed_points : int
        That went through another layer of the sheet on the way down (verlet).
    warnings : tuple of Diagnostic
    normals : (n, 3) float32 or None
        Of the bent sheet without the scanner's noise, where they were sought for all points.
    """

    page_xy: Floats
    size_mm: tuple[float, float]
    outcome: Outcome
    method: str
    lengths: str
    solved_points: int
    iterations: int
    residuals: Floats
    heights: Floats
    strain: tuple[float, float]
    error_mm: Floats
    local_strain: Floats
    seconds: float
    noise_mm: float | None = None
    overlaps: int = 0
    passed_points: int = 0
    warnings: tuple[Diagnostic, ...] = ()
    normals: NDArray[np.float32] | None = None
    noise_length_mm: float | None = None
    spikes: int = 0

    def __post_init__(self) -> None:
        freeze(self)
