"""Quality reports: plain numbers and strings, as the JSON holds them."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from planish.settings import RestoreSettings
from planish.types.diagnostic import Diagnostic
from planish.types.verdict import Evidence, Verdict, judge


@dataclass(frozen=True)
class Spine:
    """Gutter between two pages of a book: a vertical line on the flat sheet.

    Attributes
    ----------
    x_mm : float
        Distance from the left side of the sheet.
    turn_deg : float
        Angle of the valley in the surface; 0 where the surface does not show the gutter.
    found_by : {"surface", "gutter", "middle"}
        The surface; the widest vertical gap in the print; or the middle of the sheet, where there is neither.
    crossed : bool
        Whether print runs across the gutter.
    """

    x_mm: float
    turn_deg: float
    found_by: Literal["surface", "gutter", "middle"]
    crossed: bool = False


@dataclass(frozen=True)
class ScanReport:
    """The scan as it was read.

    Attributes
    ----------
    points, faces : int
        Counts of the file.
    pieces, holes : int
    unit : str
        Unit of the file's coordinates, as given, read or guessed; a length such as 0.25mm is that of a step of 1.
    noise_mm : float or None
        Median standard deviation of the scanner's noise, where it was measured.
    noise_length_mm : float or None
        Distance over which the noise of two points is alike (correlation 1/2); None where there is no noise.
    spikes : int
        Points far off the surface, which were not counted.
    measured_fraction : float or None
        Part of the sheet's area that was measured rather than bridged, where the scan was made from photos.
    sheet_mask : str or None
        The image that named the sheet, if one was given; it is among the sources.
    """

    points: int
    faces: int
    pieces: int
    holes: int
    unit: str = "mm"
    noise_mm: float | None = None
    noise_length_mm: float | None = None
    spikes: int = 0
    measured_fraction: float | None = None
    sheet_mask: str | None = None


@dataclass(frozen=True)
class FlattenReport:
    """Solver and geometric fidelity of the flattening.

    Attributes
    ----------
    method, lengths : str
    points : int
        Points that the solver moved.
    iterations : int
    seconds : float
        Wall time from the mesh in memory to `page_xy` in memory.
    strain_rms, strain_max : float
        Relative error of the solver's edges against the rest lengths used.
    strain_raw_rms : float
        Rms relative error of all edges of the scan against their raw 3D lengths, which include the scanner's noise.
    stretch_l2, stretch_linf : float
        Stretch of Sander et al. (2001) over the surface with the rest lengths used, that is without noise (of
        mass-spring: over the faces of the scan); 1 is isometric.
    flipped_faces : int
        Faces of the scan that lie on the page with their back up.
    overlaps : int
        Faces of the scan that overlap other parts of the page.
    passed_points : int
        Points of the solver that passed through another layer of the sheet (verlet).
    expected_error_mm : float
        Expected rms distance of the points from their true places on the page, estimated from strain and noise.
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
    """Size of the page, and resolution and coverage of its photo (None where no photo was drawn).

    Attributes
    ----------
    width_mm, height_mm : float
    dpi : float or None
    effective_ppi_p10, effective_ppi_median : float or None
        Photo pixels per inch of page in the direction of the lowest resolution: 10 % quantile and median over the page.
    known_fraction : float or None
        Fraction of the page's pixels covered by scan and photo.
    photo_parts : list of float
        For each photo, in the order given, the fraction of the known pixels taken from it.
    missing_regions : int or None
        Number of connected regions without data, each at least 1 mm wide somewhere.
    missing_mm2 : float or None
        Total area of these regions.
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
    """One page of the sheet, as written.

    Attributes
    ----------
    side : {"whole", "left", "right"}
    left_mm : float
        Distance of its left side from that of the sheet.
    width_mm, height_mm : float
    """

    side: Literal["whole", "left", "right"]
    left_mm: float
    width_mm: float
    height_mm: float


@dataclass(frozen=True)
class ShadingReport:
    """Quality of the shading removal.

    Attributes
    ----------
    method : str
        "geometry" or "background"; "none" where the page stayed as photographed for want of paper.
    paper_share : float
        Fraction of the page used as blank paper to estimate the illumination.
    unevenness_before, unevenness : float
        Difference of the 90 % and 10 % quantiles of the grey of blank paper, relative to white, before and after.
    clipped_share : float
        Fraction of the page that is overexposed in the photo, where its brightness is unknown.
    """

    method: str
    paper_share: float
    unevenness_before: float
    unevenness: float
    clipped_share: float


@dataclass(frozen=True)
class PhotoReport:
    """Shape of the sheet as estimated from one photo.

    Attributes
    ----------
    shape : str
        Evidence used: "text-lines", "borders", "text-lines and borders", "shading" or "polynomial".
    scale : str
        Origin of the size in mm: "unknown" (guessed from the size of the letters), "width" or "paper".
    focal_px : float [photo px]
    focal_from : str
        "exif" or "assumed".
    lines, letters : int
        Numbers of text lines and letters used.
    straightness : float or None
        Rms distance of the letters from straight lines on the page, in letter heights.
    bent_one_way : float or None
        The same after the cylinder fit alone, before the residual warp.
    extrapolated_share : float
        Fraction of the page outside the convex hull of the evidence.
    confidence : str
        Summary of these figures in one sentence.
    creases : float
        Total length of creases visible in the shading, relative to the shorter side of the page.
    kept_share : float or None
        Share of the sheet's region on the photo that the page shows; None where no region was found.
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
    kept_share: float | None = None


@dataclass(frozen=True)
class PhotosReport:
    """The surface of a sheet as measured by several photos.

    Attributes
    ----------
    photos, used : int
        How many were given, and how many could be placed.
    left_out : list of str
        Names of the others.
    scale : str
        Origin of the size in mm: "marker", "paper", "width", "distance", "cameras" or "unknown" (taken to be about A4).
    scale_error : float or None
        Standard error of the size, relative to it; None where it is unknown.
    focal_px : float [photo px]
        Of the first photo used.
    reprojection_px : float
        Mean distance of features from where their points are projected.
    angle_deg : float
        Median of the largest angle between the rays to a point.
    measured_fraction : float
        Part of the sheet's area where photos were compared; the rest is bridged smoothly, as blank paper is.
    surface_error_mm : float
        Standard deviation of the measured places, typical.
    lost_at_bends_mm : float
        Length that may be missing across the sharpest bend that was bridged: a gutter or a crumple without print.
    """

    photos: int
    used: int
    left_out: list[str]
    scale: str
    scale_error: float | None
    focal_px: float
    reprojection_px: float
    angle_deg: float
    measured_fraction: float
    surface_error_mm: float
    lost_at_bends_mm: float = 0.0


@dataclass(frozen=True)
class Criterion:
    """One quality figure of a page and the limits set for it by a guideline.

    Attributes
    ----------
    name, unit : str
    value : float
    limits : (float, float, float, float)
        For one to four stars.
    stars : int
        Stars reached, 0 to 4.
    """

    name: str
    unit: str
    value: float
    limits: tuple[float, float, float, float]
    stars: int


@dataclass(frozen=True)
class GuidelineReport:
    """Page quality graded by a digitisation guideline.

    Attributes
    ----------
    name : str
        Guideline, edition and kind of material.
    criteria : list of Criterion
    not_graded : list of str
        Criteria of the guideline that cannot be measured without a reference target.
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
    verdict : Verdict
        How good the page is, derived from all of this; in the JSON its word.
    reasons, reason_codes : list of str
        Why it is not good, or should be looked at; in the JSON.
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
    photos : PhotosReport or None
        Where it came from several.
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
    photos: PhotosReport | None = None
    guideline: GuidelineReport | None = None
    settings: RestoreSettings | None = None

    def __repr__(self) -> str:
        size = f"{self.page.width_mm:.1f} x {self.page.height_mm:.1f} mm"
        error = f"expected error {self.flatten.expected_error_mm:.3f} mm"
        return f"Report({self.verdict.word}: {size}, {error}, {len(self.warnings)} warnings; {self.outcome})"

    @property
    def warning_codes(self) -> list[str]:
        """Codes of the warnings, for programs."""
        return [warning.code for warning in self.warnings]

    @property
    def verdict(self) -> Verdict:
        """How good the page is."""
        flat, page, faces = self.flatten, self.page, max(self.scan.faces, 1)
        return judge(
            Evidence(
                settled=self.settled,
                outcome=self.outcome,
                strain_rms=flat.strain_rms,
                expected_error_mm=flat.expected_error_mm,
                shorter_side_mm=min(page.width_mm, page.height_mm),
                flipped=flat.flipped_faces / faces,
                overlaps=flat.overlaps / faces,
                known_fraction=page.known_fraction,
                rim=_rim(page, self.scan.points),
                warnings=self.warnings,
            )
        )

    @property
    def notes(self) -> list[Diagnostic]:
        """Warnings that are no reason of the verdict."""
        return [warning for warning in self.warnings if warning not in self.verdict.reasons]

    def to_dict(self) -> dict[str, Any]:
        """What the JSON holds: warnings as sentences, with settings named as in Python, and their codes beside them."""
        verdict = self.verdict
        plain: dict[str, Any] = {
            "verdict": verdict.word,
            "reasons": [str(reason) for reason in verdict.reasons],
            "reason_codes": [reason.code for reason in verdict.reasons],
        }
        for name, value in asdict(self).items():
            plain[name] = value
            if name == "warnings":
                plain |= {"warnings": [str(warning) for warning in self.warnings], "warning_codes": self.warning_codes}
        return plain


def _rim(page: PageReport, points: int) -> float:
    """Part of a page within half a spacing of its border: s (w + h) / (w h), with s = sqrt(w h / points)."""
    area = page.width_mm * page.height_mm
    return (page.width_mm + page.height_mm) / math.sqrt(area * points) if area * points > 0 else 0.0
