"""Assemble the HTML page from template, style sheet and script in `static` and the data of a restoration."""

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

from planish.geometry.guards import TINY_MM
from planish.mesh import from_file_order
from planish.report.heat import coloured
from planish.types import Restoration
from planish.view.fall_animation import FallAnimation, simulate_fall
from planish.view.page_layers import (
    UNKNOWN,
    Map,
    Picture,
    left_out_picture,
    margin_mm,
    page_pictures,
    quality_maps,
    warped_picture,
)
from planish.view.report_html import STATES, animation_caption, headline, report_section, verdict

QUANTIZATION_STEPS = 65_534
"""Quantization levels of a coordinate as 16-bit integer: 5 micrometres on a letter-size page."""


def view_page(restoration: Restoration, name: str = "") -> bytes:
    """Make a self-contained HTML page that requests nothing from any host.

    Parameters
    ----------
    restoration : Restoration
        Without a photo, the page has no images, only geometry and maps.
    name : str
        Name of the scan, for the title.

    Returns
    -------
    bytes
        HTML in UTF-8.

    Examples
    --------
    >>> from planish import restore
    >>> from planish.gallery import sheet, sheet_mesh
    >>> from planish.types import Scan
    >>> scan = Scan(sheet_mesh(sheet("book"), points=2000, layout="grid")[0])
    >>> view_page(restore(scan), "a book").decode()[:15]
    '<!doctype html>'
    """
    prepared, flat = restoration.prepared, restoration.flattening
    page_xy, strain, error = (from_file_order(prepared, v) for v in (flat.page_xy, flat.local_strain, flat.error_mm))
    animation = simulate_fall(prepared.scan.mesh, prepared.topology, page_xy, flat.size_mm)
    pictures = page_pictures(restoration)
    if pictures:
        pictures.insert(0, warped_picture(restoration, page_xy, animation))
    left_out = left_out_picture(restoration)
    pictures += [] if left_out is None else [left_out]
    maps = quality_maps(restoration, page_xy, strain, error)
    # File names may hold bytes that are not valid text.
    return _fill_template(restoration, animation, pictures, maps, name or "A restored page").encode(errors="replace")


def _fill_template(
    restoration: Restoration, animation: FallAnimation, pictures: list[Picture], maps: list[Map], name: str
) -> str:
    style, program = _static_file("view.css"), _static_file("view.js")
    report = restoration.report
    return Template(_static_file("page.html")).substitute(
        policy=_content_security_policy(style, program),
        style=style,
        program=program,
        name=escape(name),
        version=escape(report.version),
        state=STATES[report.verdict.word],
        verdict=verdict(report),
        headline=headline(report),
        animation_caption=escape(animation_caption(restoration, animation)),
        pictures="\n".join(_img(picture) for picture in pictures),
        report=report_section(restoration),
        data=_json(_page_data(restoration, animation, pictures, maps)),
    )


def _static_file(name: str) -> str:
    return (files("planish.view") / "static" / name).read_text(encoding="utf-8")


def _content_security_policy(style: str, program: str) -> str:
    """Content security policy: only this script, this style sheet and embedded images, whatever a file name injects."""

    def digest(text: str) -> str:
        return f"'sha256-{b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"

    return (
        f"default-src 'none'; script-src {digest(program)}; style-src {digest(style)}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _img(picture: Picture) -> str:
    source = f"data:{picture.mime};base64,{b64encode(picture.data).decode()}"
    return f'<img id="picture-{picture.name}" alt="{escape(picture.description)}" src="{source}">'


def _page_data(
    restoration: Restoration, animation: FallAnimation, pictures: list[Picture], maps: list[Map]
) -> dict[str, Any]:
    flat, spine = restoration.flattening, restoration.report.spine
    shown: list[dict[str, Any]] = [
        {"kind": "picture", "name": p.name, "title": p.title, "description": p.description, "withMargin": p.with_margin}
        for p in pictures
    ]
    shown += [
        {
            "kind": "map",
            "name": m.name,
            "title": m.title,
            "description": m.description,
            "unit": m.unit,
            "low": m.low,
            "high": m.high,
            "rows": m.values.shape[0],
            "cols": m.values.shape[1],
            "values": encode_array(m.values),
        }
        for m in maps
    ]
    return {
        "size": list(flat.size_mm),
        "margin": margin_mm(flat.size_mm),
        "spine": None if spine is None else spine.x_mm,
        "layers": shown,
        "colours": encode_array(coloured(np.arange(float(UNKNOWN))[None], 0, UNKNOWN - 1)),
        "animation": _encode_animation(animation),
    }


def _encode_animation(animation: FallAnimation) -> dict[str, Any]:
    low, high = animation.states.min(axis=(0, 1)), animation.states.max(axis=(0, 1))
    step = np.maximum(high - low, TINY_MM) / QUANTIZATION_STEPS
    codes = np.round((animation.states - low) / step - QUANTIZATION_STEPS / 2).astype(np.int16)
    moves = np.diff(codes, axis=0, prepend=np.int16(0))  # differences may wrap around; the cumulative sum wraps back
    return {
        "points": animation.states.shape[1],
        "states": len(animation.states),
        "low": (low + step * QUANTIZATION_STEPS / 2).tolist(),
        "step": step.tolist(),
        "moves": encode_array(moves),
        "faces": encode_array(animation.faces.astype(np.uint32)),
        "steps": animation.steps.tolist(),
        "heights": [round(float(top), 2) for top in animation.heights],
    }


def encode_array(array: NDArray[Any]) -> str:
    """Array as base64 of its gzipped little-endian bytes."""
    plain = array.astype(array.dtype.newbyteorder("<")).tobytes()
    return b64encode(gzip.compress(plain, compresslevel=4, mtime=0)).decode()


def _json(value: Any) -> str:
    """JSON that cannot close the script element around it."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
