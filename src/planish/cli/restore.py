"""`planish restore`: the whole walk, from a scan's file to the page's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.cli.options import Output, Quiet, Units, Verbose
from planish.settings import (
    BinarizeSettings,
    FlattenSettings,
    RenderSettings,
    RestoreSettings,
    Rotation,
    ShadingSettings,
)

Flags = Parameter(name="*")


def restore(
    scan: Path,
    /,
    *,
    output: Output,
    photo: Path | None = None,
    camera: Path | None = None,
    units: Units = "auto",
    flattening: Annotated[FlattenSettings, Flags] = FlattenSettings(),
    drawing: Annotated[RenderSettings, Flags] = RenderSettings(),
    shading: Annotated[ShadingSettings, Flags] = ShadingSettings(),
    binarizing: Annotated[BinarizeSettings, Flags] = BinarizeSettings(),
    rotate: Rotation = "auto",
    binary: Path | None = None,
    flat: Path | None = None,
    report: Path | None = None,
    stages: Path | None = None,
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
        The photo, where the scan's file does not name it.
    camera
        The camera that took the photo (JSON), where the scan has no texture coordinates.
    units
        The unit of the scan's numbers. auto decides from the file and from its size, and says so.
    rotate
        auto: as the text reads; where there is none, long side upright and the photo's top on top. A number: clockwise
        turn from the photo's way round.
    binary
        Also write the page in black and white.
    flat
        Also write the flattened mesh: the scan's points in the scan's order, moved to the plane [mm].
    report
        Also write the report as JSON.
    stages
        Also write pictures of every stage into this folder.
    overwrite
        Whether files in place may be replaced.
    quiet
        Print nothing but errors.
    verbose
        Print the table even when the output is piped.
    """
    from time import perf_counter

    from planish.cli.stages import write_stages
    from planish.cli.talk import progress, show, with_files
    from planish.errors import InputError
    from planish.io import (
        check_flat_name,
        check_page_name,
        check_writable,
        read_scan,
        write_flat,
        write_json,
        write_page,
    )
    from planish.pipeline import restore as restore_scan

    check_page_name(output)
    if binary is not None:
        check_page_name(binary)
    if flat is not None:
        check_flat_name(flat)
    outputs = [path for path in (output, binary, flat, report) if path is not None]
    for path in outputs:
        check_writable(path, overwrite=overwrite)
    settings = RestoreSettings(flatten=flattening, render=drawing, shading=shading, binarize=binarizing, rotate=rotate)
    with progress(quiet=quiet) as tell:
        start = perf_counter()
        tell("read", 0.0)
        found = read_scan(scan, photo=photo, camera=camera, units=units)
        if found.scan.photo is None:
            why = "".join(f"; {warning}" for warning in found.warnings)
            raise InputError(
                f"{scan} came without a photo that can be drawn{why}; give --photo, or use `planish flatten` for the "
                "geometry alone"
            )
        read = perf_counter() - start
        done = restore_scan(found.scan, settings, tell)
        start = perf_counter()
        tell("write", 0.0)
        page = done.unshaded or done.rendered
        assert page is not None
        write_page(output, page)
        if binary is not None:
            assert done.binary is not None
            write_page(binary, done.binary)
        if flat is not None:
            write_flat(flat, found, done.flattening.page_xy)
        if stages is not None:
            outputs += write_stages(stages, found.scan, done)
        account = with_files(done.report, found, read, perf_counter() - start)
        if report is not None:
            write_json(report, account)
    show(account, [str(path) for path in outputs], quiet=quiet, verbose=verbose)
    return account.settled
