"""The report of a restoration, put together from what each stage left."""

from __future__ import annotations

import numpy as np

from planish.geometry.distances import distances
from planish.mesh import Cleaned
from planish.report.measures import flipped_faces, stretch
from planish.sticks import strain
from planish.types import Flattening, FlattenReport, Outcome, PageReport, Report, Scan, ScanReport
from planish.version import __version__

STRETCHED = 0.01
"""Paper stretches by some tenths of a percent. What is farther from its lengths is no sheet there, or badly scanned."""


def build_report(
    scan: Scan,
    cleaned: Cleaned,
    flat: Flattening,
    page: PageReport,
    seconds: dict[str, float],
    warnings: list[str],
) -> Report:
    """Measure a flattening and gather all that is to be said about a restoration.

    Parameters
    ----------
    scan : Scan
        As it came.
    cleaned : Cleaned
        As it was flattened.
    flat : Flattening
        Of the points of `cleaned.scan.mesh`.
    page : PageReport
    seconds : dict
        Per stage.
    warnings : list of str
        Of all stages so far, in order.
    """
    mesh, edges = cleaned.scan.mesh, cleaned.topology.edges
    l2, linf = stretch(mesh.points, mesh.faces, flat.page_xy)
    flipped = flipped_faces(mesh.faces, flat.page_xy)
    said = list(warnings)
    if flipped:
        said.append(
            f"{flipped:,} of {len(mesh.faces):,} faces lie on the page with their back up; the page is torn there"
        )
    worst = int(np.argmax(flat.local_strain))
    if flat.local_strain[worst] > STRETCHED:
        x, y = flat.page_xy[worst]
        said.append(
            f"the surface does not lie flat everywhere: around {x:.0f} mm from the left and {y:.0f} mm from the top of "
            f"the page its edges are {100 * flat.local_strain[worst]:.1f} % (rms) from their lengths"
        )
    if flat.overlaps:
        said.append(f"{flat.overlaps:,} faces lie over other parts of the page; what is under them is not seen")
    return Report(
        version=__version__,
        outcome=flat.outcome.value,
        settled=flat.outcome is Outcome.SETTLED,
        seconds_total=sum(seconds.values()),
        seconds=seconds,
        scan=ScanReport(
            points=len(scan.mesh.points),
            faces=len(scan.mesh.faces),
            pieces=cleaned.pieces,
            holes=cleaned.holes,
            noise_mm=flat.noise_mm,
        ),
        flatten=FlattenReport(
            method=flat.method,
            lengths=flat.lengths,
            points=flat.solved_points,
            iterations=flat.iterations,
            seconds=flat.seconds,
            strain_rms=flat.strain[0],
            strain_max=flat.strain[1],
            strain_raw_rms=strain(flat.page_xy, edges, distances(mesh.points, edges))[0],
            stretch_l2=l2,
            stretch_linf=linf,
            flipped_faces=flipped,
            overlaps=flat.overlaps,
            passed_points=flat.passed_points,
            expected_error_mm=float(np.sqrt(np.mean(flat.error_mm**2))),
        ),
        page=page,
        warnings=said,
    )
