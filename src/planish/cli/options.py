"""Options that several commands share, and the check of the files that they name."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

Output = Annotated[Path, Parameter(name=["--output", "-o"])]
Quiet = Annotated[bool, Parameter(name=["--quiet", "-q"], negative="")]
Verbose = Annotated[bool, Parameter(name=["--verbose", "-v"], negative="")]


def check_files(output: Path, picture: Path | None, *, overwrite: bool) -> None:
    """Refuse before any work a file of any kind, or a picture, that could not be written after it."""
    from planish.io import check_page_name, check_writable

    check_writable(output, overwrite=overwrite)
    if picture is not None:
        check_page_name(picture)
        check_writable(picture, overwrite=overwrite)
