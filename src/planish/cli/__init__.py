"""The command-line interface: parse flags, call the library, report errors in one sentence."""

from planish.cli.main import main

__all__ = ["main"]
