"""How large a time step each particle system bears: springs by Euler, sticks by Verlet, sticks by Euler.

    python benchmarks/stability.py [--points N] [--picture FILE.png]

Two virtual scans of the gallery, a thick book's page and a letter folded in three with 0.05 mm of noise, are reduced
to 1,000 points and dropped on the plane: by Brown & Seales' masses and springs for stiffnesses k from 10 to 1,000,000,
by the paper's Verlet sticks, and by the same sticks moved by explicit Euler steps (4), (5), for time steps dt that are
a quarter decade apart. All run for 25 units of time, at most 25,000 steps (sticks: 2,000). Masses, gravity and unit of
length are the same in all: a free mass falls 4.9 median springs in the first unit of time.

Prints a Markdown table, and draws how each run ended with --picture.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
from numba import njit
from PIL import Image, ImageDraw, ImageFont

from machine import machine
from planish.flattening import simulate_mass_spring, simulate_verlet
from planish.flattening.quad_mesh import make_quad_mesh, quad_mesh_springs
from planish.flattening.solution import Solution
from planish.flattening.verlet import at_rest, project, satisfy_constraints, shuffled
from planish.gallery import sheet, virtual_scan
from planish.mesh import Coarse, onto_support_plane, prolongate, repair, subsample, topology
from planish.settings import MassSpringSettings, VerletSettings
from planish.sticks import make_sticks
from planish.types import Floats, Mesh, Outcome, Sticks
from truth import rigid_rms

STIFFNESS = 10.0 ** np.arange(1, 7)
TIME_STEPS = 10.0 ** np.arange(-3, 1.01, 0.25)
UNITS_OF_TIME, MOST_STICK_STEPS = 25.0, 2000
LEFT, TOP, WIDE, HIGH, GAP = 60, 62, 58, 20, 26
COLOURS = {
    Outcome.SETTLED: (88, 142, 120),
    Outcome.STALLED: (226, 190, 120),
    Outcome.CRUSHED: (206, 140, 92),
    Outcome.OUT_OF_STEPS: (214, 210, 200),
    Outcome.DIVERGED: (176, 62, 62),
}
WORDS = {
    Outcome.SETTLED: "settled",
    Outcome.STALLED: "stands arched",
    Outcome.CRUSHED: "crushed",
    Outcome.OUT_OF_STEPS: "out of steps",
    Outcome.DIVERGED: "diverged",
}


@dataclass
class Run:
    dt: float
    outcome: Outcome
    steps: int
    seconds: float
    rms_mm: float


@dataclass
class Panel:
    """All runs of a scan."""

    name: str
    springs: dict[float, list[Run]]
    verlet: list[Run]
    euler: list[Run]


@dataclass
class Case:
    """A scan reduced to 1,000 points, for springs and for sticks."""

    name: str
    points: Floats
    truth: Floats
    lattice: Coarse
    springs: Sticks
    coarse: Coarse
    sticks: Sticks


def cases(count: int):
    for name, noise in (("book", 0.0), ("letter", 0.05)):
        made = virtual_scan(sheet(name), photo_px=None, noise_mm=noise)
        prepared = repair(made.scan)
        mesh = prepared.scan.mesh
        truth = made.truth_xy[prepared.mesh_rows.argsort(kind="stable")[(prepared.mesh_rows < 0).sum() :]]
        lattice = make_quad_mesh(mesh, count)
        coarse = subsample(mesh, prepared.topology, count)
        sticks = make_sticks(coarse.mesh, topology(coarse.mesh.faces, len(coarse.mesh.points)), "unfolded")
        yield Case(name, mesh.points, truth, lattice.coarse, quad_mesh_springs(lattice, "unfolded"), coarse, sticks)


def judged(case: Case, coarse: Coarse, dt: float, fall: Callable[[Mesh], Solution]) -> Run:
    standing = Mesh(onto_support_plane(coarse.mesh)[0], coarse.mesh.faces)
    start = perf_counter()
    done = fall(standing)
    seconds = perf_counter() - start
    flat = prolongate(coarse, case.points, done.points[:, :2])
    return Run(dt, done.outcome, len(done.residuals), seconds, rigid_rms(flat, case.truth))


def by_springs(case: Case, k: float) -> list[Run]:
    runs = []
    for dt in TIME_STEPS:
        most = max(500, int(np.ceil(UNITS_OF_TIME / dt)))
        law = MassSpringSettings(stiffness=float(k), time_step=float(dt), max_steps=most)
        runs.append(judged(case, case.lattice, dt, lambda mesh, law=law: simulate_mass_spring(mesh, case.springs, law)))
    return runs


def by_sticks(case: Case, solve: Callable[[Mesh, Sticks, VerletSettings], Solution]) -> list[Run]:
    runs = []
    for dt in TIME_STEPS:
        law = VerletSettings(time_step=float(dt), max_steps=MOST_STICK_STEPS)
        runs.append(judged(case, case.coarse, dt, lambda mesh, law=law: solve(mesh, case.sticks, law)))
    return runs


def settle_by_euler(mesh: Mesh, sticks: Sticks, law: VerletSettings) -> Solution:
    """The paper's sticks and plane, with explicit Euler steps (4), (5) in place of Verlet's (6), (7)."""
    unit = float(np.median(sticks.rest))
    x, v = mesh.points / unit, np.zeros_like(mesh.points)
    order = shuffled(len(sticks.rest))
    bound = sticks.pairs[order], sticks.rest[order] / unit, sticks.weight[order]
    residuals, heights = np.empty(law.max_steps), np.empty(law.max_steps)
    outcome = Outcome.OUT_OF_STEPS
    for done in range(50, law.max_steps + 1, 50):
        span, kept = slice(done - 50, done), x.copy()
        _euler_steps(x, v, *bound, law.time_step, law.gravity, law.rounds, residuals[span], heights[span])
        if not residuals[done - 1] < 1e3:
            x, outcome = kept, Outcome.DIVERGED
            break
        found = at_rest(residuals[span], heights[span], law.tolerance)
        if found is not None:
            outcome = found
            break
    return Solution(x * unit, outcome, done, residuals[:done], heights[:done] * unit)


@njit(cache=True)
def _euler_steps(x, v, pairs, rest, weight, dt, gravity, rounds, residuals, heights):
    for step in range(len(residuals)):
        for i in range(len(x)):
            for k in range(3):
                x[i, k] += v[i, k] * dt  # (4)
            v[i, 2] -= gravity * dt  # (5)
        for turn in range(rounds):
            residuals[step] = satisfy_constraints(x, pairs, rest, weight, turn % 2 == 1)
            heights[step] = project(x)
        for i in range(len(x)):
            if x[i, 2] == 0.0:
                v[i, 2] = max(v[i, 2], 0.0)  # the plane stops what falls on it


def row(name: str, system: str, stiffness: str, runs: list[Run]) -> str:
    holds = [run.dt for run in runs if run.outcome is not Outcome.DIVERGED]
    lies = [run for run in runs if run.outcome is Outcome.SETTLED]
    head = f"| {name} | {system} | {stiffness} | {span(holds)} | {span([run.dt for run in lies])} |"
    if not lies:
        return f"{head} | | | |"
    best = min(lies, key=lambda run: run.seconds)
    return f"{head} {best.dt:.2g} | {best.steps} | {best.seconds:.2f} | {best.rms_mm:.3f} |"


def span(steps: list[float]) -> str:
    top = " (all tried)" if len(steps) == len(TIME_STEPS) else ""
    return f"{min(steps):.2g} to {max(steps):.2g}{top}" if steps else "none"


class Drawing:
    """A picture whose places are in points, drawn at three pixels each and shown at one and a half."""

    def __init__(self, width: float, height: float):
        self.image = Image.new("RGB", (round(3 * width), round(3 * height)), (252, 252, 250))
        self.pen = ImageDraw.Draw(self.image)

    def text(self, x: float, y: float, words: str, size: float = 14, anchor: str = "mm", fill=(60, 60, 60)):
        self.pen.text((3 * x, 3 * y), words, fill, ImageFont.load_default(3 * size), anchor)

    def box(self, x: float, y: float, width: float, height: float, colour: tuple[int, int, int]):
        corners = [round(3 * at) for at in (x + 1, y + 1, x + width - 1, y + height - 1)]
        self.pen.rounded_rectangle(corners, 9, colour)

    def line(self, *ends: tuple[float, float]):
        self.pen.line([(3 * x, 3 * y) for x, y in ends], (25, 25, 25), 6)

    def shown(self) -> Image.Image:
        return self.image.resize((self.image.width // 2, self.image.height // 2), Image.LANCZOS)


def draw(panels: list[Panel]) -> Image.Image:
    """For each scan how every run ended, over time step and stiffness; sticks, which have no stiffness, beside it."""
    width = LEFT + (len(STIFFNESS) + 2) * WIDE + GAP
    drawing = Drawing(len(panels) * width + GAP, TOP + len(TIME_STEPS) * HIGH + 100)
    for at, panel in enumerate(panels):
        draw_panel(drawing, at * width + LEFT, panel)
    x, y = LEFT, TOP + len(TIME_STEPS) * HIGH + 62
    for outcome, colour in COLOURS.items():
        drawing.box(x, y, 30, 18, colour)
        drawing.text(x + 38, y + 9, WORDS[outcome], anchor="lm")
        x += 68 + 8 * len(WORDS[outcome])
    drawing.line((x, y + 9), (x + 30, y + 9))
    drawing.text(x + 38, y + 9, "theory: dt = damping x sqrt(m / k)", anchor="lm")
    return drawing.shown()


def draw_panel(drawing: Drawing, x0: float, panel: Panel):
    bottom, x1 = TOP + len(TIME_STEPS) * HIGH, x0 + len(STIFFNESS) * WIDE + 12
    for r, dt in enumerate(TIME_STEPS):
        y = bottom - (r + 1) * HIGH
        for c, runs in enumerate([*panel.springs.values()]):
            drawing.box(x0 + c * WIDE, y, WIDE, HIGH, COLOURS[runs[r].outcome])
        for c, runs in enumerate((panel.verlet, panel.euler)):
            drawing.box(x1 + c * WIDE, y, WIDE, HIGH, COLOURS[runs[r].outcome])
        if r % 4 == 0:
            drawing.text(x0 - 8, y + HIGH / 2, f"{dt:g}", anchor="rm")
    drawing.text(x0 - 8, TOP - 14, "dt", anchor="rm")
    drawing.text(x0 + len(STIFFNESS) * WIDE / 2, 18, f"{panel.name}: springs by Euler", 17, fill=(30, 30, 30))
    drawing.text(x1 + WIDE, 18, "sticks", 17, fill=(30, 30, 30))
    for c, label in enumerate(("by Verlet", "by Euler")):
        drawing.text(x1 + (c + 0.5) * WIDE, TOP - 14, label, 12)
    for c, k in enumerate(STIFFNESS):
        drawing.text(x0 + (c + 0.5) * WIDE, bottom + 14, f"{k:,.0f}", 12)
    drawing.text(x0 + len(STIFFNESS) * WIDE / 2, bottom + 36, "stiffness k")
    edges = np.log10(STIFFNESS[[0, -1]]) + [-0.5, 0.5]  # of the outermost columns, which are a decade wide
    limit = np.log10(MassSpringSettings().damping) - edges / 2
    rows = (limit - np.log10(TIME_STEPS[0])) / 0.25 + 0.5
    stop = min(1.0, rows[0] / (rows[0] - rows[1]))  # the line ends where the smallest step does
    right = x0 + stop * len(STIFFNESS) * WIDE
    drawing.line((x0, bottom - rows[0] * HIGH), (right, bottom - (rows[0] + stop * (rows[1] - rows[0])) * HIGH))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--picture", type=Path)
    asked = parser.parse_args()
    print(machine(), "\n")
    print(
        "| scan | system | k | dt that do not diverge | dt that settle | fastest: dt | steps | s | rms mm, all points |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    panels = []
    for case in cases(asked.points):
        panels.append(swept(case))
        for k, runs in panels[-1].springs.items():
            print(row(case.name, "springs by Euler", f"{k:,.0f}", runs), flush=True)
        print(row(case.name, "sticks by Verlet", "", panels[-1].verlet))
        print(row(case.name, "sticks by Euler", "", panels[-1].euler), flush=True)
    if asked.picture:
        draw(panels).save(asked.picture, optimize=True)


def swept(case: Case) -> Panel:
    compiling = VerletSettings(max_steps=50)
    simulate_mass_spring(case.lattice.mesh, case.springs, MassSpringSettings(max_steps=50))
    simulate_verlet(case.coarse.mesh, case.sticks, compiling)
    settle_by_euler(case.coarse.mesh, case.sticks, compiling)
    springs = {float(k): by_springs(case, float(k)) for k in STIFFNESS}
    return Panel(case.name, springs, by_sticks(case, simulate_verlet), by_sticks(case, settle_by_euler))


if __name__ == "__main__":
    main()
