"""Summary of a batch, worst items first, as HTML, CSV and JSON Lines."""

from __future__ import annotations

import base64
import csv
import io
import json
from collections.abc import Iterator
from dataclasses import fields
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from urllib.parse import quote

from PIL import Image

from planish.batch.row import STATUSES, Row, worst_first
from planish.io.files import write_bytes

MAX_ROWS = 3000
"""Rows of summary.html, the worst ones: more make a browser slow. CSV and JSON Lines have all rows."""
_PICTURE_PX = 120
_CSS_CLASSES = {"failed": "failed", "not good": "not-good", "look at it": "look", "good": "good"}
_STATUS_LABELS = {"failed": "failed", "not good": "not good", "look at it": "to look at", "good": "good"}
_NUMBER_COLUMNS = (
    ("Expected error, mm", "expected_error_mm", "{:.3f}", 1.0),
    ("Width, mm", "width_mm", "{:.0f}", 1.0),
    ("Height, mm", "height_mm", "{:.0f}", 1.0),
    ("Photo, ppi", "effective_ppi", "{:.0f}", 1.0),
    ("Seen, %", "known_fraction", "{:.1f}", 100.0),
    ("Strain, %", "strain_rms", "{:.3f}", 100.0),
    ("Seconds", "seconds", "{:.1f}", 1.0),
)
"""Numeric columns: title, field, format, factor."""


def write_summary(folder: Path, rows: list[Row], notes: list[str], scans: Path | None = None) -> Path:
    """Write summary.html, summary.csv and summary.jsonl.

    Parameters
    ----------
    folder : Path
        Output folder with previews and pages.
    rows : list of Row
    notes : list of str
        Notes on the search for scans.
    scans : Path, optional
        Folder of the scans, a prefix that is removed from messages in the table.

    Returns
    -------
    Path
        Path of summary.html.
    """
    ordered = worst_first(rows)
    write_bytes(folder / "summary.jsonl", (f"{json.dumps(row.plain())}\n".encode() for row in ordered))
    write_bytes(folder / "summary.csv", _csv(ordered))
    write_bytes(folder / "summary.html", _html(folder, ordered, notes, scans).encode("utf-8", "replace"))
    return folder / "summary.html"


def _csv(rows: list[Row]) -> bytes:
    """One line per item; warnings joined by |."""
    file = io.StringIO()
    writer = csv.writer(file)
    names = [field.name for field in fields(Row)]
    writer.writerow(names)
    for row in rows:
        plain = row.plain()
        writer.writerow([" | ".join(v) if isinstance(v := plain[name], list) else v for name in names])
    return file.getvalue().encode("utf-8", "replace")


def _html(folder: Path, rows: list[Row], notes: list[str], scans: Path | None) -> str:
    template = Template(files("planish.batch").joinpath("summary.html").read_text("utf-8"))
    counts = {status: sum(row.status == status for row in rows) for status in STATUSES}
    status_counts = ", ".join(f"{count:,} {_STATUS_LABELS[status]}" for status, count in counts.items() if count)
    lead = f"{len(rows):,} items: {status_counts}."
    if len(rows) > MAX_ROWS:
        lead += f" The worst {MAX_ROWS:,} are shown; summary.csv and summary.jsonl have all."
    return template.substitute(
        title=escape(f"{folder.resolve().name}: all scans"),
        lead=escape(lead),
        notes="".join(f"<li>{escape(note)}</li>" for note in notes).join(
            ['<ul class="notes">', "</ul>"] if notes else ["", ""]
        ),
        filters="\n".join(
            f'<label class="{_CSS_CLASSES[status]}"><input type="checkbox" value="{status}" checked>'
            f"{_STATUS_LABELS[status]} {count:,}</label>"
            for status, count in counts.items()
            if count
        ),
        heads="\n".join(_header_cells()),
        rows="\n".join(_row(folder, row, f"{scans}/") for row in rows[:MAX_ROWS]),
    )


def _header_cells() -> Iterator[str]:
    for title, kind in (("Name", "name"), ("Status", "status"), ("Messages", "what")):
        yield f'<th scope="col" class="{kind}"><button type="button">{title}</button></th>'
    for title, *_ in _NUMBER_COLUMNS:
        yield f'<th scope="col" class="number"><button type="button">{title}</button></th>'


def _row(folder: Path, row: Row, scans_folder: str) -> str:
    pages = [name for name in row.files if name.startswith("page")]
    page = "page.html" if "page.html" in pages else next(iter(pages), None)
    picture = _embedded_preview(folder / row.name / "preview.jpg", row.name)
    cells = [f'<td class="picture">{_link(row, page, picture) if page else picture}</td>']
    cells.append(f'<th scope="row">{_link(row, page, escape(row.name)) if page else escape(row.name)}</th>')
    rank = STATUSES.index(row.status)
    cells.append(f'<td data-value="{rank}"><span class="status {_CSS_CLASSES[row.status]}">{row.status}</span></td>')
    cells.append(f'<td class="what">{_details_cell(row, scans_folder)}</td>')
    for title, name, form, factor in _NUMBER_COLUMNS:
        value = getattr(row, name)
        shown = "" if value is None else form.format(factor * value)
        cells.append(f'<td class="number" data-label="{title}" data-value="{shown}">{shown}</td>')
    return f'<tr data-status="{row.status}">{"".join(cells)}</tr>'


def _details_cell(row: Row, scans_folder: str) -> str:
    """Error, or reasons and notes of an item, without the folder of the scans, and links to its files."""
    messages = escape(row.sentence.replace(scans_folder, "")) if row.status == "failed" else ""
    notes = [warning for warning in row.warnings if warning not in row.reasons]
    for kind, sentences in (("reasons", row.reasons), ("", notes)):
        items = "".join(f"<li>{escape(sentence.replace(scans_folder, ''))}</li>" for sentence in sentences)
        messages += f'<ul class="{kind}">{items}</ul>' if items else ""
    links = " ".join(_link(row, name, escape(name)) for name in row.files if name != "preview.jpg")
    return messages + (f"<p>{links}</p>" if links else "")


def _link(row: Row, file: str, shown: str) -> str:
    return f'<a href="{escape(quote(f"{row.name}/{file}"))}">{shown}</a>'


def _embedded_preview(preview: Path, name: str) -> str:
    """Thumbnail of the page as data URI, so that the summary is self-contained."""
    try:
        with Image.open(preview) as image:
            image.draft("RGB", (_PICTURE_PX, _PICTURE_PX))
            image.thumbnail((_PICTURE_PX, _PICTURE_PX))
            file = io.BytesIO()
            image.save(file, "JPEG", quality=50)
    except OSError:  # failed items have no preview
        return ""
    data = base64.b64encode(file.getvalue()).decode()
    alt = escape(f"The page of {name}", quote=True)
    return (
        f'<img src="data:image/jpeg;base64,{data}" alt="{alt}" width="{image.width // 2}" height="{image.height // 2}">'
    )
