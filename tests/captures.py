"""Real captures, which are no part of the project: tests that need them are marked `shared` and name the folder."""

import os
from pathlib import Path

DATA = Path(os.environ.get("PLANISH_DATA") or Path(__file__).parents[2] / "shared" / "data")
"""Beside the checkout, or where PLANISH_DATA says."""
