"""`planish restore`: from a scan file to the page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from planish.cli.options import FileUnit, Output, Quiet, Verbose
from planish.cli.restore_options import Flags, RestoreOptions


def restore(
    scan: Path,
    /,
    *,
    output: Output,
    photo: list[Path] | None = None,
    camera: list[Path] | None = None,
    file_unit: FileUnit = FileUnit(),
    restore_options: Annotated[RestoreOptions, Flags] = RestoreOptions(),
    mask: Path | None = None,
    binary: Path | None = None,
    flat: Path | None = None,
    report: Path | None = None,
    stages: Path | None = None,
    certificate: Path | None = None,
    html: Path | None = None,
    overwrite: bool = True,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> bool:
    """Flatten a scan and render its page at true size.

    Parameters
    ----------
    scan
        The scan: OBJ, PLY, GLB, glTF, STL, OFF, 3MF, DAE, X3D, VRML or USDZ, or a tifxyz folder, with a photo as
        texture or given by --photo.
    output
        The page to write: .tif, .png, .jpg or .pdf, with its dpi as metadata.
    photo
        The photo, if the scan file does not reference it. May be repeated for several photos of the same sheet: each
        part of the page comes from the photo that shows it best, with colours matched to the first photo.
    camera
        The camera of the photo (JSON), if the scan has no texture coordinates. For several photos: one per photo, in
        the same order, or one file with all of them by name.
    mask
        Also write a mask of the page as .png or .tif: 255 valid, 128 clipped in the photo, 0 missing.
    binary
        Also write the binarized page.
    flat
        Also write the flattened mesh: the scan's points, in their order, mapped to the plane [mm].
    report
        Also write the report as JSON.
    stages
        Also write images of every stage into this folder.
    certificate
        Also write a one-page quality certificate: .pdf, .png, .tif or .jpg.
    html
        Also write an interactive HTML file: the scan in 3D as it settles, the page beside the photo, quality maps, and
        the report. `planish view` makes the same from a finished restoration.
    overwrite
        Whether existing files may be replaced.
    quiet
        Print nothing but errors.
    verbose
        Print the report table even if the output is piped.
    """
    from planish.cli.console import EarlyNotes, pipeline_progress, print_report
    from planish.job import Job, Outputs, run

    job = Job(
        scan=scan,
        photo=tuple(photo or ()),
        camera=tuple(camera or ()),
        units=file_unit.unit(),
        sheet=restore_options.sheet_mask,
        settings=restore_options.settings(),
        outputs=Outputs(
            page=output,
            binary=binary,
            mask=mask,
            flat=flat,
            report=report,
            stages=stages,
            certificate=certificate,
            html=html,
            pdfa=restore_options.pdfa,
            ocr=restore_options.ocr,
            overwrite=overwrite,
        ),
    )
    notes = EarlyNotes(quiet=quiet)
    with pipeline_progress(quiet=quiet) as progress:
        result = run(job, progress, notes)
    print_report(
        result.report, [str(path) for path in result.written], quiet=quiet, verbose=verbose, printed=notes.printed
    )
    return result.report.verdict.usable
