"""Settings and output files that apply to every scan of a batch."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, replace
from hashlib import sha256
from pathlib import Path

from planish.batch.items import Item
from planish.job import Job, Outputs
from planish.settings import BatchFiles, RestoreSettings
from planish.version import __version__


@dataclass(frozen=True, kw_only=True)
class BatchOptions:
    """Settings and output files, the same for all items.

    Attributes
    ----------
    settings : RestoreSettings
    files : BatchFiles
    pdfa : bool
        Write PDFs as PDF/A-2b.
    ocr : str or None
        Language of the OCR text layer of PDFs.
    """

    settings: RestoreSettings = field(default_factory=RestoreSettings)
    files: BatchFiles = field(default_factory=BatchFiles)
    pdfa: bool = False
    ocr: str | None = None

    def fingerprint(self) -> str:
        """Digest of the options and of the version of planish."""
        plain = json.dumps([__version__, asdict(self)], sort_keys=True)
        return sha256(plain.encode()).hexdigest()

    def make_job(self, item: Item, folder: Path, photo: tuple[Path, ...], camera: tuple[Path, ...]) -> Job:
        """Job that restores one item into a folder."""
        files = self.files
        outputs = Outputs(
            page=folder / f"page.{files.format}",
            binary=folder / f"binary.{'png' if files.format == 'jpg' else files.format}" if files.binary else None,
            mask=folder / "mask.png" if files.mask else None,
            flat=folder / "flat.obj" if files.flat else None,
            report=folder / "report.json",
            certificate=folder / "certificate.pdf" if files.certificate else None,
            html=folder / "page.html" if files.html else None,
            pdfa=self.pdfa,
            ocr=self.ocr,
        )
        settings = self.settings
        if not (files.binary or files.html):  # would not be visible in any output
            settings = replace(settings, binarize=replace(settings.binarize, binarize="none"))
        return Job(scan=item.scan, photo=photo, camera=camera, units=item.units, settings=settings, outputs=outputs)
