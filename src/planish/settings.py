"""Settings of all stages, one frozen dataclass each.

Command-line flags, their help, form fields and the report are generated from them.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Literal

from planish.choices import CheckedSettings
from planish.dpi import MM_PER_INCH
from planish.errors import UsageError

Lengths = Literal["smooth", "unfolded", "straight"]
Method = Literal["multigrid", "verlet", "mass-spring"]
Binarization = Literal["none", "nick", "sauvola", "wolf", "trsingh", "bataineh", "su", "otsu"]
Shading = Literal["geometry", "background", "none"]
Rotation = Literal["auto", "0", "90", "180", "270"]
PhotoShape = Literal["auto", "text-lines", "borders", "shading", "polynomial"]
Paper = Literal["unknown", "a3", "a4", "a5", "letter", "legal"]
PAPERS_MM = {
    "a3": (297.0, 420.0),
    "a4": (210.0, 297.0),
    "a5": (148.0, 210.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
}
"""The shorter side and the longer one."""
USUAL_SHEET_MM = 297.0
"""Long side that a sheet of unknown size is taken to have: that of A4."""
Units = str
"""auto, mm, cm, m, in, or the length of a step of 1 in the file's numbers, such as 7.91um."""
Pages = Literal["1", "2", "auto"]
SheetRegion = Literal["auto", "all"]
PageKind = Literal["tif", "png", "jpg", "pdf"]

MM_PER_UNIT: dict[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": MM_PER_INCH}
"""Of units that files and users name."""
_MM_PER_SYMBOL = {**MM_PER_UNIT, "nm": 1e-6, "um": 1e-3, "µm": 1e-3, "μm": 1e-3, "micron": 1e-3, "ft": 304.8, "km": 1e6}
_LENGTH = re.compile(r"((?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)?\s*([a-zµμ]+)\Z", re.IGNORECASE)

_MESH_FORMATS = "OBJ PLY GLB glTF STL OFF 3MF DAE X3D X3DV WRL USDZ USDC USDA"
MESH_SUFFIXES: dict[str, str] = {f".{name.lower()}": name for name in _MESH_FORMATS.split()}
"""Format names of mesh files by suffix, where a scan has to be found among other files: batches and uploads."""


def mm_per_unit(unit: str) -> float:
    """How many mm a step of 1 in a file's numbers is.

    Raises
    ------
    UsageError
        If it is no length above 0.

    Examples
    --------
    >>> mm_per_unit("in"), mm_per_unit("7.91um"), mm_per_unit("0.1 mm")
    (25.4, 0.00791, 0.1)
    """
    found = _LENGTH.match(str(unit).strip())  # Python users may give numbers
    symbol = found[2].lower() if found else ""
    if not found or symbol not in _MM_PER_SYMBOL:
        raise UsageError(
            f"the unit must be auto, {', '.join(MM_PER_UNIT)}, or a length such as 7.91um (nm, um, mm, cm, m, in, ft),"
            f" not {unit}"
        )
    length = float(found[1] or 1) * _MM_PER_SYMBOL[symbol]
    if not 0 < length < math.inf:
        raise UsageError(f"the unit is {unit}; a length above 0 is wanted")
    return round(length, 15)


@dataclass(frozen=True, kw_only=True)
class VerletSettings(CheckedSettings):
    """The paper's particle simulation (Verlet integration).

    Attributes
    ----------
    time_step : float
        dt of eq. (6) and (7). The default is the paper's; with larger steps sheets fall faster and settle worse.
    gravity : float
        g of eq. (2), towards the plane, with the median stick as unit of length.
    rounds : int
        Constraint iterations per time step, each over sticks and plane. Fewer need more steps to settle; more make the
        sheet too stiff for gravity: with 40, sheets of 300 points stall arched that settle with 20
        (docs/design-notes.md has the table).
    max_steps : int
        Maximum number of time steps; reaching it is reported.
    tolerance : float
        The sheet has settled when it lies on the plane and the rms relative error of its sticks has changed by less
        than this fraction over the last 50 steps.
    self_collision : bool
        Prevent layers of the sheet from passing through each other. Without it, the report counts the points that do.
    thickness_mm : float
        Distance of the layers, with self_collision.
    """

    time_step: float = 0.1
    gravity: float = 9.81
    rounds: int = 20
    max_steps: int = 4000
    tolerance: float = 0.002
    self_collision: bool = False
    thickness_mm: float = 0.2

    def __post_init__(self) -> None:
        super().__post_init__()
        self.above_zero("time_step", "gravity", "rounds", "max_steps", "tolerance", "thickness_mm")


@dataclass(frozen=True, kw_only=True)
class MultigridSettings(CheckedSettings):
    """The stick solver with multigrid preconditioner, for all points.

    Attributes
    ----------
    tolerance : float
        Stop when the rms step is below this fraction of the sheet's side: 0.0005 mm on a letter-size page. The distance
        to the minimum is a few times as large.
    max_steps : int
        Maximum number of iterations; reaching it is reported. Sheets of paper take 0 to 25, surfaces that cannot be
        flattened more.
    """

    tolerance: float = 2e-6
    max_steps: int = 100

    def __post_init__(self) -> None:
        super().__post_init__()
        self.above_zero("tolerance", "max_steps")


@dataclass(frozen=True, kw_only=True)
class MassSpringSettings(CheckedSettings):
    """The mass-spring system of Brown & Seales on a regular quad mesh, for comparison.

    The unit of length is the median spring; with the default gravity a free mass falls 4.9 springs in the first unit
    of time.

    Attributes
    ----------
    time_step : float
        dt of eq. (4) and (5), in units of time. Steps above damping * sqrt(mass / stiffness), by default 0.017, are
        unstable (docs/design-notes.md has the picture).
    stiffness : float
        Spring constant k: force per length. Stiffer springs keep their lengths better, but hold up folds and need
        shorter steps.
    damping : float
        Damping of the springs: force per rate of elongation, as a fraction of sqrt(stiffness * mass). Explicit
        integration needs some; above 0.6 the longest stable step decreases again.
    drag : float
        Air drag: fraction of its speed that a mass loses per unit of time.
    mass : float
        Mass of every node of the mesh.
    gravity : float
        g of eq. (2), towards the plane: springs per squared unit of time.
    restitution : float
        Coefficient of restitution at the plane, 0 to 1.
    max_steps : int
        Maximum number of time steps; reaching it is reported.
    tolerance : float
        Stop when the rms speed of the masses is below this, in springs per unit of time.
    """

    time_step: float = 0.01
    stiffness: float = 300.0
    damping: float = 0.3
    drag: float = 2.0
    mass: float = 1.0
    gravity: float = 9.81
    restitution: float = 0.3
    max_steps: int = 100_000
    tolerance: float = 1e-3

    def __post_init__(self) -> None:
        super().__post_init__()
        self.above_zero("time_step", "stiffness", "mass", "gravity", "max_steps", "tolerance")
        for name in ("damping", "drag"):
            value = getattr(self, name)
            if not value >= 0:
                raise UsageError(f"{name} must be at least 0, not {value}")
        if not 0 <= self.restitution <= 1:
            raise UsageError(f"restitution must be between 0 and 1, not {self.restitution}")


@dataclass(frozen=True, kw_only=True)
class FlattenSettings(CheckedSettings):
    """Flattening of the mesh.

    Attributes
    ----------
    method : {"multigrid", "verlet", "mass-spring"}
        multigrid: minimise the stick energy of all points at once. verlet: the paper's particle system. mass-spring:
        the system of Brown & Seales, with which the paper compares itself.
    lengths : {"smooth", "unfolded", "straight"}
        Rest lengths of the sticks. smooth: along the denoised surface, correct across creases. unfolded: scanned edge
        lengths, and for bending sticks the distance in the two unfolded triangles. straight: for bending sticks the 3D
        distance, as in the paper; too short across a fold.
    points : int, "all" or "auto"
        Decimate the mesh to about this number of points before solving. auto: all points, but the paper's 1,000 for
        verlet and mass-spring. All points of the scan are mapped to the page in any case.
    multigrid : MultigridSettings
    verlet : VerletSettings
    mass_spring : MassSpringSettings
    """

    method: Method = "multigrid"
    lengths: Lengths = "smooth"
    points: int | Literal["all", "auto"] = "auto"
    multigrid: MultigridSettings = field(default_factory=MultigridSettings)
    verlet: VerletSettings = field(default_factory=VerletSettings)
    mass_spring: MassSpringSettings = field(default_factory=MassSpringSettings)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.points, str) and self.points < 3:
            raise UsageError(f"points must be at least 3, all or auto, not {self.points}")


@dataclass(frozen=True, kw_only=True)
class RenderSettings(CheckedSettings):
    """Rendering of the page.

    Attributes
    ----------
    dpi : float or "auto"
        Page pixels per 25.4 mm. auto: a usual value that keeps the median resolution of the photo on the page; 1.5
        times that, and more, below 200.
    sharpen : float
        Amount of unsharp mask, as wide as a photo's blur: thin print that is pale from blur becomes darker. 0: none.
    """

    dpi: float | Literal["auto"] = 300.0
    sharpen: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.sharpen <= 10:
            raise UsageError(f"sharpen must be between 0 and 10, not {self.sharpen}")
        if self.dpi != "auto" and not 1 <= self.dpi <= 10_000:
            raise UsageError(f"dpi must be between 1 and 10000, or auto, not {self.dpi}")


@dataclass(frozen=True, kw_only=True)
class ShadingSettings(CheckedSettings):
    """Removal of shading from the page.

    Attributes
    ----------
    shading : {"geometry", "background", "none"}
        geometry: fit a lamp to the shape of the sheet and divide by its illumination. background: from the blank paper
        of the page only, followed into shadows and folds; what has edges or colour is print and keeps its tone. none:
        keep the page as photographed.
    """

    shading: Shading = "geometry"


@dataclass(frozen=True, kw_only=True)
class BinarizeSettings(CheckedSettings):
    """Binarization of the page.

    Attributes
    ----------
    binarize : {"none", "nick", "sauvola", "wolf", "trsingh", "bataineh", "su", "otsu"}
        Threshold method. All but otsu use the neighbourhood of each pixel; nick preserves faint print beside black
        print best, and su takes a hundred times as long. otsu has a single threshold, for pages without shading.
    window_mm : float
        Side of the neighbourhood on the page: about one and a half times the line spacing.
    k : float or "auto"
        Sensitivity: how much darker than its neighbourhood ink must be. Larger values give thinner strokes and lose
        faint print. auto: the best value for the method (docs/benchmarks-pages.md has the table).
    """

    binarize: Binarization = "nick"
    window_mm: float = 6.0
    k: float | Literal["auto"] = "auto"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.1 <= self.window_mm <= 1000:
            raise UsageError(f"window_mm must be between 0.1 and 1000, not {self.window_mm}")
        if self.k != "auto" and not 0 < self.k < 1:
            raise UsageError(f"k must be between 0 and 1, or auto, not {self.k}")


@dataclass(frozen=True, kw_only=True)
class RestoreSettings(CheckedSettings):
    """Settings of the whole pipeline.

    Attributes
    ----------
    flatten : FlattenSettings
    render : RenderSettings
    shading : ShadingSettings
    binarize : BinarizeSettings
    rotate : {"auto", "0", "90", "180", "270"}
        auto: upright text; without text, portrait format with the photo's top up. A number: clockwise rotation in
        degrees from the orientation of the photo.
    pages : {"1", "2", "auto"}
        2: split an open book at its spine into a left and a right page. auto: split only if the surface shows a clear
        spine and no line of text crosses it. 1: no split.
    sheet : {"auto", "all"}
        auto: remove the table around the sheet if it is clearly one, with a note. all: the whole mesh is the sheet.
    """

    flatten: FlattenSettings = field(default_factory=FlattenSettings)
    render: RenderSettings = field(default_factory=RenderSettings)
    shading: ShadingSettings = field(default_factory=ShadingSettings)
    binarize: BinarizeSettings = field(default_factory=BinarizeSettings)
    rotate: Rotation = "auto"
    pages: Pages = "1"
    sheet: SheetRegion = "auto"


@dataclass(frozen=True, kw_only=True)
class PhotoSettings(CheckedSettings):
    """Estimation of shape and size of a sheet from its photos.

    Attributes
    ----------
    shape : {"auto", "text-lines", "borders", "shading", "polynomial"}
        Source of the shape. auto: text lines and borders of the sheet, as far as they are visible. text-lines, borders:
        only one of them. shading: brightness of the blank paper, for a page bent in one direction only. polynomial:
        straighten each text line by itself (Zhang and Tan 2003), for comparison.
    width_mm : float, optional
        Width of the sheet, or of the rendered part if its borders are not visible. One photo does not determine it.
    paper : {"unknown", "a3", "a4", "a5", "letter", "legal"}
        Size of the sheet, if all of its borders are visible; it also corrects the aspect ratio.
    pages : {"1", "2", "auto"}
        Of one photo of an open book. auto: the larger page, where a dark gutter that no line of text crosses parts it
        from a facing one. 2: both. 1: all that is seen, as one sheet.
    marker_mm : float, optional
        With several photos: side of the black squares of printed ArUco markers (DICT_4X4_50) beside the sheet, such
        as the card of `planish calibrate card`.
    distance_mm : float, optional
        With several photos: distance of two places of the sheet along the paper, as a ruler measures it on the flat
        sheet; `between` names them.
    between : (str, float, float, float, float), optional
        The name of one of the photos, and column and row of both places in it [px], as an image viewer shows it.
    """

    shape: PhotoShape = "auto"
    width_mm: float | None = None
    paper: Paper = "unknown"
    pages: Pages = "auto"
    marker_mm: float | None = None
    distance_mm: float | None = None
    between: tuple[str, float, float, float, float] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.width_mm is not None and not 1 <= self.width_mm <= 10_000:
            raise UsageError(f"width_mm must be between 1 and 10000, not {self.width_mm}")
        if self.marker_mm is not None and not 1 <= self.marker_mm <= 1000:
            raise UsageError(f"marker_mm must be between 1 and 1000, not {self.marker_mm}")
        if self.distance_mm is not None and not 1 <= self.distance_mm <= 10_000:
            raise UsageError(f"distance_mm must be between 1 and 10000, not {self.distance_mm}")
        if (self.distance_mm is None) != (self.between is None):
            raise UsageError("distance_mm and between go together: a distance, and the two places that it lies between")
        if self.between is not None and self.between[1:3] == self.between[3:]:
            raise UsageError("between names one place twice; two places far apart are wanted")
        known = [self.width_mm, self.marker_mm, self.distance_mm]
        if sum(value is not None for value in known) + (self.paper != "unknown") > 1:
            raise UsageError(
                "give one of width_mm, paper, marker_mm and distance_mm: each determines the size of the sheet"
            )


@dataclass(frozen=True, kw_only=True)
class BatchFiles(CheckedSettings):
    """Output files of every item of a batch, in addition to report.json, item.json and preview.jpg.

    Attributes
    ----------
    format : {"tif", "png", "jpg", "pdf"}
        Format of the page.
    binary : bool
        Also write the binarized page: binary.tif, .png or .pdf, in the format of the page.
    flat : bool
        Also write the flattened mesh: flat.obj.
    mask : bool
        Also write the mask of valid pixels: mask.png.
    html : bool
        Also write an interactive HTML page: page.html.
    certificate : bool
        Also write a one-page quality certificate: certificate.pdf.
    """

    format: PageKind = "tif"
    binary: bool = False
    flat: bool = False
    mask: bool = False
    html: bool = False
    certificate: bool = False


@dataclass(frozen=True, kw_only=True)
class ServeSettings(CheckedSettings):
    """Limits of the web service.

    Attributes
    ----------
    jobs : int
        Number of concurrent scans, each in its own process.
    queue : int
        Maximum queue length; further requests get HTTP 429.
    seconds : float
        Time limit per scan; its process is killed afterwards.
    memory_mb : float
        Memory limit per scan in megabytes, including about 400 of planish itself.
    upload_mb : float
        Maximum size of an upload in megabytes.
    unpacked_mb : float
        Maximum unpacked size of a zip file in megabytes.
    files : int
        Maximum number of files per scan, also inside a zip.
    megapixels : float
        Maximum size of a photo.
    upload_seconds : float
        Time limit of an upload.
    keep_hours : float
        Time in hours until the results of a finished job are deleted.
    """

    jobs: int = 2
    queue: int = 100
    seconds: float = 900.0
    memory_mb: float = 4000.0
    upload_mb: float = 1000.0
    unpacked_mb: float = 3000.0
    files: int = 100
    megapixels: float = 200.0
    upload_seconds: float = 900.0
    keep_hours: float = 24.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self.above_zero(*vars(self))
