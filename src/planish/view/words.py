"""The report of a restoration in words, as HTML: every text that comes from a file is escaped here."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from planish.report import summary
from planish.types import Outcome, Report, Restoration
from planish.view.settling import Settling

METHODS = {"multigrid": "multigrid", "verlet": "the paper's particle system", "mass-spring": "springs and masses"}


def headline(report: Report) -> str:
    """The outcome, and the figures that people look for first."""
    page, flat = report.page, report.flatten
    figures = [
        ("Page", f"{page.width_mm:.1f} × {page.height_mm:.1f}", "mm"),
        ("Expected error", f"{flat.expected_error_mm:.3f}", "mm rms"),
        ("Strain", f"{100 * flat.strain_rms:.3f}", "% rms"),
    ]
    if page.dpi is not None:
        figures.insert(1, ("Drawn at", f"{page.dpi:g}", "dpi"))
    if page.effective_ppi_median is not None:
        figures.append(("The photo has", f"{page.effective_ppi_median:.0f}", "ppi median"))
    if page.known_fraction is not None:
        figures.append(("Seen", f"{100 * page.known_fraction:.1f}", "% of the page"))
    return "\n".join(
        f"<div><dt>{escape(what)}</dt><dd>{escape(number)} <small>{escape(unit)}</small></dd></div>"
        for what, number, unit in figures
    )


def in_words(done: Restoration) -> str:
    """The report: what came out in a few sentences, notes, all figures, the guideline, and the files it came from."""
    report = done.report
    said = f"<p>{' '.join(escape(sentence) for sentence in _sentences(report))}</p>"
    return (
        f"<div>{said}\n{_notes(report.warnings)}\n{_guideline(report)}</div>\n"
        f"<div>{_figures(report)}\n{_sources(report.sources)}</div>"
    )


def of_the_fall(done: Restoration, fall: Settling) -> str:
    """What the slider shows, and what it does not."""
    flat = done.flattening
    ended = {
        Outcome.SETTLED: "",
        Outcome.STALLED: " It stopped there before all of the sheet had reached the table.",
        Outcome.CRUSHED: " It lies there crushed: its lengths are far from the paper's.",
        Outcome.OUT_OF_STEPS: " It was still moving there when the steps ran out.",
        Outcome.DIVERGED: " It became unstable after that.",
    }[fall.outcome]
    last = len(fall.states) - 1
    way = METHODS.get(flat.method, flat.method)
    rest = "" if done.report.settled else ", which did not settle"
    others = "; the other points are carried along" if fall.moved_points < fall.states.shape[1] else ""
    return (
        f"Steps 0 to {last - 1} are states of the paper's particle system, which lets {fall.moved_points:,} points of "
        f"the sheet fall on a table ({last} of {int(fall.steps[-1]) + 1:,} states{others})."
        f"{ended} Step {last} is the page of this restoration, laid flat by {way} on {flat.solved_points:,} points"
        f"{rest}."
    )


def _sentences(report: Report) -> list[str]:
    page, flat = report.page, report.flatten
    said = [
        f"The page is {page.width_mm:.1f} × {page.height_mm:.1f} mm; a point of it is expected to be "
        f"{flat.expected_error_mm:.3f} mm (rms) from its true place.",
    ]
    if page.effective_ppi_median is not None and page.effective_ppi_p10 is not None and page.dpi is not None:
        said.append(
            f"It was drawn at {page.dpi:g} dpi from a photo that has {page.effective_ppi_median:.0f} pixels per inch "
            f"of paper in the median, and at least {page.effective_ppi_p10:.0f} over nine tenths of the page."
        )
    if page.known_fraction is not None and page.known_fraction < 1:
        said.append(f"{100 * (1 - page.known_fraction):.1f} % of the page was not seen and is left blank.")
    if report.spine is not None:
        said.append(f"The sheet is two pages; they part {report.spine.x_mm:.1f} mm from the left.")
    return said


def _notes(warnings: Iterable[str]) -> str:
    items = "".join(f"<li>{escape(_begun(said))}</li>" for said in warnings)
    return f'<h3>Notes</h3><ul class="notes">{items}</ul>' if items else "<p>There are no warnings.</p>"


def _figures(report: Report) -> str:
    rows = "".join(
        f'<tr><th scope="row">{escape(_begun(what))}</th><td>{escape(how_much)}</td></tr>'
        for what, how_much in summary(report)
        if what != "outcome"
    )
    return f'<h3>Figures</h3><table class="figures">{rows}</table>'


def _begun(said: str) -> str:
    """As the beginning of a line."""
    return said[:1].upper() + said[1:]


def _guideline(report: Report) -> str:
    found = report.guideline
    if found is None or not found.criteria:
        return ""
    rows = "".join(
        f'<tr><th scope="row">{escape(_begun(c.name))}</th><td>{c.value:.3g} {escape(c.unit)}</td>'
        f'<td><span aria-hidden="true">{"★" * c.stars}{"☆" * (4 - c.stars)}</span> {c.stars} of 4</td></tr>'
        for c in found.criteria
    )
    return (
        "<h3>Beside the FADGI guidelines</h3>"
        '<table class="figures"><thead><tr><th scope="col">Criterion</th><th scope="col">This page</th>'
        f'<th scope="col">Stars</th></tr></thead><tbody>{rows}</tbody></table>'
        f'<p class="small">{escape(found.name)}. Not graded, as they need a reference target in the photo: '
        f"{escape(', '.join(found.not_graded))}. These are figures of one page, no certification of a studio.</p>"
    )


def _sources(sources: dict[str, str]) -> str:
    if not sources:
        return ""
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td><code>{escape(digest)}</code></td></tr>'
        for name, digest in sources.items()
    )
    return f'<h3>Made from</h3><table class="figures sources">{rows}</table><p class="small">With their SHA-256.</p>'
