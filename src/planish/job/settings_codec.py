"""Decode settings from plain values: the JSON of a report, the fields of a form, or the options of a command.

msgspec does the conversion, driven by the annotations of `planish.settings`. As a base dependency it is preferred to
pydantic and cattrs because it has no dependencies of its own and imports in 0.03 s (0.2 and 0.1 s).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, TypeVar, get_type_hints

import msgspec

from planish.choices import WrongChoice, describe_type
from planish.errors import UsageError

T = TypeVar("T")


class SettingsError(UsageError):
    """A value does not have the type of its setting.

    Attributes
    ----------
    path : tuple of str
        Names of the fields that lead to the setting.
    reason : str
        What was found and what was expected.
    """

    def __init__(self, path: tuple[str, ...], reason: str):
        super().__init__(f"{'.'.join(path) or 'settings'} {reason}")
        self.path, self.reason = path, reason


def decode_settings(kind: type[T], values: object, *, from_strings: bool = False) -> T:
    """Convert nested values to a settings dataclass.

    Fields without a value keep their default. Names that are no fields are ignored, so that reports of older and newer
    versions can be read.

    Parameters
    ----------
    kind : type
        A dataclass.
    values : mapping or object
        Nested mappings, or an object with attributes of the names of the fields.
    from_strings : bool
        Also convert strings to numbers and booleans.

    Raises
    ------
    SettingsError
        If a value has the wrong type, or is not finite.
    UsageError
        If the dataclass refuses a value.

    Examples
    --------
    >>> from planish.settings import RestoreSettings
    >>> values = {"render": {"dpi": "150"}, "rotate": "90", "no such setting": 1}
    >>> settings = decode_settings(RestoreSettings, values, from_strings=True)
    >>> settings.render.dpi, settings.rotate, settings.pages
    (150.0, '90', '1')
    >>> decode_settings(RestoreSettings, {"render": {"dpi": "fine"}})
    Traceback (most recent call last):
    planish.job.settings_codec.SettingsError: render.dpi is 'fine'; expected a number or auto
    """
    try:
        return msgspec.convert(values, kind, strict=not from_strings, from_attributes=True)
    except msgspec.ValidationError as problem:
        if isinstance(problem.__cause__, WrongChoice):
            raise SettingsError((*_path(problem), problem.__cause__.name), problem.__cause__.reason) from None
        if isinstance(problem.__cause__, UsageError):  # raised by a dataclass, and wrapped if it is a ValueError
            raise problem.__cause__ from None
        raise _settings_error(_path(problem), kind, values) from None


def json_schema(kind: Any) -> dict[str, Any]:
    """JSON schema of the type of a setting.

    Examples
    --------
    >>> json_schema(float)
    {'type': 'number'}
    """
    return msgspec.json.schema(kind)


def _path(problem: msgspec.ValidationError) -> tuple[str, ...]:
    """Path of the field that a message of msgspec ends in: "... - at `$.render.dpi`"."""
    message = str(problem)
    return tuple(re.findall(r"\.(\w+)", message.rpartition(" - at `$")[2])) if " - at `$" in message else ()


def _settings_error(path: tuple[str, ...], kind: Any, values: object) -> SettingsError:
    for name in path:
        kind = get_type_hints(kind)[name]
        values = values.get(name) if isinstance(values, Mapping) else getattr(values, name, None)
    text = ascii(values)
    return SettingsError(path, f"is {text if len(text) <= 64 else text[:60] + '...'}; expected {describe_type(kind)}")
