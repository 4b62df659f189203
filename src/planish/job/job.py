"""Description of one restoration job: input files, settings and output files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from planish.settings import RestoreSettings, Units

if TYPE_CHECKING:
    from planish.types import Bools, Floats


@dataclass(frozen=True, kw_only=True)
class Outputs:
    """Output files of a job.

    Attributes
    ----------
    page : Path
        .tif, .png, .jpg or .pdf.
    copies : tuple of Path
        Additional copies of the page in other formats.
    binary, mask, flat, report, certificate, html : Path or None
        The binarized page, the mask of known pixels, the flattened mesh, the report as JSON, the quality certificate
        and the HTML page.
    stages : Path or None
        Folder for images of every stage.
    pdfa : bool
        Write PDFs as PDF/A-2b.
    ocr : str or None
        Language of the OCR text layer of PDFs, as Tesseract names it.
    overwrite : bool
        Whether existing files may be replaced.
    """

    page: Path
    copies: tuple[Path, ...] = ()
    binary: Path | None = None
    mask: Path | None = None
    flat: Path | None = None
    report: Path | None = None
    stages: Path | None = None
    certificate: Path | None = None
    html: Path | None = None
    pdfa: bool = False
    ocr: str | None = None
    overwrite: bool = True


@dataclass(frozen=True, kw_only=True)
class Job:
    """One restoration from files to files.

    Attributes
    ----------
    scan : Path
    outputs : Outputs
    photo, camera : tuple of Path
        Needed where the scan file does not reference them.
    units : str
        Unit of the scan's coordinates.
    sheet : Path or None
        Image that is white (not 0) where the photo shows the sheet.
    cut : (mask, view) or None
        Where a view of the scan from some side shows the sheet; see `Scan.sheet` and `Scan.sheet_view`.
    inside : Path or None
        For untrusted scans: files that the scan references are read from this folder only.
    settings : RestoreSettings
    """

    scan: Path
    outputs: Outputs
    photo: tuple[Path, ...] = ()
    camera: tuple[Path, ...] = ()
    units: Units = "auto"
    sheet: Path | None = None
    cut: tuple[Bools, Floats] | None = None
    inside: Path | None = None
    settings: RestoreSettings = field(default_factory=RestoreSettings)
