"""Errors for users, as one tree; each class carries the exit code of the command line.

| class               | also         | exit code | meaning                                              |
|---------------------|--------------|-----------|------------------------------------------------------|
| `UsageError`        | `ValueError` | 2         | arguments or settings contradict each other          |
| `InputError`        | `ValueError` | 3         | the input cannot be used                             |
| `OutputError`       | `OSError`    | 4         | the output cannot be written                         |
| `MissingExtraError` |              | 6         | an optional dependency is not installed              |

A message says in one line what was found, what was wanted and what to do. What to do is the `hint`: it names settings
in braces (see `planish.hints`), which `str` shows as parameters of Python and each front end in its own terms.
"""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

from planish.hints import Naming, as_parameter, one_sentence, with_hint


class PlanishError(Exception):
    """Base class of all errors that planish raises on purpose.

    Parameters
    ----------
    sentence : str
        What was found and what was wanted.
    hint : str, optional
        What to do, with settings in braces.

    Examples
    --------
    >>> problem = InputError("the page needs 80 GB of memory", "lower {dpi}")
    >>> str(problem), isinstance(problem, ValueError)
    ('the page needs 80 GB of memory; lower dpi', True)
    """

    exit_code = 1

    def __init__(self, sentence: str = "", hint: str = "") -> None:
        self.sentence, self.hint = one_sentence(sentence), one_sentence(hint)
        super().__init__(self.sentence)

    def __str__(self) -> str:
        return self.message()

    def message(self, naming: Naming = as_parameter) -> str:
        """Sentence and hint, with settings named by `naming`."""
        return with_hint(self.sentence, self.hint, naming)


class UsageError(PlanishError, ValueError):
    """Arguments, settings or flags contradict each other."""

    exit_code = 2


class InputError(PlanishError, ValueError):
    """The input cannot be used: missing, damaged, or not a scan of a sheet."""

    exit_code = 3


class OutputError(PlanishError, OSError):
    """The output cannot be written: no folder, no permission, no space."""

    exit_code = 4


class MissingExtraError(PlanishError):
    """An optional dependency is needed and not installed."""

    exit_code = 6


def install_command(extra: str) -> str:
    """Command that installs what an extra of planish needs, with pip or, where pipx installed planish, with pipx.

    It names the extra's packages: planish itself may come from a folder or a wheel, and no index know its extras.

    Examples
    --------
    >>> install_command("ocr")
    "pip install 'pytesseract>=0.3.13'"
    """
    from importlib.metadata import PackageNotFoundError, requires

    try:
        requirements = requires("planish") or []
    except PackageNotFoundError:  # planish runs from its sources
        requirements = []
    marker = re.compile(rf"extra == ['\"]{extra}['\"]")
    packages = [one.partition(";")[0].strip() for one in requirements if marker.search(one)]
    in_pipx = "pipx" in Path(sys.prefix).parts
    return shlex.join(
        [*(["pipx", "inject", "planish"] if in_pipx else ["pip", "install"]), *(packages or [f"planish[{extra}]"])]
    )
