"""`planish acquire`: one command for each kind of device."""

from __future__ import annotations

from cyclopts import App

from planish.cli.acquire.depth import depth
from planish.cli.acquire.gray_code import gray_code, patterns
from planish.cli.acquire.grid import grid
from planish.cli.acquire.laser import laser
from planish.cli.acquire.laser_lines import laser_lines
from planish.cli.acquire.photos import photos
from planish.cli.acquire.points import points
from planish.cli.acquire.virtual import virtual
from planish.cli.app import EVERYWHERE

app = App(
    name="acquire",
    help="Make a scan from the captures of a device, ready for `planish restore`.",
    default_parameter=EVERYWHERE,
)
for command in (depth, grid, photos, points, gray_code, patterns, laser, laser_lines, virtual):
    app.command(command)
