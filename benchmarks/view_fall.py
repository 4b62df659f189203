"""How sheets come down in the page to look at: the particle system with several time steps: benchmarks/view_fall.py."""

from dataclasses import replace
from time import perf_counter

import numpy as np

from planish.flattening import simulate_verlet
from planish.gallery import sheet, sheet_mesh
from planish.mesh import onto_support_plane, repair, subsample, topology
from planish.sticks import make_sticks
from planish.types import Mesh, Scan
from planish.view.fall_animation import ANIMATION_SETTINGS, SIMULATED_POINTS

SHEETS = ("book", "letter", "spread", "wave", "curl", "crumpled", "miura")
TIME_STEPS = (0.1, 0.05, 0.03)


def main() -> None:
    """Print a table: how each fall ended, after how many steps, and how many of them make up nine tenths of the way."""
    print("| sheet | time step | outcome | steps | for 9/10 of the way | seconds |")
    print("|---|---|---|---|---|---|")
    for name in SHEETS:
        prepared = repair(Scan(sheet_mesh(sheet(name), points=60_000)[0]))
        mesh = subsample(prepared.scan.mesh, prepared.topology, SIMULATED_POINTS).mesh
        sticks = make_sticks(mesh, topology(mesh.faces, len(mesh.points)), "unfolded")
        standing = Mesh(onto_support_plane(mesh)[0], mesh.faces)
        for time_step in TIME_STEPS:
            seen = []
            start = perf_counter()
            done = simulate_verlet(
                standing, sticks, replace(ANIMATION_SETTINGS, time_step=time_step), watch=seen.append
            )
            seconds = perf_counter() - start
            left = np.sqrt(((np.array(seen) - seen[-1]) ** 2).sum(axis=2).mean(axis=1))
            near = int(np.argmax(left < 0.1 * left[0]))
            print(f"| {name} | {time_step} | {done.outcome.name} | {len(done.heights)} | {near} | {seconds:.2f} |")


if __name__ == "__main__":
    main()
