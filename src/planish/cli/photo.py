"""`planish photo`: restore the page from a photo, without a scan."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.options import Output, Quiet, Verbose
from planish.settings import BinarizeSettings, PhotoSettings, RenderSettings, Rotation, ShadingSettings

Flags = Parameter(name="*")


def photo(
    photo: Path,
    /,
    *,
    output: Output,
    shape: Annotated[PhotoSettings, Flags] = PhotoSettings(),
    rendering: Annotated[RenderSettings, Flags] = RenderSettings(dpi="auto"),
    shading: Annotated[ShadingSettings, Flags] = ShadingSettings(shading="background"),
    binarizing: Annotated[BinarizeSettings, Flags] = BinarizeSettings(),
    rotate: Rotation = "auto",
    binary: Path | None = None,
    report: Path | None = None,
    stages: Path | None = None,
    overwrite: bool = True,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> bool:
    """Flatten the page in a single photo, without a scan.

    The shape is estimated from text lines and the borders of the sheet. Warnings name what one photo cannot determine.

    Parameters
    ----------
    photo
        The photo: JPEG, PNG, TIFF, WebP, BMP, JPEG 2000 or PPM.
    output
        The page to write: .tif, .png, .jpg or .pdf; with its dpi as metadata if --width-mm or --paper is given.
    rotate
        auto: upright text; without text, portrait format with the photo's top up. A number: clockwise rotation in
        degrees from the orientation of the photo.
    binary
        Also write the binarized page.
    report
        Also write the report as JSON.
    stages
        Also write images of every stage into this folder.
    overwrite
        Whether existing files may be replaced.
    quiet
        Print nothing but errors.
    verbose
        Print the report table even if the output is piped.
    """
    from dataclasses import replace
    from time import perf_counter

    from planish.cli.console import print_report, progress_bar
    from planish.errors import UsageError
    from planish.io import (
        all_or_nothing,
        check_page_name,
        check_writable,
        focal_length_px,
        read_photo,
        way_up,
        write_json,
        write_page,
        write_unscaled_page,
    )
    from planish.job.stage_images import write_stages
    from planish.photo import find_shape
    from planish.pipeline import restore
    from planish.settings import RestoreSettings

    for path in (output, *([binary] if binary is not None else [])):
        check_page_name(path)
    if binary is not None and binarizing.binarize == "none":
        raise UsageError(
            "a binarized page was requested, but the binarization method is none", "name a method with {binarize}"
        )
    outputs = [path for path in (output, binary, report) if path is not None]
    for path in outputs:
        check_writable(path, overwrite=overwrite)
    if binary is None and stages is None:
        binarizing = replace(binarizing, binarize="none")
    settings = RestoreSettings(render=rendering, shading=shading, binarize=binarizing, rotate=rotate)
    with progress_bar(quiet=quiet) as progress, all_or_nothing():
        start = perf_counter()
        progress("read", 0.0)
        photo_image = read_photo(photo, upright=True)
        read_seconds = perf_counter() - start
        start = perf_counter()
        progress("shape", 0.0)
        sheet = find_shape(photo_image.pixels, shape, focal_px=focal_length_px(photo), icc=photo_image.icc)
        shape_seconds = perf_counter() - start
        restoration = restore(sheet.scan, settings, progress, way_up)
        start = perf_counter()
        progress("write", 0.0)
        page = restoration.page
        assert page is not None
        write = write_unscaled_page if sheet.report.scale == "unknown" else write_page
        write(output, page)
        if binary is not None:
            assert restoration.binary is not None
            write(binary, restoration.binary)
        if stages is not None:
            outputs += write_stages(stages, restoration)
        seconds = {
            "read": read_seconds,
            "shape": shape_seconds,
            **restoration.report.seconds,
            "write": perf_counter() - start,
        }
        final_report = replace(
            restoration.report,
            photo=sheet.report,
            seconds=seconds,
            seconds_total=sum(seconds.values()),
            warnings=[*photo_image.warnings, *sheet.warnings, *restoration.report.warnings],
        )
        if report is not None:
            write_json(report, final_report)
    print_report(final_report, [str(path) for path in outputs], quiet=quiet, verbose=verbose)
    return final_report.settled
