"""The whole walk: a scan goes in; the flat page and an account of it come out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from planish.binarize import binarize
from planish.document import SURE, detect_orientation, find_gutter, gutter_of_surface, skew_angle
from planish.flattening import direction_of_growth, to_page_frame, turned
from planish.flattening import flatten as lay_flat
from planish.geometry.viewpoint import viewpoint
from planish.illumination import ShadingFit, remove_shading
from planish.mesh import Cleaned, clean, to_file_order
from planish.render import Rendered, draw, missing_regions, preview
from planish.report import build_report, guideline
from planish.settings import FlattenSettings, Pages, RestoreSettings, Rotation
from planish.surface import smooth_normals
from planish.types import (
    Flattening,
    Floats,
    Ints,
    Mesh,
    Page,
    PageReport,
    PartReport,
    Restoration,
    Scan,
    ShadingReport,
    Spine,
)

SENSE_DPI = 150.0
"""Of the quick page that is looked at to find which way the text runs."""
LEVEL = 0.1
"""Degrees by which lines of text may lean before the page is turned: a millimetre over 500."""

Progress = Callable[[str, float], None]
"""Told the name of the stage and the share of it that is done."""

WayUp = Callable[[Page], int | None]
"""Shown a page, tells by how many degrees it must be turned clockwise to stand upright; None where it cannot tell."""


def restore(
    scan: Scan,
    settings: RestoreSettings | None = None,
    progress: Progress | None = None,
    way_up: WayUp | None = None,
) -> Restoration:
    """Flatten a scan and draw its page.

    Parameters
    ----------
    scan : Scan
        Without a photo only the geometry is done.
    settings : RestoreSettings, optional
    progress : callable, optional
        Told (stage, share done) now and then.
    way_up : callable, optional
        A second voice, asked where the shapes of the letters do not tell which way up the page is.

    Raises
    ------
    InputError
        Where the scan is not a sheet that can be flattened, or its photo cannot be drawn.

    Examples
    --------
    >>> from planish.gallery import sheet, sheet_mesh
    >>> mesh, _ = sheet_mesh(sheet("book"), points=4000, layout="grid")
    >>> done = restore(Scan(mesh))
    >>> done.report.settled, [round(mm) for mm in done.flattening.size_mm]
    (True, [216, 279])
    """
    s = settings or RestoreSettings()
    stage = Stages(progress or (lambda name, share: None))
    with stage("clean"):
        cleaned = clean(scan)
    with stage("flatten") as tell:
        sheet = cleaned.scan
        eye = viewpoint(sheet.mesh, sheet.photo_xy, cleaned.topology.edges)
        flat = lay_flat(sheet.mesh, cleaned.topology, s.flatten, tell, eye=eye)
    with stage("turn"):
        flat = _the_right_way_round(cleaned, flat, s.rotate, as_its_mesh=scan.upright > 0)
        if s.pages != "1" and s.rotate == "auto":
            flat = _with_its_spine_upright(cleaned, flat)
    rendered = unshaded = binary = spine = None
    if scan.photo is not None:
        if s.rotate == "auto":
            with stage("turn"):
                look = preview(cleaned.scan, flat.page_xy, flat.size_mm, SENSE_DPI)
                flat = _as_its_text_reads(flat, look, way_up, scan.upright)
        with stage("render"):
            rendered = draw(cleaned.scan, flat.page_xy, flat.size_mm, s.render)
        if s.pages != "1":
            with stage("split"):
                spine = find_gutter(cleaned.scan.mesh, flat.page_xy, rendered.page, certainly=s.pages == "2")
        if s.shading.shading != "none":
            with stage("unshade"):
                normals = flat.normals
                if normals is None:
                    normals = smooth_normals(cleaned.scan.mesh, cleaned.topology)
                unshaded = remove_shading(rendered.page, cleaned.scan, flat.page_xy, normals, s.shading)
        if s.binarize.binarize != "none":
            with stage("binarize"):
                binary = binarize(unshaded.page if unshaded else rendered.page, s.binarize)
    with stage("measure"):
        warnings = [*cleaned.warnings, *flat.warnings, *(unshaded.fit.warnings if unshaded else ())]
        warnings += _said_of_pages(spine, s.pages) if rendered else []
        report = build_report(scan, cleaned, flat, _page_report(flat, rendered), stage.seconds, warnings)
    if unshaded:
        report = replace(report, shading=_shading_report(unshaded.fit))
    if rendered:
        report = replace(report, pages=_part_reports(flat, spine), spine=spine)
    report = replace(report, guideline=guideline(report), settings=s)
    report = replace(report, seconds=stage.seconds, seconds_total=sum(stage.seconds.values()))
    flat = _in_file_order(cleaned, scan, flat)
    return Restoration(
        flat,
        rendered.page if rendered else None,
        unshaded.page if unshaded else None,
        binary,
        report,
        clipped=unshaded.clipped if unshaded else None,
        light=unshaded.light if unshaded else None,
        ppi=rendered.resolution.ppi if rendered else None,
    )


def flatten(
    mesh: Mesh | Floats,
    faces: Ints | None = None,
    settings: FlattenSettings | None = None,
    progress: Callable[[float], None] | None = None,
) -> Flattening:
    """Lay a mesh flat: the geometry alone, from plain arrays.

    Parameters
    ----------
    mesh : Mesh or (n, 3) float64 [mm]
        Or the points alone, with `faces` beside them.
    faces : (m, 3) int, optional
        Counter-clockwise seen from the printed side.
    settings : FlattenSettings, optional
    progress : callable, optional
        Told the share of the work that is done, now and then.

    Returns
    -------
    Flattening
        `page_xy` (n, 2) has every point's place in the order that came in: x right, y down, in mm.

    Raises
    ------
    InputError
        Where the mesh is not a sheet that can be flattened.

    Examples
    --------
    A strip bent over a quarter of a cylinder of radius 100:

    >>> angle = np.linspace(0, np.pi / 2, 50)
    >>> points = np.array([[100 * np.sin(a), y, 100 * np.cos(a)] for a in angle for y in (0.0, 10.0)])
    >>> left = np.arange(0, 98, 2)
    >>> faces = np.r_[np.c_[left, left + 2, left + 1], np.c_[left + 1, left + 2, left + 3]]
    >>> [round(float(mm), 1) for mm in flatten(points, faces).size_mm]
    [10.0, 157.1]
    """
    sheet = mesh if isinstance(mesh, Mesh) else Mesh(mesh, np.zeros((0, 3), np.int32) if faces is None else faces)
    cleaned = clean(Scan(sheet))
    flat = lay_flat(cleaned.scan.mesh, cleaned.topology, settings, progress)
    flat = _the_right_way_round(cleaned, flat, "auto")
    return replace(_in_file_order(cleaned, Scan(sheet), flat), warnings=(*cleaned.warnings, *flat.warnings))


@dataclass
class Stages:
    """Names and times the stages of the walk."""

    progress: Progress
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, name: str) -> Iterator[Callable[[float], None]]:
        """Time a stage; gives what tells its progress."""
        self.progress(name, 0.0)
        start = perf_counter()
        yield lambda share: self.progress(name, share)
        self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start
        self.progress(name, 1.0)


def _the_right_way_round(
    cleaned: Cleaned, flat: Flattening, rotate: Rotation, long_side_upright: bool = True, as_its_mesh: bool = False
) -> Flattening:
    """Sides along x and y, long side upright, the photo's top on top; or as the user said, from the photo's top.

    Where the mesh itself is known to stand upright, so does the page, lying or not.
    """
    mesh, photo_xy = cleaned.scan.mesh, cleaned.scan.photo_xy
    if as_its_mesh and rotate == "auto":
        long_side_upright = False
    if photo_xy is None or (as_its_mesh and rotate == "auto"):
        up = direction_of_growth(flat.page_xy, mesh.points[:, 1])
    elif photo_xy.ndim == 2:
        up = -direction_of_growth(flat.page_xy, photo_xy[:, 1])
    else:
        up = -direction_of_growth(flat.page_xy[mesh.faces[:, 0]], photo_xy[:, 0, 1])
    page_xy, size = to_page_frame(flat.page_xy, up, long_side_upright=long_side_upright and rotate == "auto")
    if rotate not in ("auto", "0"):
        page_xy, size = turned(page_xy, float(rotate))
    return replace(flat, page_xy=page_xy, size_mm=size)


def _as_its_text_reads(flat: Flattening, page: Page, way_up: WayUp | None, upright: float) -> Flattening:
    """The sheet turned so that its lines of text are level and upright; the same one where they are, or there is none.

    The page is to be drawn anew afterwards, so that no pixel is filtered twice.
    """
    quarter, confidence = detect_orientation(page, upright)
    told = way_up(page) if way_up and confidence < SURE else None
    quarter = quarter if told is None else told
    clockwise = -quarter // 90
    skew, _ = skew_angle(replace(page, pixels=np.rot90(page.pixels, clockwise), known=np.rot90(page.known, clockwise)))
    if not quarter and abs(skew) <= LEVEL:
        return flat
    page_xy, size = turned(flat.page_xy, quarter - (skew if abs(skew) > LEVEL else 0.0))
    return replace(flat, page_xy=page_xy, size_mm=size)


def _with_its_spine_upright(cleaned: Cleaned, flat: Flattening) -> Flattening:
    """The sheet of an open book with its spine upright, and the photo's top on top if that can be; else as it is."""
    mesh = cleaned.scan.mesh
    as_photographed = _the_right_way_round(cleaned, flat, "auto", long_side_upright=False)
    page_xy, size = turned(flat.page_xy, 90.0)
    for way in (flat, as_photographed, replace(flat, page_xy=page_xy, size_mm=size)):
        if gutter_of_surface(mesh, way.page_xy, way.size_mm):
            return way
    return flat


def _said_of_pages(spine: Spine | None, pages: Pages) -> list[str]:
    """What a user should know of the cut."""
    if spine is None:
        return ["no spine is plain on the sheet, so it stays one page"] if pages == "auto" else []
    said = {
        "surface": "",
        "gutter": "the surface shows no spine; the sheet was split in the widest upright gap of its print, "
        f"{spine.x_mm:.0f} mm from the left",
        "middle": "the surface shows no spine and the print no gap; the sheet was split near its middle, "
        f"{spine.x_mm:.0f} mm from the left",
    }[spine.found_by]
    crossed = "lines of print run across the place where the sheet was split" if spine.crossed else ""
    return [sentence for sentence in (said, crossed) if sentence]


def _part_reports(flat: Flattening, spine: Spine | None) -> list[PartReport]:
    width, height = flat.size_mm
    if spine is None:
        return [PartReport("whole", 0.0, width, height)]
    return [
        PartReport("left", 0.0, spine.x_mm, height),
        PartReport("right", spine.x_mm, width - spine.x_mm, height),
    ]


def _in_file_order(cleaned: Cleaned, scan: Scan, flat: Flattening) -> Flattening:
    values = to_file_order(cleaned, scan.mesh.points, np.c_[flat.page_xy, flat.error_mm, flat.local_strain])
    normals = flat.normals
    if normals is not None:
        normals = to_file_order(cleaned, scan.mesh.points, normals.astype(np.float64)).astype(np.float32)
    return replace(flat, page_xy=values[:, :2], error_mm=values[:, 2], local_strain=values[:, 3], normals=normals)


def _shading_report(fit: ShadingFit) -> ShadingReport:
    return ShadingReport(fit.method, fit.paper_share, fit.unevenness_before, fit.unevenness, fit.clipped_share)


def _page_report(flat: Flattening, rendered: Rendered | None) -> PageReport:
    width, height = flat.size_mm
    if rendered is None:
        return PageReport(width, height)
    page, found = rendered.page, rendered.resolution
    missing = missing_regions(page)
    return PageReport(
        width,
        height,
        dpi=page.dpi,
        effective_ppi_p10=found.low_ppi,
        effective_ppi_median=found.median_ppi,
        known_fraction=float(page.known.mean()),
        photo_parts=list(rendered.parts),
        missing_regions=missing.regions,
        missing_mm2=missing.area_mm2,
    )
