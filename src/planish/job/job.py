"""What one restoration is: the files it reads, the settings, and the files it writes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from planish.settings import RestoreSettings, Units


@dataclass(frozen=True, kw_only=True)
class Outputs:
    """The files to be written.

    Attributes
    ----------
    page : Path
        .tif, .png, .jpg or .pdf.
    copies : tuple of Path
        The same page again, in other formats.
    binary, mask, flat, report, certificate, html : Path or None
        The page in black and white; what is known of it; the flat mesh; the report as JSON; one sheet of figures; and
        a page to look at.
    stages : Path or None
        Folder for pictures of every stage.
    pdfa : bool
        PDFs are for archives.
    ocr : str or None
        Language of the text to be read for PDFs.
    overwrite : bool
        Files in place may be replaced.
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
        Where the scan's file does not name them.
    units : {"auto", "mm", "cm", "m", "in"}
        Of the scan's numbers.
    inside : Path or None
        For scans from strangers: the only folder from which files are read that the scan itself names.
    settings : RestoreSettings
    """

    scan: Path
    outputs: Outputs
    photo: tuple[Path, ...] = ()
    camera: tuple[Path, ...] = ()
    units: Units = "auto"
    inside: Path | None = None
    settings: RestoreSettings = field(default_factory=RestoreSettings)
