"""Thresholds found, changed and put back, as benchmarks/sensitivity.py does it, on a module made for it."""

import importlib.util
import math
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from constants import Threshold, changed, thresholds

SOURCE = """
import math
from numba import njit

LIMIT = 0.25
CLOSE = math.cos(math.radians(20.0))
RANGE = (1.0, 3.0)
FEWEST = 5
TERMS = 6
SIZE = 7.0

def judge(x):
    return x > LIMIT and x < CLOSE and RANGE[0] < SIZE * x and len([x]) < FEWEST

def fit(x):
    return x < TERMS and range(TERMS)

@njit(cache=True)
def inner(x):
    return x > LIMIT

@njit(cache=True)
def outer(x):
    return inner(x)
"""


@pytest.fixture
def trial(tmp_path, monkeypatch):
    """A module `planish.trial` with thresholds of every kind."""
    path = tmp_path / "trial.py"
    path.write_text(SOURCE)
    spec = importlib.util.spec_from_file_location("planish.trial", path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "planish.trial", module)
    spec.loader.exec_module(module)
    return module


def test_constants_that_something_is_compared_with_are_found(trial):
    found = {threshold.name: threshold for threshold in thresholds("trial")}
    assert set(found) == {"LIMIT", "CLOSE", "RANGE", "FEWEST", "SIZE"}
    assert found["LIMIT"].place == "trial.LIMIT"
    assert found["LIMIT"].times(2.0) == 0.5
    assert found["CLOSE"].times(0.5) == pytest.approx(math.cos(math.radians(10.0)))
    assert found["RANGE"].times(0.5) == (1.5, 2.5)
    assert found["FEWEST"].times(0.5) == 2
    assert Threshold("planish.trial", "SHARE", 0.8).times(0.5) == 0.9


def test_a_change_reaches_kernels_and_those_that_call_them_and_is_put_back(trial):
    (limit,) = (threshold for threshold in thresholds("trial") if threshold.name == "LIMIT")
    assert trial.outer(0.4)
    with changed(limit, 0.5):
        assert not trial.judge(0.4)
        assert not trial.inner(0.4)
        assert not trial.outer(0.4)
    assert trial.judge(0.4)
    assert trial.inner(0.4)
    assert trial.outer(0.4)


def test_every_room_has_thresholds():
    for room in ("document", "flattening", "illumination", "surface"):
        assert list(thresholds(room)), room
