"""Every choice a user can make, once: one frozen dataclass per stage.

Command-line flags, their help and the report are made from these.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from planish.errors import UsageError

Lengths = Literal["smooth", "unfolded", "straight"]
Method = Literal["multigrid", "verlet", "mass-spring"]
Binarization = Literal["none", "nick", "sauvola", "wolf", "trsingh", "bataineh", "su", "otsu"]
Shading = Literal["geometry", "background", "none"]
Rotation = Literal["auto", "0", "90", "180", "270"]
PhotoShape = Literal["auto", "text-lines", "borders", "shading", "polynomial"]
Paper = Literal["unknown", "a3", "a4", "a5", "letter", "legal"]
Units = str
"""auto, mm, cm, m, in, or the length of a step of 1 in the file's numbers, such as 7.91um."""
NamedUnits = Literal["auto", "mm", "cm", "m", "in"]
"""Those that a menu offers."""
Pages = Literal["1", "2", "auto"]
SheetRegion = Literal["auto", "all"]
PageKind = Literal["tif", "png", "jpg", "pdf"]


@dataclass(frozen=True, kw_only=True)
class VerletSettings:
    """The simulation of the paper.

    Attributes
    ----------
    time_step : float
        dt of eq. (6) and (7). The paper's value; larger steps fall faster and settle worse.
    gravity : float
        g of eq. (2), towards the plane, with the median stick as unit of length.
    rounds : int
        How often sticks and plane are made good, in turn, after each step. Fewer leave the sticks unsettled for
        more steps; more make the sheet so stiff that gravity cannot press it down: with 40, sheets of 300 points
        stop arched that settle with 20 (docs/design-notes.md has the table).
    max_steps : int
        Give up after so many steps and say so.
    tolerance : float
        The sheet has settled when it lies on the plane and its sticks' rms relative error has changed by less than
        this part of itself over the last 50 steps.
    self_collision : bool
        Keep layers of a sheet that lies over itself apart while it falls. Without it they may pass through each
        other, and the report counts the points that did.
    thickness_mm : float
        How far apart, with self_collision.
    """

    time_step: float = 0.1
    gravity: float = 9.81
    rounds: int = 20
    max_steps: int = 4000
    tolerance: float = 0.002
    self_collision: bool = False
    thickness_mm: float = 0.2

    def __post_init__(self) -> None:
        for name in ("time_step", "gravity", "rounds", "max_steps", "tolerance", "thickness_mm"):
            value = getattr(self, name)
            if not value > 0:
                raise UsageError(f"{name} must be greater than 0, not {value}")


@dataclass(frozen=True, kw_only=True)
class MultigridSettings:
    """The solver for all points.

    Attributes
    ----------
    tolerance : float
        The sheet is at rest when the next step would move its points by less than this part of the sheet's side,
        rms: 0.0005 mm on a letter. What is left to the minimum is a few times as much.
    max_steps : int
        Give up after so many steps and say so. Sheets of paper take 0 to 25, surfaces that cannot lie flat more.
    """

    tolerance: float = 2e-6
    max_steps: int = 100

    def __post_init__(self) -> None:
        for name in ("tolerance", "max_steps"):
            value = getattr(self, name)
            if not value > 0:
                raise UsageError(f"{name} must be greater than 0, not {value}")


@dataclass(frozen=True, kw_only=True)
class MassSpringSettings:
    """The particle system of Brown & Seales, on a regular quad mesh: there to be compared with.

    The unit of length is the median spring, that of time and mass as of gravity below: a free mass falls 4.9 springs
    in the first unit of time.

    Attributes
    ----------
    time_step : float
        dt of eq. (4) and (5), in units of time. Steps over damping * sqrt(mass / stiffness), 0.017 as it stands,
        burst the net (docs/design-notes.md has the picture).
    stiffness : float
        k of the springs: force per length. Stiffer springs keep their lengths better while the sheet falls, but hold
        it up where it is folded, and need shorter steps.
    damping : float
        Of the springs: force per speed at which they lengthen, in parts of sqrt(stiffness * mass). Explicit steps need
        some; with more than 0.6 the longest step falls again.
    drag : float
        Of the air: the share of its speed that a mass loses per unit of time.
    mass : float
        Of every node of the mesh.
    gravity : float
        g of eq. (2), towards the plane: springs per squared unit of time.
    restitution : float
        The share of its speed with which a mass bounces off the plane, 0 to 1.
    max_steps : int
        Give up after so many steps and say so.
    tolerance : float
        The sheet is at rest when its masses are slower than this, rms: springs per unit of time.
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
        for name in ("time_step", "stiffness", "mass", "gravity", "max_steps", "tolerance"):
            value = getattr(self, name)
            if not value > 0:
                raise UsageError(f"{name} must be greater than 0, not {value}")
        for name in ("damping", "drag"):
            value = getattr(self, name)
            if not value >= 0:
                raise UsageError(f"{name} must be at least 0, not {value}")
        if not 0 <= self.restitution <= 1:
            raise UsageError(f"restitution must be between 0 and 1, not {self.restitution}")


@dataclass(frozen=True, kw_only=True)
class FlattenSettings:
    """How a mesh becomes flat.

    Attributes
    ----------
    method : {"multigrid", "verlet", "mass-spring"}
        multigrid: the sticks' energy minimised for all points at once. verlet: the particle system of the paper.
        mass-spring: that of Brown & Seales, which the paper measures itself by.
    lengths : {"smooth", "unfolded", "straight"}
        Rest lengths of the sticks. smooth: along the surface without the scanner's noise, true across creases.
        unfolded: edges as scanned, and two triangles laid into one plane for the bending stick across them.
        straight: that stick as it stands in space, as the paper has it; too short across a fold.
    points : int, "all" or "auto"
        Reduce the sheet to about so many points before solving. auto: all of them, but the paper's 1,000 for verlet
        and mass-spring. Every point of the scan gets its place on the page in any case.
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
        if isinstance(self.points, int) and self.points < 3:
            raise UsageError(f"points must be at least 3, all or auto, not {self.points}")


@dataclass(frozen=True, kw_only=True)
class RenderSettings:
    """How the page is drawn.

    Attributes
    ----------
    dpi : float or "auto"
        Page pixels per 25.4 mm. auto: what the photo gives (its median over the page), rounded to a usual value.
    """

    dpi: float | Literal["auto"] = 300.0

    def __post_init__(self) -> None:
        if self.dpi != "auto" and not 1 <= self.dpi <= 10_000:
            raise UsageError(f"dpi must be between 1 and 10000, or auto, not {self.dpi}")


@dataclass(frozen=True, kw_only=True)
class ShadingSettings:
    """How shade is taken off the page.

    Attributes
    ----------
    shading : {"geometry", "background", "none"}
        geometry: find the lamp from the sheet's shape and divide its light out; pictures keep their greys.
        background: without the shape, from the brightness of the page alone; any grey area wider than 6 mm is taken
        for shade. none: leave the page as the photo shows it.
    """

    shading: Shading = "geometry"


@dataclass(frozen=True, kw_only=True)
class BinarizeSettings:
    """How the page becomes black and white.

    Attributes
    ----------
    binarize : {"none", "nick", "sauvola", "wolf", "trsingh", "bataineh", "su", "otsu"}
        How the threshold is found. nick, which keeps faint print beside black print best, sauvola and their like
        look at the neighbourhood of each pixel; su takes a hundred times as long. otsu has one threshold for the
        page: for pages without shade.
    window_mm : float
        Side of the neighbourhood on the page: about one and a half lines of text high.
    k : float or "auto"
        How much darker than its neighbourhood ink must be; more gives thinner strokes and loses faint print. auto:
        what does best for the method (docs/benchmarks.md has the table).
    """

    binarize: Binarization = "nick"
    window_mm: float = 6.0
    k: float | Literal["auto"] = "auto"

    def __post_init__(self) -> None:
        if not 0.1 <= self.window_mm <= 1000:
            raise UsageError(f"window_mm must be between 0.1 and 1000, not {self.window_mm}")
        if self.k != "auto" and not 0 < self.k < 1:
            raise UsageError(f"k must be between 0 and 1, or auto, not {self.k}")


@dataclass(frozen=True, kw_only=True)
class RestoreSettings:
    """The whole walk: the settings of each stage, and the way round of the page.

    Attributes
    ----------
    flatten : FlattenSettings
    render : RenderSettings
    shading : ShadingSettings
    binarize : BinarizeSettings
    rotate : {"auto", "0", "90", "180", "270"}
        auto: as the text reads; where there is none, long side upright and the photo's top on top. A number: clockwise
        turn from the photo's way round.
    pages : {"1", "2", "auto"}
        2: the sheet is an open book, and is split at its spine into a left and a right page. auto: only where a
        spine is plain in the surface and no line of text crosses it. 1: the sheet stays whole.
    sheet : {"auto", "all"}
        auto: the table around the sheet is left out where it is plainly one, with a note. all: the whole mesh is the
        sheet.
    """

    flatten: FlattenSettings = field(default_factory=FlattenSettings)
    render: RenderSettings = field(default_factory=RenderSettings)
    shading: ShadingSettings = field(default_factory=ShadingSettings)
    binarize: BinarizeSettings = field(default_factory=BinarizeSettings)
    rotate: Rotation = "auto"
    pages: Pages = "1"
    sheet: SheetRegion = "auto"


@dataclass(frozen=True, kw_only=True)
class PhotoSettings:
    """How the shape of a sheet is found from one photo, and how large it is.

    Attributes
    ----------
    shape : {"auto", "text-lines", "borders", "shading", "polynomial"}
        What tells the shape. auto: lines of text and the sheet's borders, whichever are there. text-lines, borders: one
        of them alone. shading: the brightness of the blank paper of a page that is bent in one direction only.
        polynomial: each line of text straightened by itself (Zhang and Tan 2003), to compare with.
    width_mm : float, optional
        Width of the sheet, or of the part that is drawn where its borders are not seen. One photo cannot tell it.
    paper : {"unknown", "a3", "a4", "a5", "letter", "legal"}
        The sheet's size, where all of its borders are seen; it also puts the proportions right.
    """

    shape: PhotoShape = "auto"
    width_mm: float | None = None
    paper: Paper = "unknown"

    def __post_init__(self) -> None:
        if self.width_mm is not None and not 1 <= self.width_mm <= 10_000:
            raise UsageError(f"width_mm must be between 1 and 10000, not {self.width_mm}")
        if self.width_mm is not None and self.paper != "unknown":
            raise UsageError("give width_mm or paper, not both: each says how large the sheet is")


@dataclass(frozen=True, kw_only=True)
class BatchFiles:
    """The files of every item of a batch; report.json, item.json and preview.jpg are always among them.

    Attributes
    ----------
    format : {"tif", "png", "jpg", "pdf"}
        Of the page's file.
    binary : bool
        Also write the page in black and white: binary.tif, .png or .pdf, as the page is.
    flat : bool
        Also write the flattened mesh: flat.obj.
    mask : bool
        Also write what is known of the page: mask.png.
    html : bool
        Also write a page to look at: page.html.
    certificate : bool
        Also write one sheet that shows how good the page is: certificate.pdf.
    """

    format: PageKind = "tif"
    binary: bool = False
    flat: bool = False
    mask: bool = False
    html: bool = False
    certificate: bool = False


@dataclass(frozen=True, kw_only=True)
class ServeSettings:
    """What the service lets its users do.

    Attributes
    ----------
    jobs : int
        Scans at work at once, each in a process of its own.
    queue : int
        Scans that may wait for their turn; who comes then is asked to come again later.
    seconds : float
        A scan may take so long; then its process is ended.
    memory_mb : float
        A scan may take so much memory; planish itself takes about 400 of it.
    upload_mb : float
        The most that is taken at once, in megabytes.
    unpacked_mb : float
        The most that a zip file may hold.
    files : int
        The most files of one scan, also inside a zip.
    megapixels : float
        The most that one photo may have.
    upload_seconds : float
        An upload may take so long.
    keep_hours : float
        So long after its end a page can be fetched; then it is removed.
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
        for name, value in vars(self).items():
            if not 0 < value < float("inf"):
                raise UsageError(f"{name} must be greater than 0, not {value}")
