"""What a page's file says about itself: resolution, program, method, and the fingerprints of the files it came from.

The same scan gives the same bytes on every day: a date is written only where SOURCE_DATE_EPOCH tells one.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from xml.sax.saxutils import escape

from planish.errors import InputError, UsageError
from planish.types import Report
from planish.version import __version__

SOFTWARE = f"planish {__version__}"

_NAMESPACES = {
    "dc": "http://purl.org/dc/elements/1.1/",
    "xmp": "http://ns.adobe.com/xap/1.0/",
    "tiff": "http://ns.adobe.com/tiff/1.0/",
    "pdf": "http://ns.adobe.com/pdf/1.3/",
    "pdfaid": "http://www.aiim.org/pdfa/ns/id/",
}
_INCH = 2
_TIFXYZ = ("meta.json", "x.tif", "y.tif", "z.tif")


@dataclass(frozen=True)
class Origin:
    """Where a page comes from.

    Attributes
    ----------
    method : str
        How it was made, in a sentence of plain letters.
    sources : tuple of (str, str)
        Names of the files it was made from, and the SHA-256 of each in hexadecimal.
    """

    method: str
    sources: tuple[tuple[str, str], ...] = ()


def origin_of(report: Report, sources: dict[str, str], binarized_by: str | None = None) -> Origin:
    """Say how a page was made, from the report of its restoration.

    Parameters
    ----------
    report : Report
    sources : dict
        SHA-256 by file name, see `fingerprints`.
    binarized_by : str, optional
        The method, for a page in black and white.
    """
    flat, shade = report.flatten, report.shading
    said = [f"Flattened from a 3D scan by {flat.method} with {flat.lengths} lengths"]
    said.append(f"shading removed by {shade.method}" if shade else "shading kept")
    said += [f"binarized by {binarized_by}"] if binarized_by else []
    return Origin(f"{'; '.join(said)}.", tuple(sources.items()))


def fingerprints(paths: Iterable[Path], digests: Mapping[Path, str] | None = None) -> dict[str, str]:
    """SHA-256 of files by their names; of a tifxyz folder, of its files one after the other.

    Parameters
    ----------
    paths : iterable of Path
    digests : mapping, optional
        Those that are known, as of `ReadScan`: the bytes that were used count, though the file may have changed since.

    Raises
    ------
    InputError
        If one cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(f"{folder}/a.obj").write_bytes(b"")
    ...     fingerprints([Path(f"{folder}/a.obj")])["a.obj"][:16]
    'e3b0c44298fc1c14'
    """
    every, known = list(dict.fromkeys(paths)), digests or {}
    names = [path.name for path in every]
    return {path.name if names.count(path.name) == 1 else str(path): known.get(path) or _sha256(path) for path in every}


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    try:
        for file in [path / name for name in _TIFXYZ] if path.is_dir() else [path]:
            with file.open("rb") as opened:
                while block := opened.read(1 << 20):
                    digest.update(block)
    except OSError as problem:
        raise InputError(f"{path} cannot be read: {problem.strerror or problem}") from None
    return digest.hexdigest()


def creation_date() -> datetime | None:
    """The time that SOURCE_DATE_EPOCH tells (seconds since 1970), as reproducible builds have it; else None.

    Raises
    ------
    UsageError
        Where that variable holds no such number.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return None
    try:
        return datetime.fromtimestamp(int(epoch), UTC)
    except (ValueError, OverflowError, OSError):
        raise UsageError(f"SOURCE_DATE_EPOCH is {epoch!r}; whole seconds since 1970 are wanted") from None


def xmp_packet(dpi: float | None = None, origin: Origin | None = None, *, pdfa: bool = False) -> bytes:
    """The XMP of a page, with properties of the standard schemas only, as PDF/A asks; no dpi for a PDF, which has mm.

    Examples
    --------
    >>> b"<tiff:XResolution>300/1</tiff:XResolution>" in xmp_packet(300.0)
    True
    """
    date = creation_date()
    rows = [_row("xmp:CreatorTool", SOFTWARE)]
    if dpi is not None:
        ratio = f"{round(dpi)}/1" if dpi == round(dpi) else f"{round(dpi * 1000)}/1000"
        rows += [_row(f"tiff:{axis}Resolution", ratio) for axis in "XY"]
        rows.append(_row("tiff:ResolutionUnit", str(_INCH)))
    if date:
        rows += [_row(f"xmp:{name}", date.isoformat()) for name in ("CreateDate", "ModifyDate")]
    if origin:
        text = f'<rdf:Alt><rdf:li xml:lang="x-default">{_plain(origin.method)}</rdf:li></rdf:Alt>'
        rows.append(f"<dc:description>{text}</dc:description>")
    if origin and origin.sources:
        rows.append(_row("dc:source", "; ".join(f"{name} sha256:{digest}" for name, digest in origin.sources)))
    if pdfa:
        rows += [_row("pdf:Producer", SOFTWARE), _row("pdfaid:part", "2"), _row("pdfaid:conformance", "B")]
    names = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in _NAMESPACES.items())
    body = (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>\n<x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">\n'
        f'<rdf:Description rdf:about="" {names}>\n' + "\n".join(rows) + "\n</rdf:Description>\n"
        '</rdf:RDF></x:xmpmeta>\n<?xpacket end="w"?>'
    )
    return body.encode()


def _row(name: str, value: str) -> str:
    return f"<{name}>{_plain(value)}</{name}>"


def _plain(text: str) -> str:
    """Escaped, and without what XML cannot hold: control characters, and names of files in no known encoding."""
    readable = text.encode("utf-8", "replace").decode()
    return escape(re.sub(r"[\x00-\x1f\x7f\ufffe\uffff]", "?", readable))
