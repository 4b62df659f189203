"""The values that travel between the rooms: arrays kept together, with no behaviour of their own.

Positions are (x, y[, z]) in millimetres; images are [row, col]. Arrays are read-only once a value is made.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]
Pixels = NDArray[np.uint8] | NDArray[np.uint16]


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
        _freeze(self)


@dataclass(frozen=True, eq=False)
class Scan:
    """A mesh and the photo that was taken with it.

    Attributes
    ----------
    mesh : Mesh
    photo : (rows, cols, 3) uint8 or uint16, or None
        In the colour space that `icc` names; sRGB where it is None.
    photo_xy : (n, 2) per point or (m, 3, 2) per face corner, float64 [photo px], or None
        x right, y down, pixel centres at integers.
    camera : Camera or None
        Where the photo was taken from, when that is known.
    icc : bytes or None
        Colour profile of the photo, handed on to the page.
    others : tuple of View
        Further photos of the same sheet, for what `photo` shows less well or not at all.
    """

    mesh: Mesh
    photo: Pixels | None = None
    photo_xy: Floats | None = None
    camera: Camera | None = None
    icc: bytes | None = None
    others: tuple[View, ...] = ()

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
    noise_mm : (n,) float64 [mm] or None
        Standard deviation of the scanner's noise around every point, where it was measured.
    noise_left : float
        Part of it, 0 to 1, that is still in the lengths.
    turned : (m,) bool or None
        Faces of the mesh that noise turned over, where that was looked for: by these lengths their back is up.
    normals : (n, 3) float32 or None
        Of the surface without noise, where they were sought.
    """

    pairs: Ints
    rest: Floats
    weight: Floats
    edges: int
    noise_mm: Floats | None = None
    noise_left: float = 1.0
    turned: Bools | None = None
    normals: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        _freeze(self)


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
    overlaps : int
        Faces that lie over other parts of the page.
    passed_points : int
        That went through another layer of the sheet on the way down (verlet).
    warnings : tuple of str
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
    warnings: tuple[str, ...] = ()
    normals: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        _freeze(self)


@dataclass(frozen=True, eq=False)
class Page:
    """An image of the flat page.

    Attributes
    ----------
    pixels : (rows, cols) or (rows, cols, 3) uint8 or uint16, or (rows, cols) bool (True is paper)
    known : (rows, cols) bool
        False where no scanned surface was seen.
    dpi : float
        True pixels per 25.4 mm of page.
    icc : bytes or None
        Colour profile of the pixels; sRGB where it is None.
    """

    pixels: Pixels | Bools
    known: Bools
    dpi: float
    icc: bytes | None = None

    def __post_init__(self) -> None:
        _freeze(self)


@dataclass(frozen=True)
class Spine:
    """Where a sheet is two pages of a book: an upright line on the flat sheet.

    Attributes
    ----------
    x_mm : float
        From the sheet's left side.
    turn_deg : float
        By how much the paper turns there, into a valley; 0 where the surface does not show the spine.
    found_by : {"surface", "gutter", "middle"}
        From the surface; from the widest upright gap in the print; or the middle, where there is neither.
    crossed : bool
        Whether lines of print run across it.
    """

    x_mm: float
    turn_deg: float
    found_by: Literal["surface", "gutter", "middle"]
    crossed: bool = False


@dataclass(frozen=True)
class ScanReport:
    """What came in.

    Attributes
    ----------
    points, faces : int
        As in the file.
    pieces, holes : int
    unit : str
        The unit that the file's numbers were taken to be in.
    noise_mm : float or None
        Typical standard deviation of the scanner's noise, where it was measured.
    """

    points: int
    faces: int
    pieces: int
    holes: int
    unit: str = "mm"
    noise_mm: float | None = None


@dataclass(frozen=True)
class FlattenReport:
    """How true the flat sheet is to the surface.

    Attributes
    ----------
    method, lengths : str
    points : int
        That the solver moved.
    iterations : int
    seconds : float
        From the mesh in memory to every point's place on the page in memory.
    strain_rms, strain_max : float
        Of the solver's edges against the rest lengths used.
    strain_raw_rms : float
        Of all edges of the scan against their raw 3D lengths (a scan's noise shows here).
    stretch_l2, stretch_linf : float
        Sander's, over all faces of the scan; 1 is perfect.
    flipped_faces : int
        Of the scan, with their back up on the page.
    overlaps : int
        Faces of the scan that lie over other parts of the page.
    passed_points : int
        Of the solver, that went through another layer of the sheet on the way down (verlet).
    expected_error_mm : float
        Rms distance of the scan's points from their true places on the page, as far as strain and noise tell.
    """

    method: str
    lengths: str
    points: int
    iterations: int
    seconds: float
    strain_rms: float
    strain_max: float
    strain_raw_rms: float
    stretch_l2: float
    stretch_linf: float
    flipped_faces: int
    overlaps: int
    passed_points: int
    expected_error_mm: float


@dataclass(frozen=True)
class PageReport:
    """The page: its size, and how well the photo shows it (None where no photo was drawn).

    Attributes
    ----------
    width_mm, height_mm : float
    dpi : float or None
    effective_ppi_p10, effective_ppi_median : float or None
        Photo pixels per inch of page, in the direction where they are fewest, over the area of the page.
    known_fraction : float or None
        Share of the page's pixels that the scan and the photo saw.
    photo_parts : list of float
        Of what was seen, the part that each photo shows best, in the order in which they were given.
    missing_regions : int or None
        Parts of the page that were not seen, each at least 1 mm wide somewhere.
    missing_mm2 : float or None
        Their area.
    """

    width_mm: float
    height_mm: float
    dpi: float | None = None
    effective_ppi_p10: float | None = None
    effective_ppi_median: float | None = None
    known_fraction: float | None = None
    photo_parts: list[float] = field(default_factory=list)
    missing_regions: int | None = None
    missing_mm2: float | None = None


@dataclass(frozen=True)
class PartReport:
    """One page of the sheet, as it was written.

    Attributes
    ----------
    side : {"whole", "left", "right"}
    left_mm : float
        Of its left side, from the sheet's.
    width_mm, height_mm : float
    """

    side: Literal["whole", "left", "right"]
    left_mm: float
    width_mm: float
    height_mm: float


@dataclass(frozen=True)
class ShadingReport:
    """How well the shade was taken off the page.

    Attributes
    ----------
    method : str
        "geometry" or "background".
    paper_share : float
        Part of the page that the light was found from.
    unevenness_before, unevenness : float
        From the 10 % to the 90 % quantile of the blank paper's grey, in parts of white.
    clipped_share : float
        Part of the page that is clipped in the photo: how bright it was there is not known.
    """

    method: str
    paper_share: float
    unevenness_before: float
    unevenness: float
    clipped_share: float


@dataclass(frozen=True)
class PhotoReport:
    """What one photo told of a sheet's shape.

    Attributes
    ----------
    shape : str
        What it was found from: "text-lines", "borders", "text-lines and borders", "shading" or "polynomial".
    scale : str
        Where the size in mm comes from: "unknown" (a guess from the size of the letters), "width" or "paper".
    focal_px : float [photo px]
    focal_from : str
        "exif" or "assumed".
    lines, letters : int
        Of text that were used.
    straightness : float or None
        How far letters are off straight lines on the page (rms), in heights of their letters.
    bent_one_way : float or None
        The same before the part was added by which the sheet is not bent in one direction only.
    extrapolated_share : float
        Part of the page that lies outside of all that the shape was found from.
    confidence : str
        All this in a sentence.
    """

    shape: str
    scale: str
    focal_px: float
    focal_from: str
    lines: int
    letters: int
    straightness: float | None
    bent_one_way: float | None
    extrapolated_share: float
    confidence: str


@dataclass(frozen=True)
class Criterion:
    """One figure of a page beside the limits that a guideline sets.

    Attributes
    ----------
    name, unit : str
    value : float
    limits : (float, float, float, float)
        For one star to four.
    stars : int
        How many it reaches; 0 is none.
    """

    name: str
    unit: str
    value: float
    limits: tuple[float, float, float, float]
    stars: int


@dataclass(frozen=True)
class GuidelineReport:
    """Where the page stands in a guideline of digitisation.

    Attributes
    ----------
    name : str
        The guideline's, with its edition and the kind of material.
    criteria : list of Criterion
    not_graded : list of str
        What the guideline asks for and this program cannot tell.
    """

    name: str
    criteria: list[Criterion]
    not_graded: list[str]


@dataclass(frozen=True)
class Report:
    """An account of one restoration in plain numbers and sentences; `dataclasses.asdict` of it is the JSON.

    Attributes
    ----------
    version : str
    outcome : str
        The sentence of the `Outcome`.
    settled : bool
    seconds_total : float
    seconds : dict
        Per stage.
    scan, flatten, page, shading, photo : see there
        shading is None where none was removed, photo where the shape did not come from a photo.
    warnings : list of str
    pages : list of PartReport
        The pages of the sheet, from left to right; one where it was not split. Empty without a photo.
    spine : Spine or None
        Where it was split.
    sources : dict
        SHA-256 in hexadecimal, by name, of the files that the scan was read from.
    guideline : GuidelineReport or None
        Where the page stands in the FADGI guidelines.
    """

    version: str
    outcome: str
    settled: bool
    seconds_total: float
    seconds: dict[str, float]
    scan: ScanReport
    flatten: FlattenReport
    page: PageReport
    warnings: list[str]
    shading: ShadingReport | None = None
    pages: list[PartReport] = field(default_factory=list)
    spine: Spine | None = None
    sources: dict[str, str] = field(default_factory=dict)
    photo: PhotoReport | None = None
    guideline: GuidelineReport | None = None


@dataclass(frozen=True, eq=False)
class Restoration:
    """All that came of a scan.

    Attributes
    ----------
    flattening : Flattening
        With the place on the page of every point of the scan, in the scan's order.
    rendered, unshaded, binary : Page or None
        None where the scan has no photo, or where that stage was not asked for. Of the whole sheet.
    report : Report
        With the place of the spine, along which `planish.split` cuts these pages in two.
    clipped : (rows, cols) bool or None
        Pixels of the page with a channel at its greatest value in the photo, where shade was removed.
    light : (rows, cols, 3) float32 or None
        Linear light that blank paper had in the photo, on a coarse grid over the page, where shade was removed.
    ppi : (rows, cols) float32 [1 / inch] or None
        Photo pixels per inch of page, on a coarse grid over the page; NaN where the photo did not see it.
    """

    flattening: Flattening
    rendered: Page | None
    unshaded: Page | None
    binary: Page | None
    report: Report
    clipped: Bools | None = None
    light: NDArray[np.float32] | None = None
    ppi: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        _freeze(self)
