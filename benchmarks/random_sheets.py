"""How random sheets end: python benchmarks/random_sheets.py [--count 10000] [--first 0]

Each is bent in one of the gallery's ways and has some of: noise (white; for every second sheet mixed with shared noise,
ripple, steps and spikes), holes, cuts, an odd outline, slivers, flipped and doubled faces, points that are no numbers,
a second piece, another scale. The same that the tests run two hundred of (tests/random_sheets.py): an answer that is
not finite, or that keeps quiet about a flipped face or an overlap, ends the run. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from time import perf_counter

from machine import machine

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from random_sheets import check


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    asked = parser.parse_args()
    ended: Counter[str] = Counter()
    slowest = (0.0, -1)
    for seed in range(asked.first, asked.first + asked.count):
        start = perf_counter()
        ended[check(seed)] += 1
        slowest = max(slowest, (perf_counter() - start, seed))
    print(f"{machine()}\n\n| outcome | sheets |\n|---|---|")
    for outcome, count in ended.most_common():
        print(f"| {outcome} | {count:,} |")
    print(f"\nThe slowest took {slowest[0]:.1f} s (seed {slowest[1]}).")


if __name__ == "__main__":
    main()
