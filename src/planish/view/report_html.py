"""The report of a restoration as HTML; all text that comes from files is escaped here."""

from __future__ import annotations

from html import escape

from planish.report import summary, usual
from planish.types import Outcome, Report, Restoration
from planish.types.summary import UNMEASURED
from planish.view.fall_animation import FallAnimation

METHODS = {"multigrid": "multigrid", "verlet": "the paper's particle system", "mass-spring": "the mass-spring system"}


STATES = {"good": "good", "look at it": "look", "not good": "bad"}
"""CSS class of each verdict."""


def verdict(report: Report) -> str:
    """The verdict, its reasons and the notes, as HTML."""
    found = report.verdict
    reasons = "".join(f"<li>{escape(_capitalized(str(reason)))}.</li>" for reason in found.reasons)
    notes = "".join(f"<li>{escape(_capitalized(str(note)))}.</li>" for note in report.notes)
    parts = [f'<p class="word"><span class="dot" aria-hidden="true"></span>{_capitalized(found.word)}</p>']
    if reasons:
        parts.append(f'<ul class="reasons">{reasons}</ul>')
    else:
        parts.append(f"<p>{escape(report.outcome)}</p>")
    if notes:
        count = f"{len(report.notes)} note{'s' if len(report.notes) > 1 else ''}"
        parts.append(f'<details open><summary>{count}</summary><ul class="notes">{notes}</ul></details>')
    return "\n".join(parts)


def headline(report: Report) -> str:
    """Key figures, as HTML definition list items."""
    page, flat = report.page, report.flatten
    figures = [
        ("Page", f"{page.width_mm:.1f} × {page.height_mm:.1f}", "mm"),
        ("Expected error", f"{flat.expected_error_mm:.3f}", "mm rms"),
        ("Strain", f"{100 * flat.strain_rms:.3f}", "% rms"),
    ]
    if report.photo is not None:
        del figures[1:]  # of the estimated shape, not of the sheet
    if page.dpi is not None:
        figures.insert(1, ("Resolution", f"{page.dpi:g}", "dpi"))
    if page.effective_ppi_median is not None:
        figures.append(("Photo", f"{page.effective_ppi_median:.0f}", "ppi median"))
    if page.known_fraction is not None:
        figures.append(("Seen", f"{100 * page.known_fraction:.1f}", "% of the page"))
    return "\n".join(
        f'<div title="{_usual(what)}"><dt>{escape(what)}</dt>'
        f"<dd>{escape(number)} <small>{escape(unit)}</small></dd></div>"
        for what, number, unit in figures
    )


def report_section(restoration: Restoration) -> str:
    """Summary sentences, guideline criteria, all figures, and source files, as HTML."""
    report = restoration.report
    paragraph = f"<p>{' '.join(escape(sentence) for sentence in _sentences(report))}</p>"
    return (
        f"<div>{paragraph}\n{_guideline_table(report)}</div>\n"
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
        f"The page is {page.width_mm:.1f} × {page.height_mm:.1f} mm; "
        + (
            f"the expected error of its points is {flat.expected_error_mm:.3f} mm (rms)."
            if report.photo is None
            else f"its expected error is {UNMEASURED}."
        ),
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


def _usual(what: str) -> str:
    """What is usual of a figure, for a tooltip."""
    known = {"Photo": "resolution", "Resolution": "resolution"}.get(what, what[:1].lower() + what[1:])
    return escape(f"Usual: {usual(known)}", quote=True) if usual(known) else ""


def _figures_table(report: Report) -> str:
    rows = "".join(
        f'<tr><th scope="row">{escape(_capitalized(what))}</th><td>{escape(how_much)}{_usual_line(what)}</td></tr>'
        for what, how_much in summary(report)
        if what not in ("verdict", "outcome")
    )
    return f'<h3>Figures</h3><table class="figures">{rows}</table>'


def _usual_line(what: str) -> str:
    return f"<br><small>Usual: {escape(usual(what))}</small>" if usual(what) else ""


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
