"""Options shared by several commands, and checks of the files they name."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

Output = Annotated[Path, Parameter(name=["--output", "-o"])]
Quiet = Annotated[bool, Parameter(name=["--quiet", "-q"], negative="")]
Verbose = Annotated[bool, Parameter(name=["--verbose", "-v"], negative="")]


def check_files(output: Path, picture: Path | None, *, overwrite: bool) -> None:
    """Check before any computation that the output and its picture can be written."""
    from planish.io import check_page_name, check_writable

    check_writable(output, overwrite=overwrite)
    if picture is not None:
        check_page_name(picture)
        check_writable(picture, overwrite=overwrite)


OpenBrowser = Annotated[bool | None, Parameter(name="--open", negative="--no-open")]


def open_in_browser(address: str, *, wanted: bool | None) -> None:
    """Open an address in the browser; if nobody said whether, only where there is a display."""
    import os
    import sys
    import webbrowser

    has_screen = sys.platform in ("darwin", "win32") or bool({"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ))
    if has_screen if wanted is None else wanted:
        webbrowser.open(address)
