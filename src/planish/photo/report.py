"""How far a shape that was found from one photo can be trusted, in numbers and in words."""

from __future__ import annotations

import numpy as np

from planish.photo.bent import Bent, extrapolated_share, rms
from planish.photo.lines import TextLines
from planish.types import Bools, Diagnostic, PhotoReport

FOLDED = 0.25
"""Creases, in lengths of the page's shorter side, from which on a sheet is folded or crumpled: half of what an eye sees
of the faintest fold; sharp shadows on curled sheets have 0 to 0.2."""
NOT_BENT_ONE_WAY = 0.12
"""Misfit of letters [heights] from which on the same is said: curled pages of books have 0.03 to 0.07."""
SIDES_OFF = 0.005
"""Misfit of a sheet's sides, in parts of its longer side, from which on it is bent in more than one direction: the
breadth of a line of text on A4."""
LEFT_OVER = 0.15
"""What is left after the free shift, from which on lines are seen to be crooked."""
MUCH = 0.25
"""Of the page extrapolated, from which on a warning is due."""


def account_of(
    bent: Bent, lines: TextLines | None, creases: float, scale: str, focal_from: str
) -> tuple[PhotoReport, tuple[Diagnostic, ...]]:
    """Report and warnings of a sheet.

    Parameters
    ----------
    bent : Bent
    lines : TextLines or None
    creases : float
        See `crease_length`.
    scale, focal_from : str
        See `PhotoReport`.
    """
    height = float(np.median(lines.height)) if lines is not None else None
    text = _of_text(bent, lines)
    before = _off(bent, text, height, bent.fitted.off_px)
    after = _off(bent, text, height, bent.left_px)
    slack = 2 * height / bent.sheet.focal if height else 0.02 * float((bent.shift.high - bent.shift.low).max())
    beyond = extrapolated_share(bent, slack)
    sides = _sides_off(bent)
    warnings = _warnings(before, after, sides, beyond, creases, scale)
    seen = {"text-lines": lines is not None, "borders": bent.bordered and bent.shade is None, "shading": bent.shade}
    shape = " and ".join(what for what, there in seen.items() if there)
    report = PhotoReport(
        shape=shape,
        scale=scale,
        focal_px=float(bent.sheet.focal),
        focal_from=focal_from,
        lines=0 if lines is None else len(lines.height),
        letters=0 if lines is None else len(lines.line),
        straightness=after,
        bent_one_way=before,
        extrapolated_share=beyond,
        creases=creases,
        confidence=_confidence(after, sides, bent.shade, beyond, creases),
    )
    return report, warnings


def _of_text(bent: Bent, lines: TextLines | None) -> Bools:
    """Which places of the evidence are letters."""
    letters = np.arange(len(bent.evidence.photo_xy)) < (0 if lines is None else len(lines.line))
    return np.asarray(letters)


def _off(bent: Bent, text: Bools, height: float | None, off_px: np.ndarray) -> float | None:
    return None if height is None else rms(off_px[text], np.maximum(bent.fitted.weight[text], 0.1)) / height


def _sides_off(bent: Bent) -> float | None:
    """Rms misfit of the sheet's sides, in parts of the longer one, before the shift."""
    if bent.evidence.sides is None:
        return None
    side = np.isin(bent.evidence.group, bent.evidence.sides)
    longer = float((bent.shift.high - bent.shift.low).max()) * bent.sheet.focal
    return float(np.sqrt(np.mean(bent.fitted.off_px[side] ** 2))) / longer


def _warnings(
    before: float | None, after: float | None, sides: float | None, beyond: float, creases: float, scale: str
) -> tuple[Diagnostic, ...]:
    found = []
    if scale == "unknown":
        found.append(
            Diagnostic(
                "size-unknown",
                "one photo does not tell how large the sheet is: all millimetres are guesses",
                "give {paper} or {width_mm}",
            )
        )
    cannot = "one photo cannot tell such a shape, so places between its lines and sides are rough"
    scan = "make a 3D scan"
    if creases > FOLDED:
        found.append(
            Diagnostic(
                "sheet-folded",
                f"the sheet is folded or crumpled: its paper shows creases {creases:.1f} times as long as its shorter "
                f"side (edges of a large grey picture look the same); {cannot}",
                scan,
            )
        )
    elif (before or 0) > NOT_BENT_ONE_WAY:
        sentence = f"the sheet is folded or crumpled, or its lines are not straight in print; {cannot}"
        found.append(Diagnostic("sheet-folded", sentence, scan))
    elif sides is not None and sides > SIDES_OFF:
        found.append(
            Diagnostic(
                "sides-bent",
                f"the sheet is bent in more than one direction: its sides fit no other sheet better than to "
                f"{100 * sides:.1f} % of its length; {cannot}",
                scan,
            )
        )
    if (after or 0) > LEFT_OVER:
        sentence = f"lines of text stay crooked on the page, by {after:.2f} of their letters' height (rms)"
        found.append(Diagnostic("lines-crooked", sentence))
    if beyond > MUCH:
        found.append(
            Diagnostic(
                "page-extrapolated",
                f"{100 * beyond:.0f} % of the page lie beyond all that the shape was found from, and were extrapolated",
            )
        )
    return tuple(found)


def _confidence(after: float | None, sides: float | None, shade: float | None, beyond: float, creases: float) -> str:
    parts = []
    if after is not None:
        parts.append(f"lines of text are expected straight to {after:.2f} of their letters' height (rms)")
    if sides is not None:
        parts.append(f"the sheet's sides fit a sheet bent in one direction to {100 * sides:.1f} % of its length")
    if shade is not None:
        parts.append(f"the blank paper's brightness fits that of such a sheet to {100 * shade:.1f} %")
    parts.append(f"creases {'are' if creases > FOLDED else 'are not'} seen in its paper")
    parts.append(f"{100 * beyond:.0f} % of the page were extrapolated")
    sentence = "; ".join(parts)
    return sentence[0].upper() + sentence[1:] + "."
