"""`planish restore`: the whole walk, from a scan's file to the page's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.options import Output, Quiet, Verbose
from planish.settings import (
    BinarizeSettings,
    FlattenSettings,
    Pages,
    RenderSettings,
    RestoreSettings,
    Rotation,
    ShadingSettings,
    Units,
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
    from planish.cli.talk import progress, show
    from planish.job import Job, Outputs, run

    job = Job(
        scan=scan,
        photo=tuple(photo or ()),
        camera=tuple(camera or ()),
        units=units,
        settings=RestoreSettings(
            flatten=flattening, render=drawing, shading=shading, binarize=binarizing, rotate=rotate, pages=pages
        ),
        outputs=Outputs(
            page=output,
            binary=binary,
            mask=mask,
            flat=flat,
            report=report,
            stages=stages,
            certificate=certificate,
            pdfa=pdfa,
            ocr=ocr,
            overwrite=overwrite,
        ),
    )
    with progress(quiet=quiet) as tell:
        done = run(job, tell)
    show(done.report, [str(path) for path in done.written], quiet=quiet, verbose=verbose)
    return done.report.settled
