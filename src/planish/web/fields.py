"""Restore settings as form fields, with the names and checks of the command-line flags."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from typing import Any, get_type_hints

from docstring_parser import parse

from planish.errors import UsageError
from planish.job.settings_codec import SettingsError, decode_settings, json_schema
from planish.settings import Paper, PhotoSettings, RestoreSettings, mm_per_unit
from planish.web.outline import read_cut, read_outline
from planish.web.problems import HTTPProblem
from planish.web.upload_request import Format
from planish.web.wording import in_browser

_UNPREFIXED = ("settings", "flatten", "render", "shading", "binarize")
"""Nested settings whose fields have no prefix in their names."""


@dataclass(frozen=True, kw_only=True)
class FormSettings:
    """Settings decoded from a form.

    Attributes
    ----------
    settings : RestoreSettings
    marker_mm : float, optional
        For photos without a scan: side of the black squares of printed ArUco markers (DICT_4X4_50) beside the sheet.
    paper : {"unknown", "a3", "a4", "a5", "letter", "legal"}
        For photos without a scan: size of the sheet.
    width_mm : float, optional
        For photos without a scan: width of the sheet.
    distance_mm : float, optional
        For several photos without a scan: distance of two places of the sheet along the paper; `between` names them.
    between : str
        NAME,x,y,x,y: one of the photos, and column and row of both places in it [px], as a browser shows it.
    outline : str
        The sheet's outline on its photo, for a scan with one photo or one photo without a scan: the photo's size as a
        browser shows it, and corners in it [px], such as 400x300 12,30 390,40 200,290.
    cut : str
        The sheet's outline on a view of the scan from any side: the size of the view, what four numbers times
        (x, y, z, 1) give the column, what give the row [px], and corners, such as
        400x300 2,0,0,200 0,-2,0,150 12,30 390,40 200,290.
    points_only : bool
        Restore nothing: the only result is points.json, some points of the scan with their colours, to be turned and
        cut in a browser.
    units : {"auto", "mm", "cm", "m", "in"} or a length
        Unit of the scan's coordinates. auto decides from the file and the size of the scan; a length such as 7.91um is
        that of a step of 1, for voxels.
    view : bool
        Also write an interactive HTML page: the scan in 3D, the page, and quality maps.
    formats : tuple of {"tif", "png", "jpg", "pdf"}
        Formats of the page, separated by commas: tif, png, jpg, pdf.
    """

    settings: RestoreSettings = field(default_factory=RestoreSettings)
    marker_mm: float | None = None
    paper: Paper = "unknown"
    width_mm: float | None = None
    distance_mm: float | None = None
    between: str = ""
    outline: str = ""
    cut: str = ""
    points_only: bool = False
    units: str = "auto"
    view: bool = True
    formats: tuple[Format, ...] = ("tif", "png", "pdf")

    def __post_init__(self) -> None:
        _ = self.size, read_outline(self.outline), read_cut(self.cut)
        if self.outline and self.cut:
            raise UsageError("outline and cut both say where the sheet is; give one of them")
        if self.units != "auto":
            mm_per_unit(self.units)

    @property
    def size(self) -> PhotoSettings:
        """What tells the size of a photographed sheet; refuses two answers."""
        return PhotoSettings(
            marker_mm=self.marker_mm,
            paper=self.paper,
            width_mm=self.width_mm,
            distance_mm=self.distance_mm,
            between=_marked_places(self.between),
        )


def _marked_places(text: str) -> tuple[str, float, float, float, float] | None:
    if not text:
        return None
    name, *places = text.rsplit(",", 4)
    try:
        x0, y0, x1, y1 = map(float, places)
    except ValueError:
        raise UsageError("between must name a photo and two places in it, such as a.jpg,10,20,300,400") from None
    return name, x0, y0, x1, y1


@dataclass(frozen=True)
class Field:
    """One form field.

    Attributes
    ----------
    name : str
        Name of the flag.
    path : tuple of str
        Path of the setting in FormSettings.
    type : type
    default : object
    help : str
    """

    name: str
    path: tuple[str, ...]
    type: Any
    default: Any
    help: str


@cache
def known_fields() -> dict[str, Field]:
    """All form fields, by name.

    Examples
    --------
    >>> [name for name in known_fields() if "tolerance" in name]
    ['multigrid.tolerance', 'verlet.tolerance', 'mass-spring.tolerance']
    """
    return {field.name: field for field in _iter_fields(FormSettings(), (), "")}


def read_fields(values: Mapping[str, str]) -> FormSettings:
    """Decode form fields.

    Raises
    ------
    HTTPProblem
        422 for an unknown name or an invalid value.

    Examples
    --------
    >>> form = read_fields({"dpi": "150", "rotate": "90", "verlet.max-steps": "50", "formats": "pdf"})
    >>> form.settings.render.dpi, form.settings.rotate, form.settings.flatten.verlet.max_steps, form.formats
    (150.0, '90', 50, ('pdf',))
    """
    nested: dict[str, Any] = {}
    for name, value in values.items():
        field = known_fields().get(name)
        if field is None:
            raise HTTPProblem(422, f"there is no setting {name[:60]!a}; /api/openapi.json lists all settings")
        *parents, last = field.path
        target = nested
        for parent in parents:
            target = target.setdefault(parent, {})
        target[last] = list(dict.fromkeys(value.split(","))) if name == "formats" else value
    try:
        return decode_settings(FormSettings, nested, from_strings=True)
    except SettingsError as problem:
        name = next(field.name for field in known_fields().values() if field.path == problem.path)
        raise HTTPProblem(422, f"{name} {problem.reason}") from None
    except UsageError as problem:
        raise HTTPProblem(422, in_browser(problem)) from None


def schema_of(field: Field) -> dict[str, Any]:
    """OpenAPI schema of a field."""
    schema, default = json_schema(field.type), field.default
    if field.name == "formats":
        schema = {"type": "string", "pattern": r"^(tif|png|jpg|pdf)(,(tif|png|jpg|pdf))*$"}
        default = ",".join(default)
    return {**schema, "default": default, "description": field.help}


def _iter_fields(settings: Any, path: tuple[str, ...], prefix: str) -> Iterator[Field]:
    hints = get_type_hints(type(settings))
    helps = {param.arg_name: param.description or "" for param in parse(type(settings).__doc__ or "").params}
    for item in fields(settings):  # python -OO leaves no docstrings
        value, here = getattr(settings, item.name), (*path, item.name)
        name = item.name.replace("_", "-")
        if is_dataclass(value):
            yield from _iter_fields(value, here, prefix if item.name in _UNPREFIXED else f"{prefix}{name}.")
        else:
            yield Field(f"{prefix}{name}", here, hints[item.name], value, " ".join(helps.get(item.name, "").split()))
