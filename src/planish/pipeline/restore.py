"""The whole pipeline: prepare, flatten, orient, draw, even out the light, report; binarized when asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

from planish.binarize import binarize
from planish.choices import chosen
from planish.document import find_gutter, reads_backwards
from planish.illumination import EvenlyLit, ShadingFit, remove_shading
from planish.pipeline.flatten import flatten_prepared, in_file_order
from planish.pipeline.huge import bounded_dpi
from planish.pipeline.orient import OrientationReader, orient_by_shape, orient_by_text
from planish.pipeline.prepare import prepare
from planish.pipeline.stages import Progress, StageTimer, no_progress
from planish.render import Rendered, missing_regions, photo_views, render_page, sharpened
from planish.report import build_report
from planish.settings import Pages, RestoreSettings
from planish.types import (
    Diagnostic,
    Flattening,
    Page,
    PageReport,
    PreparedScan,
    Restoration,
    Scan,
    ShadingReport,
    Spine,
)


@dataclass(frozen=True, eq=False)
class DrawnPage:
    """What came of the photo: nothing where the scan has none, or where a stage was not asked for."""

    rendered: Rendered | None = None
    lit: EvenlyLit | None = None
    spine: Spine | None = None
    warnings: tuple[Diagnostic, ...] = ()


def restore(
    scan: Scan,
    settings: RestoreSettings | None = None,
    progress: Progress | None = None,
    read_orientation: OrientationReader | None = None,
    *,
    draw: bool = True,
    **choices: Any,
) -> Restoration:
    """Flatten a scan and draw its page.

    Parameters
    ----------
    scan : Scan
        Without a photo only the geometry is done.
    settings : RestoreSettings, optional
    progress : callable, optional
        Called with (stage, share done).
    read_orientation : callable, optional
        Asked which way up the page is where the shapes of the letters do not tell; see `OrientationReader`.
    draw : bool
        False: only the geometry is done, and the photo tells the sheet from its surroundings at most.
    **choices
        Settings by name, those of the stages too, in place of `settings` or on top of them: `dpi=400`,
        `shading="none"`, `method="verlet"`.

    Raises
    ------
    InputError
        Where the scan is not a sheet that can be flattened, or its photo cannot be drawn.
    UsageError
        For a setting that there is not, or a wrong value.

    Examples
    --------
    >>> from planish.gallery import sheet, sheet_mesh
    >>> mesh, _ = sheet_mesh(sheet("book"), points=4000, layout="grid")
    >>> done = restore(Scan(mesh))
    >>> done.report.settled, [round(mm) for mm in done.flattening.size_mm]
    (True, [216, 279])
    """
    s = chosen(RestoreSettings, settings, choices)
    stage = StageTimer(progress or no_progress)
    with stage("clean"):
        prepared = prepare(scan, s.sheet)
    with stage("flatten") as share:
        prepared, flat = flatten_prepared(prepared, s.flatten, share, s.sheet)
    with stage("turn"):
        flat = orient_by_shape(prepared, flat, s)
    flat, drawn = (
        draw_page(prepared, flat, s, stage, read_orientation) if draw and scan.has_picture else (flat, DrawnPage())
    )
    rendered, lit = drawn.rendered, drawn.lit
    with stage("measure"):
        report = build_report(
            prepared,
            flat,
            _page_report(flat, rendered),
            settings=s,
            shading=_shading_report(lit.fit) if lit else None,
            spine=drawn.spine,
            warnings=_warnings(drawn, s.pages),
            seconds=stage.seconds,
        )
    return Restoration(
        flattening=in_file_order(prepared, flat),
        rendered=rendered.page if rendered else None,
        unshaded=lit.page if lit else None,
        report=report,
        prepared=prepared,
        clipped=lit.clipped if lit else None,
        light=lit.light if lit else None,
        ppi=rendered.resolution.ppi if rendered else None,
        make_binary=_binarizer(drawn, s),
    )


def _binarizer(drawn: DrawnPage, settings: RestoreSettings) -> Callable[[], Page] | None:
    """Binarization of the page, done once when it is first asked for; None where there is nothing to do."""
    if drawn.rendered is None or settings.binarize.binarize == "none":
        return None
    page = drawn.lit.page if drawn.lit else drawn.rendered.page
    return cache(partial(binarize, page, settings.binarize))


def draw_page(
    prepared: PreparedScan,
    flat: Flattening,
    settings: RestoreSettings,
    stage: StageTimer,
    read_orientation: OrientationReader | None,
) -> tuple[Flattening, DrawnPage]:
    """The stages that need a photo; the flattening comes back as its text reads."""
    sheet, s = prepared.scan, settings
    spine = lit = None
    with stage("turn"):
        views = photo_views(sheet, flat.page_xy, flat.size_mm)
        if s.rotate == "auto":
            source = prepared.source
            flat, views = orient_by_text(flat, views, read_orientation, source.upright, sheet.icc, source.paper_mm)
    render_settings, warnings = bounded_dpi(s.render, flat.size_mm, max(view.resolution.median_ppi for view in views))
    with stage("render"):
        rendered = render_page(views, flat.size_mm, render_settings, sheet.icc)
    if s.pages != "1":
        with stage("split"):
            spine = find_gutter(sheet.mesh, flat.page_xy, rendered.page, always=s.pages == "2")
    if s.shading.shading != "none":
        with stage("unshade"):
            normals = prepared.normals if flat.normals is None else flat.normals
            lit = remove_shading(rendered.page, sheet, flat.page_xy, normals, s.shading)
    if s.render.sharpen:
        with stage("sharpen"):
            sharp = sharpened(lit.page if lit else rendered.page, s.render.sharpen, rendered.resolution.median_ppi)
            if lit:
                lit = replace(lit, page=sharp)
            else:
                rendered = replace(rendered, page=sharp)
    with stage("turn"):
        warnings += _mirrored(lit.page if lit else rendered.page)
    return flat, DrawnPage(rendered, lit, spine, tuple(warnings))


def _mirrored(page: Page) -> list[Diagnostic]:
    """A warning where the text reads backwards."""
    if not reads_backwards(page):
        return []
    sentence = "the text reads backwards (or from right to left): the photo or the scan may be mirrored"
    return [Diagnostic("text-mirrored", sentence, "if so, mirror the photo and the scan, or export without mirroring")]


def _warnings(drawn: DrawnPage, pages: Pages) -> list[Diagnostic]:
    """What a user should know of the drawing stages."""
    if drawn.rendered is None:
        return []
    warnings = [*drawn.warnings, *(drawn.lit.fit.warnings if drawn.lit else ())]
    spine = drawn.spine
    if spine is None:
        one = Diagnostic("gutter-not-found", "no spine is plain on the sheet, so it stays one page")
        return [*warnings, one] if pages == "auto" else warnings
    if spine.found_by == "gutter":
        warnings.append(
            Diagnostic(
                "split-in-gap",
                "the surface shows no spine; the sheet was split in the widest upright gap of its print, "
                f"{spine.x_mm:.0f} mm from the left",
            )
        )
    elif spine.found_by == "middle":
        warnings.append(
            Diagnostic(
                "split-in-middle",
                "the surface shows no spine and the print no gap; the sheet was split near its middle, "
                f"{spine.x_mm:.0f} mm from the left",
            )
        )
    if spine.crossed:
        sentence = "lines of print run across the place where the sheet was split"
        warnings.append(Diagnostic("split-crosses-print", sentence))
    return warnings


def _shading_report(fit: ShadingFit) -> ShadingReport:
    return ShadingReport(fit.method, fit.paper_share, fit.unevenness_before, fit.unevenness, fit.clipped_share)


def _page_report(flat: Flattening, rendered: Rendered | None) -> PageReport:
    width, height = flat.size_mm
    if rendered is None:
        return PageReport(width, height)
    page, resolution = rendered.page, rendered.resolution
    missing = missing_regions(page)
    return PageReport(
        width,
        height,
        dpi=page.dpi,
        effective_ppi_p10=resolution.low_ppi,
        effective_ppi_median=resolution.median_ppi,
        known_fraction=float(page.known.mean()),
        photo_parts=list(rendered.parts),
        missing_regions=missing.regions,
        missing_mm2=missing.area_mm2,
    )
