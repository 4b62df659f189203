"""One restoration from files to files: what the command line, the batch and the service all do."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from planish.job.job import Job, Outputs

if TYPE_CHECKING:
    from planish.job.runner import Done, check, run, with_files

__all__ = ["Done", "Job", "Outputs", "check", "run", "with_files"]


def __getattr__(name: str) -> object:
    """Load the stages only where a job is run: the service leaves that to other processes."""
    if name not in __all__:
        raise AttributeError(f"module 'planish.job' has no attribute {name!r}")
    return getattr(import_module("planish.job.runner"), name)
