"""The command line: files in, files out, one sentence when something is wrong."""

from planish.cli.main import main

__all__ = ["main"]
