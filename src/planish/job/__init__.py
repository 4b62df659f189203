"""One restoration from files to files: what the command line, the batch and the service all do."""

from planish.job.job import Job, Outputs
from planish.job.runner import Done, check, run, with_files

__all__ = ["Done", "Job", "Outputs", "check", "run", "with_files"]
