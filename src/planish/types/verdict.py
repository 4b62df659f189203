"""How good a page is, in one word with its reasons: the only place where that is decided."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from planish.types.diagnostic import Diagnostic

Word = Literal["good", "look at it", "not good"]

STRAINED, TORN = 0.01, 0.02
"""Rms strain that asks for a look, and that no sheet has: paper gives some tenths of a percent, crumpled paper with its
folds read through noise up to 0.8 %, a sheet together with its table 0.6 to 1.1 %, surfaces that are no paper 2 % and
more; 2 % are 4 mm in the width of a letter, and about what office paper stretches along its grain before it tears (a
rule of thumb, not measured here): panels of glass with 2.00 % are not good. With half of the first crumpled sheets ask
for a look; doubled, tables do not. With half of the second a sheet on its table is not good at once; doubled, a dome of
60 degrees is a page."""

SPOILED = 0.01
"""Part of the faces that may lie over others, or on their back, of a page that is still one."""

UNSEEN, MOSTLY_UNSEEN = 0.05, 0.5
"""Parts of the page without data that ask for a look, beside the rim that every scan misses, and that leave no page:
what folds hide of a sheet is 1 to 3 %. With half of the first some letters ask for a look; doubled, a whole curl may be
missing."""

UNSURE = 0.005
"""Expected error, in shorter sides of the page, that asks for a look: 1 mm on a letter, a third of a line of print."""

SCALE_GUESSED = frozenset(
    {"unit-guessed", "unit-overruled", "depth-scale-guessed", "size-unusual", "size-unknown", "scale-unknown"}
)
"""Codes of warnings that say that the size in mm is a guess."""

ASK_FOR_A_LOOK = SCALE_GUESSED | {
    *("several-images", "image-missing", "image-no-photo", "material-missing", "texture-unreadable"),
    *("texture-outside-photo", "mask-unusable", "several-scans", "points-unused"),
    *("several-pieces", "pieces-apart", "faces-not-laid", "layers-passed", "overhang-hidden"),
    *("faces-flipped", "faces-overlap", "page-huge", "text-mirrored"),
    *("surroundings-doubtful", "sheets-several", "box-face", "hand-left-out", "outline-doubtful", "page-size-changed"),
    *("split-in-middle", "split-crosses-print", "sheet-folded", "sides-bent", "lines-crooked"),
    *("sheet-cut", "page-incomplete", "page-extrapolated", "sheet-not-found", "sheet-outline-doubtful"),
    "page-not-made",
    *("photos-missing", "photos-from-one-side", "little-measured", "unlike-paper", "bends-bridged"),
    *("scan-size-unusual", "depth-direction", "depth-mirrored"),
}
"""Codes of warnings after which a person should compare page and original; the others are notes."""


@dataclass(frozen=True)
class Verdict:
    """How good a page is.

    Attributes
    ----------
    word : {"good", "look at it", "not good"}
        good: nothing speaks against using the page as it is. look at it: it may be right, but something should be
        compared with the original. not good: it is not the page.
    reasons : tuple of Diagnostic
        Of anything but good, the worst first.
    """

    word: Word
    reasons: tuple[Diagnostic, ...] = ()

    @property
    def usable(self) -> bool:
        """Whether it is anything but "not good"; if not, commands exit with 5."""
        return self.word != "not good"

    @property
    def codes(self) -> frozenset[str]:
        """Codes of the reasons."""
        return frozenset(reason.code for reason in self.reasons)


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What a verdict is derived from.

    Attributes
    ----------
    settled : bool
    outcome : str
        Its sentence.
    strain_rms : float
    expected_error_mm, shorter_side_mm : float
    flipped, overlaps : float
        Parts of the faces.
    known_fraction : float or None
        Part of the page that scan and photo cover; None where no photo was drawn.
    rim : float
        Part of the page within half a point spacing of its border, which no scan covers.
    warnings : sequence of Diagnostic
    """

    settled: bool
    outcome: str
    strain_rms: float
    expected_error_mm: float
    shorter_side_mm: float
    flipped: float
    overlaps: float
    known_fraction: float | None
    rim: float
    warnings: Sequence[Diagnostic]


def judge(seen: Evidence) -> Verdict:
    """Derive the verdict of a page: not good if a figure rules it out, look at it if there is a doubt.

    Examples
    --------
    >>> page = Evidence(
    ...     settled=True, outcome="flat", strain_rms=2e-4, expected_error_mm=0.02, shorter_side_mm=210.0, flipped=0.0,
    ...     overlaps=0.0, known_fraction=0.99, rim=0.01, warnings=[Diagnostic("points-welded", "3 points were welded")]
    ... )
    >>> judge(page).word
    'good'
    >>> from dataclasses import replace
    >>> doubtful = judge(replace(page, known_fraction=0.8))
    >>> doubtful.word, str(doubtful.reasons[0])
    ('look at it', 'only 80 % of the page were seen; the rest is blank')
    """
    found = [*_from_figures(seen), *_from_warnings(seen)]
    reasons = sorted(found, key=lambda one: not one[0])
    good, look, not_good = get_args(Word)
    word = not_good if any(spoils for spoils, _ in found) else look if found else good
    return Verdict(word, tuple(reason for _, reason in reasons))


def _from_figures(seen: Evidence) -> Iterator[tuple[bool, Diagnostic]]:
    """Reasons that the figures give, and whether each is more than a doubt."""
    if not seen.settled:
        yield True, Diagnostic("not-settled", seen.outcome[:1].lower() + seen.outcome[1:].rstrip("."))
    if seen.strain_rms > STRAINED:
        sentence = (
            f"lengths on the page are {100 * seen.strain_rms:.2g} % (rms) from those of the scanned surface; paper "
            f"gives less than {100 * STRAINED:g} %, so the scan shows more than one sheet, or no paper, or is rough"
        )
        yield seen.strain_rms > TORN, Diagnostic("strain-high", sentence)
    if seen.known_fraction is not None and seen.known_fraction < 1 - UNSEEN - seen.rim:
        sentence = f"only {100 * seen.known_fraction:.0f} % of the page were seen; the rest is blank"
        yield seen.known_fraction < MOSTLY_UNSEEN, Diagnostic("page-little-seen", sentence)
    if seen.expected_error_mm > UNSURE * seen.shorter_side_mm:
        sentence = f"points of the page are expected to be {seen.expected_error_mm:.1f} mm (rms) from their places"
        yield False, Diagnostic("error-large", sentence)


def _from_warnings(seen: Evidence) -> Iterator[tuple[bool, Diagnostic]]:
    """Warnings that are reasons, and whether each is more than a doubt."""
    shares = {"faces-overlap": seen.overlaps, "faces-flipped": seen.flipped}
    for warning in dict.fromkeys(seen.warnings):
        if warning.code in ASK_FOR_A_LOOK:
            yield shares.get(warning.code, 0.0) > SPOILED, warning
