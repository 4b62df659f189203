"""Options shared by several commands, and checks of the files they name."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from planish.settings import Units

Output = Annotated[Path, Parameter(name=["--output", "-o"])]
Quiet = Annotated[bool, Parameter(name=["--quiet", "-q"], negative="")]
Verbose = Annotated[bool, Parameter(name=["--verbose", "-v"], negative="")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FileUnit:
    """How long a step of 1 in a file's coordinates is; one of the three says it.

    Attributes
    ----------
    units : str
        Unit of the file's coordinates: mm, cm, m, in, or a length such as 7.91um. auto: as the file says, otherwise
        decided from the size, with a note.
    scale : float, optional
        Millimetres per unit of the file's coordinates, for scans without a unit.
    scale_bar : (float, float, float, float, float, float, float), optional
        A known length in the scan, such as a ruler beside the sheet: x y z of its start and x y z of its end in the
        file's coordinates, and their distance in mm.
    """

    units: Units = "auto"
    scale: float | None = None
    scale_bar: tuple[float, float, float, float, float, float, float] | None = None

    def unit(self) -> Units:
        """What is to be given as `units` where the file is read."""
        from planish.errors import UsageError
        from planish.io.units import scale_bar, unit_of_mm

        if sum([self.units != "auto", self.scale is not None, self.scale_bar is not None]) > 1:
            raise UsageError(
                "give one of --units, --scale and --scale-bar: each says how long a step of the file's coordinates is"
            )
        if self.scale_bar is not None:
            return scale_bar(self.scale_bar[:3], self.scale_bar[3:6], self.scale_bar[6])
        if self.scale is None:
            return self.units
        if not 0 < self.scale < float("inf"):
            raise UsageError(f"--scale must be above 0, not {self.scale:g}")
        return unit_of_mm(self.scale)


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
