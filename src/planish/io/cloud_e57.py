"""Points from E57, the exchange format of laser scanners: the extra `planish[clouds]`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError, MissingExtraError, install_command
from planish.io.filecloud import FileCloud, as_colours, as_grey
from planish.types import Diagnostic, Pixels

_MOST_PIXELS = 400e6
"""Of a range image: row and column numbers of a damaged file may be anything."""


def read_e57(path: Path) -> FileCloud:
    """Read the scan with the most points of an E57, in metres; rows and columns where it has them.

    Raises
    ------
    InputError
        If the file is damaged or holds no scan.
    MissingExtraError
        If pye57 is not installed.
    """
    try:
        import pye57
    except ImportError:
        raise MissingExtraError(f"{path} is an E57; to read it: {install_command('clouds')}") from None

    class SixteenBits(pye57.E57):
        """Reads colours of up to 16 bits; the library's own buffers hold 8."""

        def make_buffer(
            self, field_name: str, capacity: int, do_conversion: bool = True, do_scaling: bool = True
        ) -> tuple[NDArray, Any]:
            if not field_name.startswith("color"):
                return super().make_buffer(field_name, capacity, do_conversion, do_scaling)
            values = np.empty(capacity, np.uint16)
            place = self.image_file, field_name, values, capacity
            return values, pye57.libe57.SourceDestBuffer(*place, do_conversion, do_scaling)

    try:
        with SixteenBits(str(path)) as file:
            counts = [file.get_header(k).point_count for k in range(file.scan_count)]
            if not counts:
                raise InputError(f"{path} holds no scan; is it an E57 of photos only?")
            which = int(np.argmax(counts))
            header = file.get_header(which)
            fields = set(header.point_fields)
            found = file.read_scan(
                which,
                intensity="intensity" in fields,
                colors={"colorRed", "colorGreen", "colorBlue"} <= fields,
                row_column={"rowIndex", "columnIndex"} <= fields,
                ignore_missing_fields=True,
            )
            at = np.ravel(header.translation) if header.has_pose() else np.zeros(3)
            scanner = at if at.any() else None  # the origin may be the scanner's place or none in particular
    except InputError:
        raise
    except Exception as problem:  # whatever the library raises on damaged files
        raise InputError(
            f"{path} is an E57, but damaged or cut short: {' '.join(str(problem).split())[:200]}"
        ) from None
    sentence = f"{path} holds {len(counts)} scans; the one with the most points, number {which + 1}, was taken"
    warnings = [Diagnostic("several-scans", sentence)] if len(counts) > 1 else []
    points = np.stack([found[f"cartesian{axis}"] for axis in "XYZ"], axis=1).astype(np.float64)
    cloud = FileCloud(points, _colours(found), scanner=scanner, unit="m", warnings=warnings)
    return _organised(cloud, found["rowIndex"], found["columnIndex"]) if "rowIndex" in found else cloud


def _colours(found: dict[str, Any]) -> Pixels | None:
    if "colorRed" in found:
        return as_colours([np.asarray(found[f"color{name}"]) for name in ("Red", "Green", "Blue")])
    return as_grey(np.asarray(found["intensity"])) if "intensity" in found else None


def _organised(cloud: FileCloud, row: NDArray, column: NDArray) -> FileCloud:
    """The points in the pixels that the file names, NaN in the others; as they are if the pixels make no image."""
    if not len(row):
        return cloud
    row, column = (k.astype(np.int64) - int(k.min()) for k in (row, column))
    rows, cols = int(row.max()) + 1, int(column.max()) + 1
    if min(rows, cols) < 2 or rows * cols > _MOST_PIXELS or rows * cols > 50 * len(row):
        return cloud
    at = row * cols + column
    points = np.full((rows * cols, 3), np.nan)
    points[at] = cloud.points
    colours = None
    if cloud.colours is not None:
        colours = np.zeros((rows * cols, 3), cloud.colours.dtype)
        colours[at] = cloud.colours
    return FileCloud(points, colours, None, (rows, cols), cloud.scanner, cloud.unit, cloud.warnings)
