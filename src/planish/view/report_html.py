"""The report of a restoration as HTML; all text that comes from files is escaped here."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from planish.report import summary
from planish.types import Diagnostic, Outcome, Report, Restoration
from planish.view.fall_animation import FallAnimation

METHODS = {"multigrid": "multigrid", "verlet": "the paper's particle system", "mass-spring": "the mass-spring system"}


def headline(report: Report) -> str:
    """Key figures, as HTML definition list items."""
    page, flat = report.page, report.flatten
    figures = [
        ("Page", f"{page.width_mm:.1f} × {page.height_mm:.1f}", "mm"),
        ("Expected error", f"{flat.expected_error_mm:.3f}", "mm rms"),
        ("Strain", f"{100 * flat.strain_rms:.3f}", "% rms"),
    ]
    if page.dpi is not None:
        figures.insert(1, ("Resolution", f"{page.dpi:g}", "dpi"))
    if page.effective_ppi_median is not None:
        figures.append(("Photo", f"{page.effective_ppi_median:.0f}", "ppi median"))
    if page.known_fraction is not None:
        figures.append(("Seen", f"{100 * page.known_fraction:.1f}", "% of the page"))
    return "\n".join(
        f"<div><dt>{escape(what)}</dt><dd>{escape(number)} <small>{escape(unit)}</small></dd></div>"
        for what, number, unit in figures
    )


def report_section(restoration: Restoration) -> str:
    """Summary sentences, warnings, guideline criteria, all figures, and source files, as HTML."""
    report = restoration.report
    paragraph = f"<p>{' '.join(escape(sentence) for sentence in _sentences(report))}</p>"
    return (
        f"<div>{paragraph}\n{_warnings_list(report.warnings)}\n{_guideline_table(report)}</div>\n"
        f"<div>{_figures_table(report)}\n{_sources_table(report.sources)}</div>"
    )


def animation_caption(restoration: Restoration, animation: FallAnimation) -> str:
    """Explains which states the slider shows."""
    flat = restoration.flattening
    ended = {
        Outcome.SETTLED: "",
        Outcome.STALLED: " It stalled there before the whole sheet had reached the table.",
        Outcome.CRUSHED: " It is crushed there: its lengths differ much from those of the paper.",
        Outcome.OUT_OF_STEPS: " It was still moving there at the maximum number of steps.",
        Outcome.DIVERGED: " It diverged after that.",
    }[animation.outcome]
    last = len(animation.states) - 1
    method = METHODS.get(flat.method, flat.method)
    rest = "" if restoration.report.settled else ", which did not settle"
    others = "; the other points are interpolated" if animation.moved_points < animation.states.shape[1] else ""
    return (
        f"Steps 0 to {last - 1} are states of the paper's particle system, which lets {animation.moved_points:,} "
        f"points of the sheet fall on a table ({last} of {int(animation.steps[-1]) + 1:,} states{others})."
        f"{ended} Step {last} is the page of this restoration, flattened by {method} on {flat.solved_points:,} points"
        f"{rest}."
    )


def _sentences(report: Report) -> list[str]:
    page, flat = report.page, report.flatten
    sentences = [
        f"The page is {page.width_mm:.1f} × {page.height_mm:.1f} mm; the expected error of its points is "
        f"{flat.expected_error_mm:.3f} mm (rms).",
    ]
    if page.effective_ppi_median is not None and page.effective_ppi_p10 is not None and page.dpi is not None:
        sentences.append(
            f"It was rendered at {page.dpi:g} dpi from a photo with a median of {page.effective_ppi_median:.0f} pixels "
            f"per inch of paper, and at least {page.effective_ppi_p10:.0f} on 90 % of the page."
        )
    if page.known_fraction is not None and page.known_fraction < 1:
        sentences.append(f"{100 * (1 - page.known_fraction):.1f} % of the page was not captured and is left blank.")
    if report.spine is not None:
        sentences.append(f"The sheet has two pages, split {report.spine.x_mm:.1f} mm from the left.")
    return sentences


def _warnings_list(warnings: Iterable[Diagnostic]) -> str:
    items = "".join(f"<li>{escape(_capitalized(str(warning)))}</li>" for warning in warnings)
    return f'<h3>Warnings</h3><ul class="notes">{items}</ul>' if items else "<p>There are no warnings.</p>"


def _figures_table(report: Report) -> str:
    rows = "".join(
        f'<tr><th scope="row">{escape(_capitalized(what))}</th><td>{escape(how_much)}</td></tr>'
        for what, how_much in summary(report)
        if what != "outcome"
    )
    return f'<h3>Figures</h3><table class="figures">{rows}</table>'


def _capitalized(text: str) -> str:
    return text[:1].upper() + text[1:]


def _guideline_table(report: Report) -> str:
    guideline = report.guideline
    if guideline is None or not guideline.criteria:
        return ""
    rows = "".join(
        f'<tr><th scope="row">{escape(_capitalized(c.name))}</th><td>{c.value:.3g} {escape(c.unit)}</td>'
        f'<td><span aria-hidden="true">{"★" * c.stars}{"☆" * (4 - c.stars)}</span> {c.stars} of 4</td></tr>'
        for c in guideline.criteria
    )
    return (
        "<h3>FADGI guideline criteria</h3>"
        '<table class="figures"><thead><tr><th scope="col">Criterion</th><th scope="col">This page</th>'
        f'<th scope="col">Stars</th></tr></thead><tbody>{rows}</tbody></table>'
        f'<p class="small">{escape(guideline.name)}. Not graded, because that needs a reference target in the photo: '
        f"{escape(', '.join(guideline.not_graded))}. These are figures of one page, not a certification.</p>"
    )


def _sources_table(sources: dict[str, str]) -> str:
    if not sources:
        return ""
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td><code>{escape(digest)}</code></td></tr>'
        for name, digest in sources.items()
    )
    return (
        f'<h3>Source files</h3><table class="figures sources">{rows}</table>'
        '<p class="small">With their SHA-256 digests.</p>'
    )
