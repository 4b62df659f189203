"""`planish restore`: the whole walk, from a scan's file to the page's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.options import Output, Quiet, Units, Verbose
from planish.settings import (
    BinarizeSettings,
    FlattenSettings,
    Pages,
    RenderSettings,
    RestoreSettings,
    Rotation,
    ShadingSettings,
)

Flags = Parameter(name="*")
Several = Parameter(negative="")


def restore(
    scan: Path,
    /,
    *,
    output: Output,
    photo: Annotated[list[Path], Several] | None = None,
    camera: Annotated[list[Path], Several] | None = None,
    units: Units = "auto",
    flattening: Annotated[FlattenSettings, Flags] = FlattenSettings(),
    drawing: Annotated[RenderSettings, Flags] = RenderSettings(),
    shading: Annotated[ShadingSettings, Flags] = ShadingSettings(),
    binarizing: Annotated[BinarizeSettings, Flags] = BinarizeSettings(),
    rotate: Rotation = "auto",
    pages: Pages = "1",
    pdfa: Annotated[bool, Parameter(negative="")] = False,
    ocr: str | None = None,
    mask: Path | None = None,
    binary: Path | None = None,
    flat: Path | None = None,
    report: Path | None = None,
    stages: Path | None = None,
    certificate: Path | None = None,
    overwrite: bool = True,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> bool:
    """Flatten a scan and draw its page at true size.

    Parameters
    ----------
    scan
        The scan: OBJ, PLY, GLB or glTF, or a tifxyz folder, with its photo as texture or given by --photo.
    output
        The page to write: .tif, .png, .jpg or .pdf, with its true dpi in the file.
    photo
        The photo, where the scan's file does not name it. Given several times: photos of the same sheet, from which
        the page takes every place as it is seen best; the colours are the first one's.
    camera
        The camera that took the photo (JSON), where the scan has no texture coordinates. For several photos: one for
        each, in the same order, or one file that has all of them by name.
    units
        The unit of the scan's numbers. auto decides from the file and from its size, and says so.
    rotate
        auto: as the text reads; where there is none, long side upright and the photo's top on top. A number: clockwise
        turn from the photo's way round.
    pages
        2: the sheet is an open book, and is split at its spine into a left and a right page: of one TIFF or PDF, or
        NAME-1.png and NAME-2.png. auto: only where a spine is plain in the surface and no line of text crosses it.
        1: the sheet stays whole.
    pdfa
        Make PDFs for archives: PDF/A-2b.
    ocr
        Lay the text that Tesseract reads under the pages of a PDF, to be searched and copied; its language, as eng
        or deu+fra. Needs the extra planish[ocr].
    mask
        Also write what is known of the page, as .png or .tif: 255 seen, 128 clipped in the photo, 0 missing.
    binary
        Also write the page in black and white.
    flat
        Also write the flattened mesh: the scan's points in the scan's order, moved to the plane [mm].
    report
        Also write the report as JSON.
    stages
        Also write pictures of every stage into this folder.
    certificate
        Also write one sheet that shows how good the page is: .pdf, .png, .tif or .jpg.
    overwrite
        Whether files in place may be replaced.
    quiet
        Print nothing but errors.
    verbose
        Print the table even when the output is piped.
    """
    from dataclasses import replace
    from time import perf_counter

    from planish.cli.pages import PageFiles, check_page_files, read_text, write_page_files
    from planish.cli.stages import write_certificate, write_stages
    from planish.cli.talk import progress, show, with_files
    from planish.errors import InputError, UsageError
    from planish.io import (
        all_or_nothing,
        check_flat_name,
        check_page_name,
        check_writable,
        fingerprints,
        read_scan,
        way_up,
        write_flat,
        write_json,
    )
    from planish.pipeline import restore as restore_scan

    most_pages = 1 if pages == "1" else 2
    files = PageFiles(output=output, binary=binary, mask=mask, most_pages=most_pages, pdfa=pdfa, ocr=ocr)
    check_page_files(files)
    if binary is not None and binarizing.binarize == "none":
        raise UsageError("--binary is for a page in black and white, and --binarize none makes none; name a method")
    if flat is not None:
        check_flat_name(flat)
    if certificate is not None:
        check_page_name(certificate)
    others = [path for path in (flat, report, certificate) if path is not None]
    for path in [*files.names(), *others]:
        check_writable(path, overwrite=overwrite)
    settings = RestoreSettings(
        flatten=flattening, render=drawing, shading=shading, binarize=binarizing, rotate=rotate, pages=pages
    )
    with progress(quiet=quiet) as tell, all_or_nothing():
        start = perf_counter()
        tell("read", 0.0)
        found = read_scan(scan, photo=photo, camera=camera, units=units)
        if found.scan.photo is None:
            why = "".join(f"; {warning}" for warning in found.warnings)
            raise InputError(
                f"{scan} came without a photo that can be drawn{why}; give --photo, or use `planish flatten` for the "
                "geometry alone"
            )
        sources = fingerprints(found.sources)
        read = perf_counter() - start
        done = restore_scan(found.scan, settings, tell, way_up)
        text, seconds = [], dict(done.report.seconds)
        if ocr is not None:
            start = perf_counter()
            tell("text", 0.0)
            text = read_text(done, ocr)
            seconds["text"] = perf_counter() - start
        done = replace(done, report=replace(done.report, seconds=seconds, sources=sources))
        start = perf_counter()
        tell("write", 0.0)
        outputs = [*write_page_files(files, done, binarizing.binarize, text), *others]
        if flat is not None:
            write_flat(flat, found, done.flattening.page_xy)
        if stages is not None:
            outputs += write_stages(stages, found.scan, done)
        account = with_files(done.report, found, read, perf_counter() - start)
        if certificate is not None:
            write_certificate(certificate, scan.name, found.scan, replace(done, report=account))
        if report is not None:
            write_json(report, account)
    show(account, [str(path) for path in outputs], quiet=quiet, verbose=verbose)
    return account.settled
