"""One restoration job, from input files to output files; shared by the command line, the batch and the web service."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from planish.job.job import Job, Outputs

if TYPE_CHECKING:
    from planish.job.runner import JobResult, check, run, with_file_info

__all__ = ["Job", "JobResult", "Outputs", "check", "run", "with_file_info"]


def __getattr__(name: str) -> object:
    """Import the pipeline on first use: the web service itself never needs it, only its worker processes do."""
    if name not in __all__:
        raise AttributeError(f"module 'planish.job' has no attribute {name!r}")
    return getattr(import_module("planish.job.runner"), name)
