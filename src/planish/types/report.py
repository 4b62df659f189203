"""Quality reports: plain numbers and strings, as the JSON holds them."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from planish.settings import RestoreSettings
from planish.types.diagnostic import Diagnostic


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
    noise_length_mm : float or None
        Distance over which the noise of two points is alike (correlation 1/2); None where there is no noise.
    spikes : int
        Points far off the surface, which were not counted.
    """

    points: int
    faces: int
    pieces: int
    holes: int
    unit: str = "mm"
    noise_mm: float | None = None
    noise_length_mm: float | None = None
    spikes: int = 0


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
    creases : float
        Length of all creases that the shade of the paper shows, in lengths of the page's shorter side.
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
    creases: float = 0.0


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
    """Quality report of one restoration, in plain numbers and sentences; `to_dict` gives what its JSON holds.

    Attributes
    ----------
    version : str
    outcome : str
        The sentence of the `Outcome`.
    settled : bool
    seconds_total : float
    seconds : dict
        Per stage.
    scan : ScanReport
    flatten : FlattenReport
    page : PageReport
    warnings : list of Diagnostic
        In the JSON a list of their sentences.
    warning_codes : list of str
        Of the warnings, in the same order.
    shading : ShadingReport or None
        Where shade was removed.
    pages : list of PartReport
        The pages of the sheet, from left to right; one where it was not split. Empty without a photo.
    spine : Spine or None
        Where it was split.
    sources : dict
        SHA-256 in hexadecimal, by name, of the files that the scan was read from.
    photo : PhotoReport or None
        Where the shape came from a photo.
    guideline : GuidelineReport or None
        Where the page stands in the FADGI guidelines.
    settings : RestoreSettings or None
        That the page was made with.
    """

    version: str
    outcome: str
    settled: bool
    seconds_total: float
    seconds: dict[str, float]
    scan: ScanReport
    flatten: FlattenReport
    page: PageReport
    warnings: list[Diagnostic]
    shading: ShadingReport | None = None
    pages: list[PartReport] = field(default_factory=list)
    spine: Spine | None = None
    sources: dict[str, str] = field(default_factory=dict)
    photo: PhotoReport | None = None
    guideline: GuidelineReport | None = None
    settings: RestoreSettings | None = None

    def __repr__(self) -> str:
        size = f"{self.page.width_mm:.1f} x {self.page.height_mm:.1f} mm"
        error = f"expected error {self.flatten.expected_error_mm:.3f} mm"
        return f"Report({size}, {error}, {len(self.warnings)} warnings; {self.outcome})"

    @property
    def warning_codes(self) -> list[str]:
        """Codes of the warnings, for programs."""
        return [warning.code for warning in self.warnings]

    def to_dict(self) -> dict[str, Any]:
        """What the JSON holds: warnings as sentences, with settings named as in Python, and their codes beside them."""
        plain: dict[str, Any] = {}
        for name, value in asdict(self).items():
            plain[name] = value
            if name == "warnings":
                plain |= {"warnings": [str(warning) for warning in self.warnings], "warning_codes": self.warning_codes}
        return plain
