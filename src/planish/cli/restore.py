"""`planish restore`: the whole walk, from a scan's file to the page's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.options import Output, Quiet, Verbose
from planish.cli.restore_options import Flags, RestoreOptions
from planish.settings import Units

Repeatable = Parameter(negative="")


def restore(
    scan: Path,
    /,
    *,
    output: Output,
    photo: Annotated[list[Path], Repeatable] | None = None,
    camera: Annotated[list[Path], Repeatable] | None = None,
    units: Units = "auto",
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
    html
        Also write one HTML file to look at: the scan in 3D as it settles, the page beside the photo, maps of how good
        it is, and the report in words. `planish view` makes the same of a finished restoration.
    overwrite
        Whether files in place may be replaced.
    quiet
        Print nothing but errors.
    verbose
        Print the table even when the output is piped.
    """
    from planish.cli.console import print_report, progress_bar
    from planish.job import Job, Outputs, run

    job = Job(
        scan=scan,
        photo=tuple(photo or ()),
        camera=tuple(camera or ()),
        units=units,
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
    with progress_bar(quiet=quiet) as progress:
        result = run(job, progress)
    print_report(result.report, [str(path) for path in result.written], quiet=quiet, verbose=verbose)
    return result.report.settled
