"""Every choice a user can make, once: one frozen dataclass per stage.

Command-line flags, their help and the report are made from these.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from planish.errors import UsageError

Lengths = Literal["smooth", "unfolded", "straight"]
Method = Literal["multigrid", "verlet"]


@dataclass(frozen=True, kw_only=True)
class VerletSettings:
    """The simulation of the paper.

    Attributes
    ----------
    time_step : float
        dt of eq. (6) and (7). The paper's value; larger steps fall faster and settle worse.
    gravity : float
        g of eq. (2), towards the plane, with the median stick as unit of length.
    rounds : int
        How often sticks and plane are made good, in turn, after each step. Below 20 a folded sheet can stall
        arched; more rounds cost time in proportion.
    max_steps : int
        Give up after so many steps and say so.
    tolerance : float
        The sheet has settled when it lies on the plane and its sticks' rms relative error has changed by less than
        this part of itself over the last 50 steps.
    """

    time_step: float = 0.1
    gravity: float = 9.81
    rounds: int = 20
    max_steps: int = 4000
    tolerance: float = 0.002

    def __post_init__(self) -> None:
        for name in ("time_step", "gravity", "rounds", "max_steps", "tolerance"):
            value = getattr(self, name)
            if not value > 0:
                raise UsageError(f"{name} must be greater than 0, not {value}")


@dataclass(frozen=True, kw_only=True)
class FlattenSettings:
    """How a mesh becomes flat.

    Attributes
    ----------
    method : {"verlet"}
        verlet: the particle system of the paper.
    lengths : {"unfolded", "straight"}
        Rest length of a bending stick: the distance of the two corners after their triangles are laid into one
        plane (unfolded), or as they stand in space (straight, the paper's; too short across a fold).
    points : int or None
        Reduce the sheet to about so many points before solving; None keeps all (verlet: the paper's 1,000). Every
        point of the scan gets its place on the page in any case.
    verlet : VerletSettings
    """

    method: Method = "verlet"
    lengths: Lengths = "unfolded"
    points: int | None = None
    verlet: VerletSettings = field(default_factory=VerletSettings)


@dataclass(frozen=True, kw_only=True)
class RenderSettings:
    """How the page is drawn.

    Attributes
    ----------
    dpi : float or "auto"
        Page pixels per 25.4 mm. auto: what the photo gives (its median over the page), rounded to a usual value.
    """

    dpi: float | Literal["auto"] = 300.0

    def __post_init__(self) -> None:
        if self.dpi != "auto" and not 1 <= self.dpi <= 10_000:
            raise UsageError(f"dpi must be between 1 and 10000, or auto, not {self.dpi}")
