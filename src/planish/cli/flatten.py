"""`planish flatten`: geometry only, for meshes with or without a photo."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from planish.cli.options import Output, Quiet, Verbose
from planish.settings import FlattenSettings, RestoreSettings, Rotation, Units


def flatten(
    mesh: Path,
    /,
    *,
    output: Output,
    as_: Annotated[Literal["points", "uv"], Parameter(name="--as")] = "points",
    units: Units = "auto",
    flattening: Annotated[FlattenSettings, Parameter(name="*")] = FlattenSettings(),
    rotate: Rotation = "auto",
    report: Path | None = None,
    overwrite: bool = True,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> bool:
    """Flatten a mesh: its points in their order, moved to the plane z = 0, in mm.

    Parameters
    ----------
    mesh
        OBJ, PLY, GLB or glTF, or a tifxyz folder.
    output
        The flattened mesh: .obj, .ply or .glb, or a folder for tifxyz (with --as uv). A .ply carries the strain and
        the expected error of every point.
    as_
        points: the points move to the plane. uv: they stay in space, and their place on the page becomes the texture
        coordinate, in mm.
    units
        The unit of the mesh's numbers. auto decides from the file and from its size, and says so.
    rotate
        auto: long side upright. A number: clockwise turn from the way round of the scan.
    report
        Also write the report as JSON.
    overwrite
        Whether files in place may be replaced.
    quiet
        Print nothing but errors.
    verbose
        Print the table even when the output is piped.
    """
    from dataclasses import replace
    from time import perf_counter

    from planish.cli.console import progress, show
    from planish.io import all_or_nothing, check_flat_name, check_writable, read_scan, write_flat, write_json
    from planish.job import with_files
    from planish.pipeline import restore

    check_flat_name(output, as_)
    outputs = [path for path in (output, report) if path is not None]
    for path in outputs:
        check_writable(path, overwrite=overwrite)
    with progress(quiet=quiet) as tell, all_or_nothing():
        start = perf_counter()
        tell("read", 0.0)
        found = read_scan(mesh, units=units)
        read = perf_counter() - start
        done = restore(replace(found.scan, photo=None), RestoreSettings(flatten=flattening, rotate=rotate), tell)
        start = perf_counter()
        tell("write", 0.0)
        scalars = {"strain": done.flattening.local_strain, "expected_error_mm": done.flattening.error_mm}
        write_flat(
            output, found, done.flattening.page_xy, as_=as_, scalars=scalars if output.suffix == ".ply" else None
        )
        account = with_files(done.report, found, read, perf_counter() - start)
        if report is not None:
            write_json(report, account)
    show(account, [str(path) for path in outputs], quiet=quiet, verbose=verbose)
    return account.settled
