"""The page put together: template, style and program from `static`, pictures and arrays from the restoration."""

from __future__ import annotations

import gzip
import hashlib
import json
from base64 import b64encode
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.mesh import from_file_order
from planish.report.heat import coloured
from planish.types import Restoration
from planish.view.pictures import UNKNOWN, Map, Picture, margin_of, page_pictures, quality_maps, warped_picture
from planish.view.settling import Settling, settling
from planish.view.words import headline, in_words, of_the_fall

STEPS = 65_534
"""From end to end of a coordinate as a 16-bit number: 5 micrometres on a letter."""


def view_page(done: Restoration, name: str = "") -> bytes:
    """Make the page: one HTML file that holds all it needs and asks nobody for more.

    Parameters
    ----------
    done : Restoration
        Without pictures of the page where the scan has no photo.
    name : str
        What is restored, for the title.

    Returns
    -------
    bytes
        UTF-8.

    Examples
    --------
    >>> from planish import restore
    >>> from planish.gallery import sheet, sheet_mesh
    >>> from planish.types import Scan
    >>> scan = Scan(sheet_mesh(sheet("book"), points=2000, layout="grid")[0])
    >>> view_page(restore(scan), "a book").decode()[:15]
    '<!doctype html>'
    """
    prepared, flat = done.prepared, done.flattening
    page_xy, strain, error = (from_file_order(prepared, v) for v in (flat.page_xy, flat.local_strain, flat.error_mm))
    fall = settling(prepared.scan.mesh, prepared.topology, page_xy, flat.size_mm)
    pictures = page_pictures(done)
    if pictures:
        pictures.insert(0, warped_picture(done, page_xy, fall))
    maps = quality_maps(done, page_xy, strain, error)
    # File names may hold bytes that are no text.
    return _document(done, fall, pictures, maps, name or "A restored page").encode(errors="replace")


def _document(done: Restoration, fall: Settling, pictures: list[Picture], maps: list[Map], name: str) -> str:
    style, program = _static("view.css"), _static("view.js")
    report = done.report
    return Template(_static("page.html")).substitute(
        policy=_policy(style, program),
        style=style,
        program=program,
        name=escape(name),
        version=escape(report.version),
        state="good" if report.settled else "bad",
        outcome=escape(report.outcome),
        headline=headline(report),
        fall=escape(of_the_fall(done, fall)),
        pictures="\n".join(_img(picture) for picture in pictures),
        report=in_words(done),
        data=_json(_data(done, fall, pictures, maps)),
    )


def _static(name: str) -> str:
    return (files("planish.view") / "static" / name).read_text(encoding="utf-8")


def _policy(style: str, program: str) -> str:
    """Nothing but this program, this style, and pictures from within: whatever else a file's name might smuggle in."""

    def digest(text: str) -> str:
        return f"'sha256-{b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"

    return (
        f"default-src 'none'; script-src {digest(program)}; style-src {digest(style)}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _img(picture: Picture) -> str:
    source = f"data:{picture.mime};base64,{b64encode(picture.data).decode()}"
    return f'<img id="picture-{picture.name}" alt="{escape(picture.said)}" src="{source}">'


def _data(done: Restoration, fall: Settling, pictures: list[Picture], maps: list[Map]) -> dict[str, Any]:
    flat, spine = done.flattening, done.report.spine
    shown: list[dict[str, Any]] = [
        {"kind": "picture", "name": p.name, "title": p.title, "said": p.said, "withMargin": p.with_margin}
        for p in pictures
    ]
    shown += [
        {
            "kind": "map",
            "name": m.name,
            "title": m.title,
            "said": m.said,
            "unit": m.unit,
            "low": m.low,
            "high": m.high,
            "rows": m.values.shape[0],
            "cols": m.values.shape[1],
            "values": packed(m.values),
        }
        for m in maps
    ]
    return {
        "size": list(flat.size_mm),
        "margin": margin_of(flat.size_mm),
        "spine": None if spine is None else spine.x_mm,
        "layers": shown,
        "colours": packed(coloured(np.arange(float(UNKNOWN))[None], 0, UNKNOWN - 1)),
        "fall": _fall(fall),
    }


def _fall(fall: Settling) -> dict[str, Any]:
    low, high = fall.states.min(axis=(0, 1)), fall.states.max(axis=(0, 1))
    step = np.maximum(high - low, 1e-9) / STEPS
    codes = np.round((fall.states - low) / step - STEPS / 2).astype(np.int16)
    moves = np.diff(codes, axis=0, prepend=np.int16(0))  # wraps around, and back again when they are summed up
    return {
        "points": fall.states.shape[1],
        "states": len(fall.states),
        "low": (low + step * STEPS / 2).tolist(),
        "step": step.tolist(),
        "moves": packed(moves),
        "faces": packed(fall.faces.astype(np.uint32)),
        "taken": fall.steps.tolist(),
        "heights": [round(float(top), 2) for top in fall.heights],
    }


def packed(array: NDArray[Any]) -> str:
    """An array's numbers, little-endian, deflated, as base64."""
    plain = array.astype(array.dtype.newbyteorder("<")).tobytes()
    return b64encode(gzip.compress(plain, compresslevel=4, mtime=0)).decode()


def _json(value: Any) -> str:
    """JSON that cannot end the element that it stands in."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
