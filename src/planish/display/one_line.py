"""Values in one line: shapes instead of numbers, sizes instead of bytes."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import numpy as np

_LONGEST = 120
"""Characters of one field."""


def shape_of(array: np.ndarray) -> str:
    """Shape and type of an array.

    Examples
    --------
    >>> shape_of(np.zeros((300, 200, 3), np.uint8))
    '300 x 200 x 3 uint8'
    """
    return f"{' x '.join(map(str, array.shape))} {array.dtype}"


def one_line(value: object) -> str:
    """The `repr` of a dataclass or named tuple: fields that are None left out, arrays as their shape and type.

    Examples
    --------
    >>> from typing import NamedTuple
    >>> class Photo(NamedTuple):
    ...     pixels: np.ndarray
    ...     icc: bytes | None
    >>> one_line(Photo(np.zeros((2, 3), np.uint8), b"profile"))
    'Photo(pixels=<2 x 3 uint8>, icc=<7 bytes>)'
    """
    names = [f.name for f in fields(value)] if is_dataclass(value) else value._fields  # type: ignore[attr-defined]
    told = [f"{name}={_short(getattr(value, name))}" for name in names if getattr(value, name) is not None]
    return f"{type(value).__name__}({', '.join(told)})"


def _short(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"<{shape_of(value)}>"
    if isinstance(value, bytes):
        return f"<{len(value):,} bytes>"
    if isinstance(value, list | tuple | dict) and len(value) > 2:
        return f"<{len(value)} items>"
    text = " ".join(repr(value).split())
    if len(text) <= _LONGEST:
        return text
    return f"{text[:_LONGEST]}..." if isinstance(value, str) else f"<{type(value).__name__}>"
