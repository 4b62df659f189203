"""Warnings as values: a code for programs, a sentence and a hint for people."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace

from planish.hints import Naming, as_parameter, one_sentence, with_hint

MOST_OF_A_KIND = 20
"""Warnings of one code that a person will read."""


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

    def __post_init__(self) -> None:
        object.__setattr__(self, "sentence", one_sentence(self.sentence))
        object.__setattr__(self, "hint", one_sentence(self.hint))

    def __str__(self) -> str:
        return self.message()

    def message(self, naming: Naming = as_parameter) -> str:
        """Sentence and hint, with settings named by `naming`."""
        return with_hint(self.sentence, self.hint, naming)


def few_of_a_kind(warnings: Iterable[Diagnostic]) -> list[Diagnostic]:
    """At most `MOST_OF_A_KIND` of every code; the last of them has the number of those left out.

    Examples
    --------
    >>> found = few_of_a_kind(Diagnostic("image-missing", f"there is no image {k}") for k in range(1000))
    >>> len(found), str(found[-1])
    (20, 'there is no image 19 (and 980 more of this kind)')
    """
    kept: list[Diagnostic] = []
    count: Counter[str] = Counter()
    last: dict[str, int] = {}
    for warning in warnings:
        count[warning.code] += 1
        if count[warning.code] <= MOST_OF_A_KIND:
            last[warning.code] = len(kept)
            kept.append(warning)
    for code, number in count.items():
        if number > MOST_OF_A_KIND:
            one = kept[last[code]]
            sentence = f"{one.sentence} (and {number - MOST_OF_A_KIND:,} more of this kind)"
            kept[last[code]] = replace(one, sentence=sentence)
    return kept
