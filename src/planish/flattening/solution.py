"""What a solver makes of a sheet, whichever solver it is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from planish.types import Bools, Diagnostic, Floats, Outcome, freeze


@dataclass(frozen=True, eq=False)
class Solution:
    """A sheet laid flat by one of the solvers.

    Attributes
    ----------
    points : (n, 2) or (n, 3) float64 [mm]
        x right, y up, and the height above the plane of solvers that come from above; faces run counter-clockwise.
    outcome : Outcome
    iterations : int
        Steps that were made.
    residuals : float64
        Root mean square relative error of the sticks after each step; of the stick solver also before the first.
    heights : (iterations,) float64 [mm]
        Greatest height above the plane after each step; empty for solvers that never leave the plane.
    passed : (n,) bool
        Points that went through another layer of the sheet on the way; empty where that cannot happen.
    warnings : tuple of Diagnostic
    at_rest : (n, 2) float64 [mm] or None
        As `xy`, but as the sticks left it, before faces that noise turned over were laid with their printed side up.
    """

    points: Floats
    outcome: Outcome
    iterations: int
    residuals: Floats
    heights: Floats = field(default_factory=lambda: np.zeros(0))
    passed: Bools = field(default_factory=lambda: np.zeros(0, bool))
    warnings: tuple[Diagnostic, ...] = ()
    at_rest: Floats | None = None

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def xy(self) -> Floats:
        """(n, 2) places on the plane [mm]."""
        return self.points[:, :2]
