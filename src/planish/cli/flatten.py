"""`planish flatten`: flatten a mesh, with or without a photo."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from planish.cli.options import FileUnit, Output, Quiet, Verbose
from planish.settings import FlattenSettings, RestoreSettings, Rotation


def flatten(
    mesh: Path,
    /,
    *,
    output: Output,
    as_: Annotated[Literal["points", "uv"], Parameter(name="--as")] = "points",
    uv: Literal["mm", "unit"] = "mm",
    triangles: bool = False,
    file_unit: FileUnit = FileUnit(),
    flattening: Annotated[FlattenSettings, Parameter(name="*")] = FlattenSettings(),
    rotate: Rotation = "auto",
    viewpoint: tuple[float, float, float] | None = None,
    sheet: str = "auto",
    report: Path | None = None,
    distortion: Path | None = None,
    overwrite: bool = True,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> bool:
    """Flatten a mesh: its points, in their order, mapped to the plane z = 0, in mm.

    Parameters
    ----------
    mesh
        OBJ, PLY, GLB, glTF, STL, OFF, 3MF, DAE, X3D, VRML or USDZ, or a tifxyz folder.
    output
        The flattened mesh: .obj, .ply or .glb, or a folder for tifxyz (with --as uv). A .ply includes strain and
        expected error per point, and strain and distortion per face.
    as_
        points: 2D positions replace the points. uv: the points stay in space, and their 2D positions become texture
        coordinates.
    uv
        Texture coordinates of --as uv. mm: millimetres on the page. unit: 0 to 1 along the longer side of the page, at
        the same scale along the shorter.
    triangles
        Cut quads and larger faces into triangles. By default faces are written as they were read.
    rotate
        auto: portrait format. A number: clockwise rotation in degrees from the orientation of the scan.
    viewpoint
        Where the scanner stood, x y z in mm in the coordinates of the mesh: noise is then removed along its rays. Range
        images that keep their rows and columns show it by themselves.
    sheet
        auto: leave out the table around the sheet where it is plainly one, with a note. all: keep the whole mesh. An
        image: keep what it shows white, of the photo's size; black is 0.
    report
        Also write the report as JSON.
    distortion
        Also write how far area, angles and lengths are distorted: mean, 99 % and worst as JSON, and beside it the
        numbers of each triangle as a NumPy file, .npz.
    overwrite
        Whether existing files may be replaced.
    quiet
        Print nothing but errors.
    verbose
        Print the report table even if the output is piped.
    """
    from dataclasses import replace
    from time import perf_counter

    import numpy as np

    from planish.cli.console import EarlyNotes, pipeline_progress, print_report
    from planish.io import (
        all_or_nothing,
        check_flat_name,
        check_writable,
        distortion_files,
        read_scan,
        uv_unit_mm,
        write_distortion,
        write_flat,
        write_json,
    )
    from planish.job import with_file_info
    from planish.pipeline import restore
    from planish.report import distortion as measure_distortion

    is_ply = output.suffix.lower() == ".ply"
    check_flat_name(output, as_, uv)
    outputs = [path for path in (output, report) if path is not None]
    if distortion is not None:
        outputs += distortion_files(distortion)
    for path in outputs:
        check_writable(path, overwrite=overwrite)
    notes = EarlyNotes(quiet=quiet)
    with pipeline_progress(quiet=quiet, draw=False) as progress, all_or_nothing():
        start = perf_counter()
        progress("read", 0.0)
        named = sheet not in ("auto", "all")
        loaded = read_scan(mesh, units=file_unit.unit(), sheet=sheet if named else None)
        notes(loaded.warnings)
        read_seconds = perf_counter() - start
        restoration = restore(
            replace(loaded.scan, viewpoint=None if viewpoint is None else np.array(viewpoint)),
            RestoreSettings(flatten=flattening, rotate=rotate, sheet="auto" if sheet == "auto" else "all"),
            progress,
            draw=False,
        )
        start = perf_counter()
        progress("write", 0.0)
        flat = restoration.flattening
        measured = measure_distortion(loaded.scan.mesh, flat) if distortion is not None or is_ply else None
        write_flat(
            output,
            loaded,
            flat.page_xy,
            as_=as_,
            uv=uv,
            triangles=triangles,
            scalars={"strain": flat.local_strain, "expected_error_mm": flat.error_mm} if is_ply else None,
            face_scalars=measured.columns() if is_ply and measured is not None else None,
        )
        if distortion is not None and measured is not None:
            write_distortion(
                distortion,
                measured.summary() | {"uv_step_mm": uv_unit_mm(flat.page_xy) if uv == "unit" else 1.0},
                measured.arrays() | {"polygon": loaded.polygons.triangle_owner},
            )
        final_report = with_file_info(restoration.report, loaded, read_seconds, perf_counter() - start)
        if report is not None:
            write_json(report, final_report)
    print_report(final_report, [str(path) for path in outputs], quiet=quiet, verbose=verbose, printed=notes.printed)
    return final_report.verdict.usable
