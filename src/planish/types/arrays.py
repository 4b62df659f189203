"""Array types, and read-only arrays for frozen values."""

from __future__ import annotations

from dataclasses import MISSING, Field, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Bools = NDArray[np.bool_]
Pixels = NDArray[np.uint8] | NDArray[np.uint16]

T = TypeVar("T")


def freeze(value: object) -> None:
    """Make every array field of a dataclass contiguous and read-only, without a copy where it is contiguous already.

    For values made inside planish, whose arrays nobody else holds. What a user gives is copied first (`frozen_copy`).
    """
    for f in fields(value):  # type: ignore[arg-type]
        array = getattr(value, f.name)
        if isinstance(array, np.ndarray):
            object.__setattr__(value, f.name, read_only(array))


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A contiguous read-only array on the same numbers, without a copy where they are contiguous already.

    Numba compiles a kernel anew where an array may be written; what reaches a kernel both as a user's read-only array
    and as one that a stage has just made is passed to it like this.
    """
    frozen = np.ascontiguousarray(array).view()
    frozen.flags.writeable = False
    return frozen


def frozen_copy(array: NDArray[Any], source: object) -> NDArray[Any]:
    """A contiguous read-only array that nobody can change.

    Parameters
    ----------
    array : ndarray
        Converted from `source`.
    source : object
        What the user gave. If it may share memory with `array` and is not itself unchangeable, the numbers are copied.
    """
    if isinstance(source, np.ndarray):
        own = _is_unchangeable(source) or not np.may_share_memory(array, source)
    else:
        own = isinstance(source, list | tuple)
    frozen = np.ascontiguousarray(array) if own else np.array(array, order="C", copy=True, subok=False)
    frozen.flags.writeable = False
    return frozen


def _is_unchangeable(array: NDArray[Any]) -> bool:
    """Whether an array and all arrays that it is a view of are read-only."""
    owner: object = array
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable:
            return False
        owner = owner.base
    return owner is None or isinstance(owner, bytes)


def trusted(kind: type[T], **values: object) -> T:
    """Make a frozen dataclass without its checks and copies: for arrays that planish itself has just made.

    Fields that are not given get their defaults.
    """
    made = object.__new__(kind)
    for f in fields(kind):  # type: ignore[arg-type]
        object.__setattr__(made, f.name, values[f.name] if f.name in values else _default(f))
    freeze(made)
    return made


def trusted_replace(value: T, **changes: object) -> T:
    """As `dataclasses.replace`, without the checks and copies: for arrays that planish itself has just made."""
    kept = {f.name: getattr(value, f.name) for f in fields(value)}  # type: ignore[arg-type]
    return trusted(type(value), **(kept | changes))


def _default(field: Field[Any]) -> object:
    if field.default_factory is not MISSING:
        return field.default_factory()
    assert field.default is not MISSING, field.name
    return field.default
