"""Depth from OpenEXR images, as renderers and phones write it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.io.suppress_stderr import suppress_stderr

EXR = b"\x76\x2f\x31\x01"
"""Every EXR begins with it."""

DEPTH_NAMES = ("Z", "depth.Z", "depth", "Depth.V", "V", "Y", "R")
"""Channels that may hold the depth, the surest first; an image with a single channel holds it there."""


def read_exr(path: Path) -> NDArray[np.float32]:
    """Read the depth channel of an EXR, (rows, cols) float32; not finite where there is none.

    Raises
    ------
    InputError
        If the file is damaged, or no channel is one of depth.
    """
    import OpenEXR

    try:
        with suppress_stderr():
            channels = OpenEXR.File(str(path), separate_channels=True).channels()
    except Exception as problem:  # its errors are of several classes
        reason = " ".join(str(problem).split())
        raise InputError(f"{path} is an EXR, but damaged or cut short: {reason}") from None
    name = next((name for name in DEPTH_NAMES if name in channels), None)
    if name is None and len(channels) == 1:
        name = next(iter(channels))
    if name is None:
        raise InputError(
            f"{path} has the channels {', '.join(sorted(channels))}; depth is wanted, in "
            f"{', '.join(DEPTH_NAMES[:-1])} or {DEPTH_NAMES[-1]}"
        )
    return np.asarray(channels[name].pixels, np.float32)
