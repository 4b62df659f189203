"""The report of a restoration, put together from what each stage left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planish.geometry.distances import distances
from planish.mesh import edges_with_area
from planish.report.fadgi import graded
from planish.report.measures import flipped_faces
from planish.settings import RestoreSettings
from planish.sticks import strain, stretch
from planish.types import (
    Diagnostic,
    Flattening,
    FlattenReport,
    Outcome,
    PageReport,
    PartReport,
    PreparedScan,
    Report,
    ScanReport,
    ShadingReport,
    Spine,
)
from planish.version import __version__

STRETCHED = 0.01
"""Paper stretches by some tenths of a percent. What is farther from its lengths is no sheet there, or badly scanned."""
THIN = 4.0
"""Faces less high than so many times the noise are turned over by it: of a random mesh of 200,000 faces of 0.8 mm with
0.05 mm of noise 484 lie on their back, 204 of them higher than the noise, 60 than twice, 7 than three times, none than
four times as much."""


def build_report(
    prepared: PreparedScan,
    flat: Flattening,
    page: PageReport,
    *,
    settings: RestoreSettings,
    shading: ShadingReport | None = None,
    spine: Spine | None = None,
    warnings: Sequence[Diagnostic] = (),
    seconds: dict[str, float],
) -> Report:
    """Measure a flattening and put together the report of a restoration.

    Parameters
    ----------
    prepared : PreparedScan
        As it was flattened.
    flat : Flattening
        Of the points of `prepared.scan.mesh`.
    page : PageReport
    settings : RestoreSettings
    shading : ShadingReport, optional
        Where shading was removed.
    spine : Spine, optional
        Where the sheet was split.
    warnings : sequence of Diagnostic
        Of the stages after flattening, in order.
    seconds : dict
        Per stage.
    """
    mesh, edges = prepared.scan.mesh, prepared.topology.edges
    l2, linf = flat.stretch or stretch(mesh.points, mesh.faces, flat.page_xy)
    lengths = distances(mesh.points, edges)
    thin = THIN * (flat.noise_mm or 0.0)
    if thin > np.median(lengths) / 2:  # the mesh is as fine as its noise: all faces would be thin
        thin = 0.0
    flipped = flipped_faces(mesh.faces, flat.page_xy, mesh.points)
    torn = flipped_faces(mesh.faces, flat.page_xy, mesh.points, thin)
    lengths[~edges_with_area(lengths, prepared.topology.face_edges)] = 0.0
    found = [*prepared.warnings, *flat.warnings, *warnings]
    if flipped:
        sentence = f"{flipped:,} of {len(mesh.faces):,} faces lie on the page with their back up"
        if torn:
            found.append(Diagnostic("faces-flipped", f"{sentence}; the page is torn there"))
        else:
            found.append(Diagnostic("thin-faces-flipped", f"{sentence}; they are so thin that noise turned them over"))
    worst = int(np.argmax(flat.local_strain))
    if flat.local_strain[worst] > STRETCHED:
        x, y = flat.page_xy[worst]
        found.append(
            Diagnostic(
                "local-strain",
                f"the surface does not lie flat everywhere: around {x:.0f} mm from the left and {y:.0f} mm from the "
                f"top of the page its edges are {100 * flat.local_strain[worst]:.1f} % (rms) from their lengths",
            )
        )
    if flat.overlaps:
        sentence = f"{flat.overlaps:,} faces lie over other parts of the page; what is under them is not seen"
        found.append(Diagnostic("faces-overlap", sentence))
    report = Report(
        version=__version__,
        outcome=flat.outcome.value,
        settled=flat.outcome is Outcome.SETTLED,
        seconds_total=sum(seconds.values()),
        seconds=seconds,
        scan=ScanReport(
            points=len(prepared.source.mesh.points),
            faces=len(prepared.source.mesh.faces),
            pieces=prepared.pieces,
            holes=prepared.holes,
            noise_mm=flat.noise_mm,
            noise_length_mm=flat.noise_length_mm,
            spikes=flat.spikes,
        ),
        flatten=FlattenReport(
            method=flat.method,
            lengths=flat.lengths,
            points=flat.solved_points,
            iterations=flat.iterations,
            seconds=flat.seconds,
            strain_rms=flat.strain[0],
            strain_max=flat.strain[1],
            strain_raw_rms=strain(flat.page_xy, edges, lengths)[0],
            stretch_l2=l2,
            stretch_linf=linf,
            flipped_faces=flipped,
            overlaps=flat.overlaps,
            passed_points=flat.passed_points,
            expected_error_mm=float(np.sqrt(np.mean(flat.error_mm**2))),
        ),
        page=page,
        warnings=found,
        shading=shading,
        pages=_part_reports(flat.size_mm, spine) if page.dpi is not None else [],
        spine=spine,
        settings=settings,
    )
    return graded(report)


def _part_reports(size_mm: tuple[float, float], spine: Spine | None) -> list[PartReport]:
    width, height = size_mm
    if spine is None:
        return [PartReport("whole", 0.0, width, height)]
    return [
        PartReport("left", 0.0, spine.x_mm, height),
        PartReport("right", spine.x_mm, width - spine.x_mm, height),
    ]
