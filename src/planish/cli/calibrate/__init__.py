"""`planish calibrate`: one command for each kind of device."""

from __future__ import annotations

from cyclopts import App

from planish.cli.app import EVERYWHERE
from planish.cli.calibrate.board import board, camera, projector
from planish.cli.calibrate.card import card
from planish.cli.calibrate.laser import laser, laser_lines

app = App(
    name="calibrate",
    help="Calibrate a device from photos of a printed board.",
    default_parameter=EVERYWHERE,
)
for command in (board, card, camera, projector, laser, laser_lines):
    app.command(command)
