"""What a benchmark ran on, in one line."""

import os
import platform
import sys
from importlib.metadata import version
from pathlib import Path


def machine() -> str:
    try:
        with Path("/proc/cpuinfo").open() as lines:
            cpu = next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        cpu = platform.processor() or platform.machine()
    libraries = ", ".join(f"{name} {version(name)}" for name in ("planish", "numpy", "numba"))
    return f"{cpu}, {os.cpu_count()} cores, Python {sys.version.split()[0]}, {libraries}"
