"""A thousand random sheets: each ends in time, with finite places, and with every flip and overlap told."""

from collections import Counter
from time import perf_counter

import numpy as np
import pytest

import planish
from planish.errors import InputError
from planish.mesh import clean
from planish.types import Scan
from random_sheets import random_sheet

LIMIT = 10.0
"""Seconds for one sheet of at most 2,500 points: hundreds of times what it takes, so that only a hang exceeds it."""


def check(seed: int) -> str:
    """Flatten one sheet; returns how it ended."""
    scan = Scan(random_sheet(seed))
    start = perf_counter()
    try:
        done = planish.restore(scan)
    except InputError:
        return "refused"
    assert perf_counter() - start < LIMIT, seed
    flat, said = done.flattening, done.report.flatten
    assert np.isfinite(flat.page_xy).all(), seed
    assert np.isfinite([*flat.size_mm, said.strain_rms, said.expected_error_mm]).all(), seed
    cleaned = clean(scan)
    kept = cleaned.place >= 0
    page = np.zeros((len(cleaned.scan.mesh.points), 2))
    page[cleaned.place[kept]] = flat.page_xy[kept]
    ab, ac = (page[cleaned.scan.mesh.faces[:, k]] - page[cleaned.scan.mesh.faces[:, 0]] for k in (1, 2))
    flips = int((ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0] >= 0).sum())
    shared = any("touch in a point" in warning for warning in done.report.warnings)
    assert said.flipped_faces == flips or shared, seed
    for count, word in ((said.flipped_faces, "back up"), (said.overlaps, "over other parts")):
        assert not count or any(word in warning for warning in done.report.warnings), seed
    return flat.outcome.name


@pytest.mark.parametrize("hundred", range(10))
def test_random_sheets(hundred):
    ended = Counter(check(seed) for seed in range(100 * hundred, 100 * hundred + 100))
    assert ended["SETTLED"] > 60, ended  # most are paper; the others are told apart
