"""Short table of the report for people."""

from __future__ import annotations

from planish.types.report import Report

USUAL = {
    "page": "of a letter 216 x 279, of A4 210 x 297",
    "expected error": "a scanner reaches 0.01 to 0.1, photos 0.1 to 0.5",
    "strain": "of smooth paper below 0.1 %, of crumpled paper 0.5 %",
    "stretch": "1 is perfect; 1.001 mean is usual",
    "flipped faces": "none, or a few at torn rims",
    "resolution": "300 ppi for archives, 150 to read",
    "seen": "above 95 %; what folds hide is missing",
    "paper": "below 3 % looks even",
}
"""What is usual of each figure, for a reader who sees one for the first time."""


UNMEASURED = "not known: one photo does not measure the shape"
"""Instead of an expected error: that of the flattening alone would be 0.000 mm for a page that is millimetres off."""


def usual(what: str) -> str:
    """What is usual of a figure, or nothing.

    Examples
    --------
    >>> usual("seen")
    'above 95 %; what folds hide is missing'
    """
    return USUAL.get(what, "")


def summary(report: Report) -> list[tuple[str, str]]:
    """Rows (label, value) of the table that the command line prints."""
    scan, flat, page = report.scan, report.flatten, report.page
    noise = "" if scan.noise_mm is None else f"; the scan's noise is {scan.noise_mm:.3f} mm"
    rows = [
        ("verdict", report.verdict.word),
        ("outcome", report.outcome),
        ("scan", f"{scan.points:,} points, {scan.faces:,} faces, in {scan.unit}"),
        ("flattened", f"{flat.method} on {flat.points:,} points, {flat.iterations} steps, {flat.seconds:.2f} s"),
        ("page", f"{page.width_mm:.1f} x {page.height_mm:.1f} mm"),
        ("expected error", UNMEASURED if report.photo else f"{flat.expected_error_mm:.3f} mm rms{noise}"),
        ("strain", f"{100 * flat.strain_rms:.3f} % rms, {100 * flat.strain_max:.2g} % greatest"),
        ("stretch", f"{flat.stretch_l2:.5f} mean, {flat.stretch_linf:.3f} greatest"),
        ("flipped faces", f"{flat.flipped_faces:,}, and {flat.overlaps:,} that overlap"),
    ]
    if page.dpi is not None and page.effective_ppi_median is not None and page.effective_ppi_p10 is not None:
        rows += [
            (
                "resolution",
                f"{page.dpi:g} dpi drawn; the photo has {page.effective_ppi_median:.0f} ppi (median), "
                f"{page.effective_ppi_p10:.0f} (10 % quantile)",
            ),
            ("seen", f"{100 * (page.known_fraction or 0):.1f} % of the page"),
        ]
    if report.shading is not None:
        light = report.shading
        rows.append(
            (
                "paper",
                f"even to {100 * light.unevenness:.1f} % of white ({100 * light.unevenness_before:.0f} % before), by "
                f"{light.method}",
            )
        )
    if report.guideline is not None:
        reached = ", ".join(f"{c.name} {c.stars}" for c in report.guideline.criteria)
        rows.append(("FADGI 2016", f"{reached} (stars of 4)"))
    stages = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in report.seconds.items())
    return [*rows, ("seconds", f"{report.seconds_total:.2f} ({stages})")]
