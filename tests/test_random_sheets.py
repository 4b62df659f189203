"""Two hundred random sheets: each ends, with finite places, and with every flip and overlap reported.

`benchmarks/random_sheets.py` does the same with ten thousand.
"""

from collections import Counter

import pytest

from random_sheets import check


@pytest.mark.slow
@pytest.mark.parametrize("hundred", range(2))
def test_random_sheets(hundred):
    ended = Counter(check(seed) for seed in range(100 * hundred, 100 * hundred + 100))
    assert ended["SETTLED"] > 60, ended  # most are paper; the others are told apart
