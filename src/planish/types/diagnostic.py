"""Warnings as values: a code for programs, a sentence and a hint for people."""

from __future__ import annotations

from dataclasses import dataclass

from planish.hints import Naming, as_parameter, with_hint


@dataclass(frozen=True)
class Diagnostic:
    """A warning about a scan or its page; `str` of it is the whole sentence.

    Attributes
    ----------
    code : str
        Stable identifier, such as "unit-guessed"; docs/errors.md lists all of them. Programs compare this.
    sentence : str
        What was found.
    hint : str
        What to do, or empty. Settings stand in braces (`planish.hints`), so that each front end can name them in its
        own terms.

    Examples
    --------
    >>> warning = Diagnostic("unit-guessed", "the numbers were taken as mm", "set {units} if that is wrong")
    >>> str(warning)
    'the numbers were taken as mm; set units if that is wrong'
    """

    code: str
    sentence: str
    hint: str = ""

    def __str__(self) -> str:
        return self.message()

    def message(self, naming: Naming = as_parameter) -> str:
        """Sentence and hint, with settings named by `naming`."""
        return with_hint(self.sentence, self.hint, naming)
