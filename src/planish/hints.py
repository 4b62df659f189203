"""Hints of warnings and errors: what to do, with settings in braces that each front end names in its own terms.

A hint such as ``"set {units} if that is wrong"`` names a parameter of the library. Python shows the parameter, the
command line its flag, the web form its field. ``{projector_scale=2}`` names a value as well.
"""

from __future__ import annotations

import re
from collections.abc import Callable

Naming = Callable[[str, str | None], str]
"""Maps (parameter, value or None) to what a user of one front end types."""

_SETTING = re.compile(r"\{([A-Za-z_][\w.]*)(?:=([^{}]*))?\}")


LONGEST = 1000
"""Characters of a sentence. Ours have some hundred; a name from a damaged or hostile file may have millions."""

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]+")


def one_sentence(text: str) -> str:
    r"""A sentence with names from files in it, as people can read it: one line, without its middle if it is endless.

    Control characters, which could also steer a terminal, become blanks.

    Examples
    --------
    >>> one_sentence("a scan\x1b[31m.obj names no\nimage"), len(one_sentence(10**6 * "b"))
    ('a scan [31m.obj names no image', 1000)
    """
    if len(text) > LONGEST:
        text = f"{text[: LONGEST // 2]}...{text[3 - LONGEST // 2 :]}"
    return _CONTROL.sub(" ", text)


def as_parameter(name: str, value: str | None = None) -> str:
    """Name a setting as Python code does.

    Examples
    --------
    >>> as_parameter("verlet.self_collision"), as_parameter("projector_scale", "2")
    ('verlet.self_collision', 'projector_scale=2')
    """
    return name if value is None else f"{name}={value}"


def as_flag(name: str, value: str | None = None) -> str:
    """Name a setting as the command line does.

    Examples
    --------
    >>> as_flag("verlet.self_collision"), as_flag("projector_scale", "2")
    ('--verlet.self-collision', '--projector-scale 2')
    """
    flag = f"--{name.rstrip('_').replace('_', '-')}"
    return flag if value is None else f"{flag} {value}"


def as_field(name: str, value: str | None = None) -> str:
    """Name a setting as the fields of the web form are called.

    Examples
    --------
    >>> as_field("verlet.self_collision"), as_field("projector_scale", "2")
    ('the field verlet.self-collision', 'the field projector-scale to 2')
    """
    field = f"the field {name.rstrip('_').replace('_', '-')}"
    return field if value is None else f"{field} to {value}"


def with_hint(sentence: str, hint: str, naming: Naming = as_parameter) -> str:
    """Join a sentence and its hint, if it has one, with settings named by `naming`.

    Examples
    --------
    >>> with_hint("the numbers were taken as mm", "set {units} if that is wrong", as_flag)
    'the numbers were taken as mm; set --units if that is wrong'
    """
    if not hint:
        return sentence
    return f"{sentence}; {_SETTING.sub(lambda setting: naming(setting[1], setting[2]), hint)}"
