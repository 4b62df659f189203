"""Choices that users make: values of settings checked against their types, and settings made from keywords."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from functools import cache
from math import isfinite
from numbers import Integral, Real
from reprlib import repr as short_repr
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from planish.errors import UsageError

T = TypeVar("T")


class WrongChoice(UsageError):
    """A value is not of the type of its setting.

    Attributes
    ----------
    name : str
        Of the setting.
    reason : str
        What was found and what was expected.
    """

    def __init__(self, name: str, reason: str, hint: str = ""):
        super().__init__(f"{name} {reason}", hint)
        self.name, self.reason = name, reason


class CheckedSettings:
    """Base of the settings: each value must have the type that its field is annotated with.

    Numbers of numpy are taken, and become Python's; whole numbers do where any number is wanted. Not-a-number and
    infinity are refused.

    Raises
    ------
    WrongChoice
    """

    def __post_init__(self) -> None:
        for name, kind in _types(type(self)).items():  # type: ignore[arg-type]
            value = getattr(self, name)
            if isinstance(value, Real) and not isfinite(value):
                raise WrongChoice(name, f"is {value}; expected a finite number")
            if not _fits(value, kind):
                wanted = getattr(kind, "__name__", "") if is_dataclass(kind) else describe_type(kind)
                names = [text for text in get_args(kind) if isinstance(text, str)]
                hint = f"write it as a text: {str(value)!r}" if str(value) in names else ""
                raise WrongChoice(name, f"is {short_repr(value)}; expected {wanted}", hint)
            if isinstance(value, Real) and hasattr(value, "item"):
                object.__setattr__(self, name, value.item())

    def above_zero(self, *names: str) -> None:
        """Refuse numbers that are not greater than 0."""
        for name in names:
            if not getattr(self, name) > 0:
                raise UsageError(f"{name} must be greater than 0, not {getattr(self, name)}")


@cache
def _types(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def _fits(value: object, kind: Any) -> bool:
    origin = get_origin(kind)
    if origin is Literal:
        return isinstance(value, str) and value in get_args(kind)
    if origin in (Union, UnionType):
        return any(_fits(value, one) for one in get_args(kind))
    if origin is tuple:
        wanted = get_args(kind)
        return isinstance(value, list | tuple) and len(value) == len(wanted) and all(map(_fits, value, wanted))
    if kind is float:
        return isinstance(value, Real) and not isinstance(value, bool)
    if kind is int:
        return isinstance(value, Integral) and not isinstance(value, bool)
    return isinstance(value, kind)


def describe_type(kind: Any) -> str:
    """Values that a setting accepts, in words.

    Examples
    --------
    >>> describe_type(float | Literal["auto"])
    'a number or auto'
    """
    if get_origin(kind) is Literal:
        return " or ".join(get_args(kind))
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        return describe_type(first) if others == [...] else f"({', '.join(map(describe_type, get_args(kind)))})"
    names = {int: "an integer", float: "a number", bool: "true or false", str: "a text", NoneType: "none"}
    if kind in names:
        return names[kind]
    return " or ".join(describe_type(one) for one in get_args(kind)) or "an object with settings"


def chosen(kind: type[T], settings: T | None, choices: Mapping[str, Any]) -> T:
    """Settings of a function that takes them as an object, as keywords, or both; keywords win.

    Parameters
    ----------
    kind : type
        Of the settings.
    settings : object of that type, optional
    choices : mapping of str
        See `with_choices`.

    Raises
    ------
    UsageError
        For an object of another type, a name that is no setting, and a wrong value.
    """
    if settings is None:
        settings = kind()
    elif not isinstance(settings, kind):
        raise UsageError(f"settings must be {kind.__name__}, not {short_repr(settings)}")
    return with_choices(settings, choices)


def with_choices(settings: T, choices: Mapping[str, Any]) -> T:
    """Copy of settings with some of them chosen by name.

    Parameters
    ----------
    settings : dataclass
    choices : mapping of str
        Names of its fields, or of fields of the settings within it if only one of these has such a field. The values of
        settings within may be mappings of the same kind.

    Raises
    ------
    UsageError
        For a name that is no setting, that several settings within have, and for a wrong value.

    Examples
    --------
    >>> from planish.settings import RestoreSettings
    >>> made = with_choices(RestoreSettings(), {"dpi": 400, "shading": "none", "method": "verlet", "rounds": 10})
    Traceback (most recent call last):
        ...
    planish.errors.UsageError: there is no setting 'rounds'; ...
    >>> made = with_choices(RestoreSettings(), {"dpi": 400, "method": "verlet", "verlet": {"rounds": 10}})
    >>> made.render.dpi, made.flatten.method, made.flatten.verlet.rounds
    (400, 'verlet', 10)
    """
    own = {f.name: getattr(settings, f.name) for f in fields(settings)}  # type: ignore[arg-type]
    changes: dict[str, Any] = {}
    within: dict[str, dict[str, Any]] = {}
    for name, value in choices.items():
        current = own.get(name)
        if (name in own and not is_dataclass(current)) or (is_dataclass(value) and name in own):
            changes[name] = value
        elif isinstance(value, Mapping) and name in own:
            within.setdefault(name, {}).update(value)
        else:
            within.setdefault(_owner(name, own), {})[name] = value
    for name, inner in within.items():
        changes[name] = with_choices(changes.get(name, own[name]), inner)
    return replace(settings, **changes)  # type: ignore[type-var]


def _owner(name: str, own: Mapping[str, Any]) -> str:
    """Name of the settings within which a setting lies."""
    inner = {stage: [f.name for f in fields(value)] for stage, value in own.items() if is_dataclass(value)}
    owners = [stage for stage, names in inner.items() if name in names]
    if len(owners) == 1:
        return owners[0]
    if owners:
        raise UsageError(f"{' and '.join(owners)} have a setting {name!r}", f"write {owners[0]}={{{name!r}: ...}}")
    if name in inner:
        raise UsageError(f"{name} needs an object or a dict with settings: {', '.join(inner[name])}")
    known = [*own, *(one for names in inner.values() for one in names)]
    near = get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(dict.fromkeys(known))}"
    raise UsageError(f"there is no setting {name!r}", hint)
