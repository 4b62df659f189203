"""`planish photo`: restore the page from one photo or several, without a scan."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from planish.cli.options import Output, Quiet, Verbose
from planish.settings import BinarizeSettings, PhotoSettings, RenderSettings, Rotation, Shading, ShadingSettings

Flags = Parameter(name="*")


@dataclass(frozen=True, kw_only=True)
class _Rendering(RenderSettings):
    dpi: float | Literal["auto"] = "auto"
    sharpen: float = 1.0


@dataclass(frozen=True, kw_only=True)
class _Shading(ShadingSettings):
    shading: Shading = "background"


def photo(
    photos: Annotated[list[Path], Parameter(name="PHOTOS")],
    /,
    *,
    output: Output,
    camera: Path | None = None,
    shape: Annotated[PhotoSettings, Parameter(name="*", negative="")] = PhotoSettings(),
    rendering: Annotated[_Rendering, Flags] = _Rendering(),
    shading: Annotated[_Shading, Flags] = _Shading(),
    binarizing: Annotated[BinarizeSettings, Flags] = BinarizeSettings(),
    rotate: Rotation = "auto",
    binary: Path | None = None,
    report: Path | None = None,
    stages: Path | None = None,
    overwrite: bool = True,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> bool:
    """Flatten the page in photos of a sheet, without a scanner.

    Several photos from around (better eight to twelve) measure the sheet; this needs the extra `planish[photos]`. From
    one photo its shape is estimated from text lines and the borders of the sheet, and warnings name what one photo
    cannot determine.

    Parameters
    ----------
    photos
        One photo, or several of the same sheet lying still, or a folder of them: JPEG, PNG, TIFF, WebP, BMP, JPEG 2000
        or PPM; with the extra `planish[photos]` also HEIC and raw.
    output
        The page to write: .tif, .png, .jpg or .pdf; with its dpi as metadata if --marker-mm, --width-mm, --paper
        or --distance-mm is given. With --pages 2 this and the other outputs become NAME-1 and NAME-2.
    camera
        With several photos: one calibrated lens that took all of them (JSON), or a file with the cameras of all photos
        by name. Default: found from the photos.
    rotate
        auto: upright text; without text, portrait format with the photo's top up. A number: clockwise rotation in
        degrees from the orientation of the photo.
    binary
        Also write the binarized page.
    report
        Also write the report as JSON.
    stages
        Also write images of every stage into this folder; with several photos also a map of what was measured and what
        is bridged.
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
        way_up,
        write_json,
        write_page,
        write_unscaled_page,
    )
    from planish.io.photo_set import photo_files
    from planish.job.photo_sheet import shape_of_several, shapes_of_one
    from planish.job.stage_images import write_stages
    from planish.pipeline import restore
    from planish.settings import RestoreSettings

    files = photo_files(photos)
    several = len(files) > 1
    if not several and (camera is not None or shape.marker_mm is not None or shape.distance_mm is not None):
        raise UsageError("--camera, --marker-mm and --distance-mm are for several photos; one photo was given")
    if several and shape.pages == "2":
        raise UsageError("--pages 2 is for one photo of facing pages; several photos show one sheet")
    if several and shape.shape != "auto":
        raise UsageError(f"--shape {shape.shape} is for one photo; several photos measure the shape")
    for path in (output, *([binary] if binary is not None else [])):
        check_page_name(path)
    if binary is not None and binarizing.binarize == "none":
        raise UsageError(
            "a binarized page was requested, but the binarization method is none", "name a method with {binarize}"
        )
    for written_to in (output, binary, report):
        for number in (1, 2) if shape.pages == "2" else (None,):
            if written_to is not None:
                check_writable(page_name(written_to, number), overwrite=overwrite)
    if binary is None and stages is None:
        binarizing = replace(binarizing, binarize="none")
    settings = RestoreSettings(render=rendering, shading=shading, binarize=binarizing, rotate=rotate)
    finished = []
    with progress_bar(quiet=quiet) as progress, all_or_nothing():
        sheets = (
            [shape_of_several(files, shape, camera, progress)] if several else shapes_of_one(files[0], shape, progress)
        )
        for sheet in sheets:
            restoration = restore(sheet.scan, settings, progress, way_up)
            start = perf_counter()
            progress("write", 0.0)
            assert restoration.page is not None
            write = write_page if sheet.scaled else write_unscaled_page
            written = [page_name(output, sheet.number)]
            write(written[0], restoration.page)
            if binary is not None:
                assert restoration.binary is not None
                written.append(page_name(binary, sheet.number))
                write(written[-1], restoration.binary)
            if report is not None:
                written.append(page_name(report, sheet.number))
            if stages is not None:
                written += write_stages(page_name(stages, sheet.number), restoration, sheet.measured)
            completed = sheet.completed(restoration, perf_counter() - start)
            if report is not None:
                write_json(page_name(report, sheet.number), completed)
            finished.append((completed, written))
    for completed, written in finished:
        print_report(completed, [str(path) for path in written], quiet=quiet, verbose=verbose)
    return all(completed.verdict.usable for completed, _ in finished)


def page_name(path: Path, number: int | None) -> Path:
    """NAME, or NAME-1 and NAME-2 of facing pages, whatever the format: each page has its own size and report.

    Examples
    --------
    >>> [page_name(Path("book.tif"), number).name for number in (None, 1, 2)]
    ['book.tif', 'book-1.tif', 'book-2.tif']
    """
    return path if number is None else path.with_name(f"{path.stem}-{number}{path.suffix}")
