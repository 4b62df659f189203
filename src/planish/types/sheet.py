"""Meshes, cameras, scans, sticks and flattenings."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from planish.display.one_line import one_line, shape_of
from planish.types.arrays import Bools, Floats, Ints, Pixels, freeze, frozen_copy, trusted
from planish.types.checks import (
    check_camera_size,
    check_faces,
    check_mask,
    check_photo,
    check_photo_xy,
    check_place,
    check_places_on,
    check_points,
    check_sides,
    check_view,
)
from planish.types.diagnostic import Diagnostic
from planish.types.foreign_meshes import mesh_arrays
from planish.types.texture import Texture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from planish.display.plot import PlotValues


@dataclass(frozen=True, eq=False, init=False)
class Mesh:
    """A triangle mesh of the printed side of a sheet.

    What is given is checked, and copied unless nobody can change it: a mesh is never changed afterwards.

    Parameters
    ----------
    points : (n, 3) array_like [mm], or a mesh of trimesh, Open3D or PyVista
    faces : (m, 3) array_like of int
        Rows of `points`, counter-clockwise seen from the printed side.

    Attributes
    ----------
    points : (n, 3) float64 [mm]
    faces : (m, 3) int32

    Raises
    ------
    InputError
        For quads, transposed or masked arrays, faces that are not whole numbers, indices that no point has.

    Examples
    --------
    >>> Mesh([[0, 0, 0], [210, 0, 0], [0, 297, 0]], [[0, 1, 2]])
    Mesh(3 points, 1 face)
    >>> Mesh([[0, 0, 0], [210, 0, 0], [210, 297, 0], [0, 297, 0]], [[0, 1, 2, 3]])
    Traceback (most recent call last):
        ...
    planish.errors.InputError: faces have the shape (1, 4); (m, 3) is wanted, ...; split each of these quads into ...
    """

    points: Floats
    faces: Ints

    def __init__(self, points: Any, faces: Any = None) -> None:
        if faces is None:
            points, faces = mesh_arrays(points)
        checked = check_points(points)
        object.__setattr__(self, "points", checked)
        object.__setattr__(self, "faces", check_faces(faces, len(checked)))

    @classmethod
    def owned(cls, points: NDArray[Any], faces: NDArray[Any]) -> Mesh:
        """Make a mesh of arrays that are known to be right and that nobody else changes: no check, no copy."""
        return trusted(cls, points=np.asarray(points, np.float64), faces=np.asarray(faces, np.int32))

    def __repr__(self) -> str:
        n, m = len(self.points), len(self.faces)
        return f"Mesh({n:,} point{'' if n == 1 else 's'}, {m:,} face{'' if m == 1 else 's'})"


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
        for name in ("matrix", "rotation", "translation", "distortion"):
            given = getattr(self, name)
            object.__setattr__(self, name, frozen_copy(np.asarray(given, np.float64), given))

    def __repr__(self) -> str:
        rows, cols = self.shape_rc
        f = np.asarray(self.matrix)[[0, 1], [0, 1]]
        return f"Camera({cols} x {rows} px, focal lengths {f[0]:.1f} and {f[1]:.1f} px)"


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
        object.__setattr__(self, "photo", check_photo(self.photo))

    @classmethod
    def owned(cls, photo: Pixels, camera: Camera) -> View:
        """Make a view of pixels that are known to be right and that nobody else changes: no check, no copy."""
        return trusted(cls, photo=photo, camera=camera)

    def __repr__(self) -> str:
        return f"View({shape_of(self.photo)}, {self.camera!r})"


@dataclass(frozen=True, eq=False)
class Scan:
    """A mesh and the photo that was taken with it.

    What is given is checked, and copied unless nobody can change it. The mesh may be any object with `vertices` and
    `faces`; the photo may be grey (rows, cols), or floats from 0 to 1 as scikit-image has them, which become uint16;
    `photo_xy` may be a list.

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
    sheet : (h, w) bool or None
        Where `photo` shows the sheet, of its size or proportions; faces elsewhere are left out.
    sheet_view : (2, 4) float64 or None
        Where `sheet` is no mask on the photo but one on a view of the mesh from afar: column and row [px of `sheet`]
        are this times (x, y, z, 1).
    paper_mm : (float, float) or None
        Sides of the paper, where its format is known and the mesh has its size: a page that is as large, but for the
        raggedness of a measured outline, is exactly so large.
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
    sheet: Bools | None = None
    sheet_view: Floats | None = None
    paper_mm: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, Mesh):
            object.__setattr__(self, "mesh", Mesh(self.mesh))
        if self.photo is not None:
            object.__setattr__(self, "photo", check_photo(self.photo))
        if self.photo_xy is not None:
            places = check_photo_xy(self.photo_xy, len(self.mesh.points), len(self.mesh.faces))
            object.__setattr__(self, "photo_xy", places)
            if self.photo is not None:
                check_places_on(self.photo, places)
        if self.photo is not None and self.camera is not None:
            check_camera_size(self.photo, self.camera.shape_rc)
        if self.viewpoint is not None:
            object.__setattr__(self, "viewpoint", check_place(self.viewpoint, "the viewpoint"))
        if self.sheet is not None:
            object.__setattr__(self, "sheet", check_mask(self.sheet))
        if self.sheet_view is not None:
            object.__setattr__(self, "sheet_view", check_view(self.sheet_view))
        if self.paper_mm is not None:
            object.__setattr__(self, "paper_mm", check_sides(self.paper_mm))
        for name in ("texture_of_face", "colours"):
            given = getattr(self, name)
            if given is not None:
                object.__setattr__(self, name, frozen_copy(np.asarray(given), given))
        object.__setattr__(self, "others", tuple(self.others))

    @classmethod
    def owned(
        cls,
        mesh: Mesh,
        photo: Pixels | None = None,
        photo_xy: Floats | None = None,
        camera: Camera | None = None,
        **more: Any,
    ) -> Scan:
        """Make a scan of arrays that are known to be right and that nobody else changes: no check, no copy."""
        return trusted(cls, mesh=mesh, photo=photo, photo_xy=photo_xy, camera=camera, **more)

    def __repr__(self) -> str:
        parts = [repr(self.mesh), "no photo" if self.photo is None else f"photo {shape_of(self.photo)}"]
        if self.photo_xy is not None:
            parts.append(f"photo_xy per {'point' if self.photo_xy.ndim == 2 else 'corner'}")
        parts += [repr(self.camera)] if self.camera is not None else []
        parts += [f"icc {len(self.icc):,} bytes"] if self.icc is not None else []
        parts += [f"{len(self.others)} more photos"] if self.others else []
        return f"Scan({', '.join(parts)})"

    @property
    def has_picture(self) -> bool:
        """Whether there is anything to draw a page from."""
        return self.photo is not None or bool(self.textures) or self.colours is not None


class Doubt(Enum):
    """Why what was taken for noise may be the sheet's shape; the value says it in a few words."""

    BUCKLES = "by the new lengths the sheet buckles more in most places than by the raw ones"
    STRONG = "noise as large as the edges, which neighbours share, looks like folds and facets"


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
    bias_mm : float
        Expected error of the page, rms, from what smoothing takes off the sheet's bends.
    turned : (m,) bool or None
        Faces of the mesh that noise turned over, where that was looked for: by these lengths their back is up.
    normals : (n, 3) float32 or None
        Of the surface without noise, where they were sought.
    noise_length_mm : float or None
        Distance over which the noise is alike, where there is any.
    spikes : int
        Points far off the surface, which were not counted.
    doubt : Doubt or None
        Why lengths that were made without noise are to be held against raw ones.
    """

    pairs: Ints
    rest: Floats
    weight: Floats
    edges: int
    noise_mm: Floats | None = None
    noise_left: float = 1.0
    bias_mm: float = 0.0
    turned: Bools | None = None
    normals: NDArray[np.float32] | None = None
    noise_length_mm: float | None = None
    spikes: int = 0
    doubt: Doubt | None = None

    __repr__ = one_line

    def __post_init__(self) -> None:
        freeze(self)


class Outcome(Enum):
    """How a flattening ended; each value is the sentence for the user."""

    SETTLED = "The sheet lies flat on the plane and its sticks have come to rest."
    STALLED = "The sheet stopped moving before all of it reached the plane; it stands arched somewhere."
    CRUSHED = "The sheet lies on the plane, but crushed: its sticks are far from their lengths."
    OUT_OF_STEPS = "The sheet was still moving when the steps ran out."
    DIVERGED = "The simulation became unstable and was stopped; the last finite state was kept."


@dataclass(frozen=True, eq=False)
class Flattening:
    """Position of every point of a mesh on the flat page.

    Attributes
    ----------
    page_xy : (n, 2) float64 [mm]
        x right, y down, origin at the top left corner of the page.
    size_mm : (float, float)
        Width and height of the page.
    outcome : Outcome
    method, lengths : str
    solved_points : int
        Points that the solver moved; fewer than n after decimation.
    iterations : int
    residuals : (iterations,) float64
        Rms relative error of the sticks, per iteration.
    heights : (iterations,) float64 [mm]
        Greatest height above the plane, per iteration; empty for methods that stay in the plane.
    strain : (float, float)
        Rms and greatest relative error of the edges against the rest lengths used.
    stretch : (float, float) or None
        L2 and L-infinity stretch (Sander et al. 2001) over the surface that has these lengths, that is without noise;
        None where the sticks are not the edges of triangles (mass-spring).
    error_mm : (n,) float64 [mm]
        Expected distance of every point from its true position; see `planish.flattening.expected`.
    local_strain : (n,) float64
        Rms strain of the edges around every point.
    face_strain : (m,) float64 or None
        Rms strain of the three edges of every face against the rest lengths used; of a decimated mesh, that around
        its corners. NaN for faces that were left out.
    seconds : float
        From the mesh in memory to `page_xy` in memory.
    noise_mm : float or None
        Typical standard deviation of the scanner's noise, where it was measured.
    noise_length_mm : float or None
        Distance over which the noise of two points is alike (correlation 1/2), where there is any.
    spikes : int
        Points far off the surface, which were not counted.
    overlaps : int
        Faces that overlap other parts of the page.
    passed_points : int
        Points that passed through another layer of the sheet (verlet).
    warnings : tuple of Diagnostic
    normals : (n, 3) float32 or None
        Noise-free normals of the bent sheet, where they were computed for all points.
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
    stretch: tuple[float, float] | None = None
    face_strain: Floats | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def uv(self) -> Floats:
        """(n, 2) float64 [mm] the same places for programs about meshes: u right, v up, origin at the bottom left."""
        return np.column_stack([self.page_xy[:, 0], self.size_mm[1] - self.page_xy[:, 1]])

    def plot(self, values: PlotValues = "error", ax: Axes | None = None) -> Axes:
        """Draw the flat sheet in colours with matplotlib (extra `planish[plot]`).

        Parameters
        ----------
        values : {"error", "strain"}
            Expected error of the points in mm, or local strain in %.
        ax : matplotlib.axes.Axes, optional
            Where to draw. By default in a new figure.

        Raises
        ------
        MissingExtraError
            Where matplotlib is not installed.
        """
        from planish.display.plot import plot_flattening

        return plot_flattening(self, values, ax)

    def __repr__(self) -> str:
        width, height = self.size_mm
        return (
            f"Flattening({len(self.page_xy):,} points on {width:.1f} x {height:.1f} mm, {self.outcome.name.lower()} "
            f"after {self.iterations} steps of {self.method}, strain {self.strain[0]:.1e} rms)"
        )
