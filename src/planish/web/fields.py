"""Restore settings as form fields, with the names and checks of the command-line flags."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from docstring_parser import parse
from pydantic import TypeAdapter, ValidationError

from planish.errors import UsageError
from planish.hints import as_field
from planish.settings import RestoreSettings, Units
from planish.web.problems import HTTPProblem
from planish.web.restore_upload import Format

_UNPREFIXED = ("flatten", "render", "shading", "binarize")
"""Fields of RestoreSettings whose own fields have no prefix in their names."""
_OTHER_FIELDS: dict[str, tuple[Any, Any, str]] = {
    "units": (Units, "auto", "Unit of the scan's coordinates. auto decides from the file and the size of the scan."),
    "view": (bool, True, "Also write an interactive HTML page: the scan in 3D, the page, and quality maps."),
    "formats": (str, "tif,png,pdf", "Formats of the page, separated by commas: tif, png, jpg, pdf."),
}


@dataclass(frozen=True)
class Field:
    """One setting.

    Attributes
    ----------
    name : str
        Name of the flag.
    path : tuple of str
        Path of the field in RestoreSettings; empty for other fields.
    type : type
    default : object
    help : str
    """

    name: str
    path: tuple[str, ...]
    type: Any
    default: Any
    help: str


@dataclass(frozen=True)
class FormSettings:
    """Settings decoded from a form."""

    settings: RestoreSettings
    units: Units
    view: bool
    formats: tuple[Format, ...]


@cache
def known_fields() -> dict[str, Field]:
    """All form fields, by name.

    Examples
    --------
    >>> [name for name in known_fields() if "tolerance" in name]
    ['multigrid.tolerance', 'verlet.tolerance', 'mass-spring.tolerance']
    """
    all_fields = [
        *_iter_fields(RestoreSettings(), (), ""),
        *(Field(name, (), *about) for name, about in _OTHER_FIELDS.items()),
    ]
    return {field.name: field for field in all_fields}


def read_fields(values: Mapping[str, str]) -> FormSettings:
    """Decode form fields.

    Raises
    ------
    HTTPProblem
        422 for an unknown name or an invalid value.

    Examples
    --------
    >>> wanted = read_fields({"dpi": "150", "rotate": "90", "verlet.max-steps": "50"})
    >>> wanted.settings.render.dpi, wanted.settings.rotate, wanted.settings.flatten.verlet.max_steps
    (150.0, '90', 50)
    """
    notify: dict[tuple[str, ...], Any] = {}
    for name, value in values.items():
        field = known_fields().get(name)
        if field is None:
            raise HTTPProblem(422, f"there is no setting {_quote(name)}; /api/openapi.json names those that there are")
        if field.path:
            notify[field.path] = _value(field, value)
    try:
        settings = _replace_values(RestoreSettings(), (), notify)
    except UsageError as problem:
        raise HTTPProblem(422, problem.message(as_field)) from None
    units, view, formats = (
        _value(field, values[name]) if name in values else field.default
        for name, field in known_fields().items()
        if name in _OTHER_FIELDS
    )
    return FormSettings(settings, units, view, _formats(formats))


def schema_of(field: Field) -> dict[str, Any]:
    """OpenAPI schema of a field."""
    schema = {key: value for key, value in TypeAdapter(field.type).json_schema().items() if key != "title"}
    if field.name == "formats":
        schema["pattern"] = r"^(tif|png|jpg|pdf)(,(tif|png|jpg|pdf))*$"
    return {**schema, "default": field.default, "description": field.help}


def _iter_fields(settings: Any, path: tuple[str, ...], prefix: str) -> Iterator[Field]:
    hints = get_type_hints(type(settings))
    values = {item.arg_name: item.description or "" for item in parse(type(settings).__doc__ or "").params}
    for field in fields(settings):
        value, here = getattr(settings, field.name), (*path, field.name)
        name = field.name.replace("_", "-")
        if is_dataclass(value):
            yield from _iter_fields(value, here, prefix if field.name in _UNPREFIXED else f"{prefix}{name}.")
        else:
            yield Field(f"{prefix}{name}", here, hints[field.name], value, " ".join(values[field.name].split()))


def _replace_values(settings: Any, path: tuple[str, ...], notify: Mapping[tuple[str, ...], Any]) -> Any:
    """Copy settings with some values replaced; the dataclasses validate them."""
    values = {}
    for field in fields(settings):
        value, here = getattr(settings, field.name), (*path, field.name)
        values[field.name] = _replace_values(value, here, notify) if is_dataclass(value) else notify.get(here, value)
    return type(settings)(**values)


def _value(field: Field, values: str) -> Any:
    try:
        value = TypeAdapter(field.type).validate_python(values)
    except ValidationError:
        raise HTTPProblem(422, f"{field.name} is {_quote(values)}; wanted is {_describe_type(field.type)}") from None
    if isinstance(value, float) and not abs(value) < float("inf"):
        raise HTTPProblem(422, f"{field.name} is {_quote(values)}; a finite number is wanted")
    return value


def _describe_type(type: Any) -> str:
    if get_origin(type) is Literal:
        return " or ".join(get_args(type))
    names = {int: "a whole number", float: "a number", bool: "true or false", str: "a text"}
    return names[type] if type in names else " or ".join(_describe_type(one) for one in get_args(type))


def _formats(values: str) -> tuple[Format, ...]:
    names = tuple(dict.fromkeys(values.split(",")))
    for name in names:
        if name not in get_args(Format):
            raise HTTPProblem(422, f"formats has {_quote(name)}; wanted are {', '.join(get_args(Format))}, with commas")
    return names  # type: ignore[return-value]


def _quote(text: str) -> str:
    return ascii(text if len(text) <= 60 else text[:60] + "...")
