"""Confidence of a shape from one photo: figures, warnings and a summary sentence."""

from __future__ import annotations

import numpy as np

from planish.photo.fitted_sheet import FittedSheet, extrapolated_share, rms
from planish.photo.lines import TextLines
from planish.types import Bools, Diagnostic, PhotoReport

FOLDED = 0.25
"""Crease length, in shorter sides of the page, from which a sheet counts as folded or crumpled: half of what is visible
of the faintest fold; sharp shadows on curled sheets give 0 to 0.2."""
MAX_LINE_RESIDUAL = 0.12
"""Residual of letters [letter heights] from which the same is reported: curled book pages have 0.03 to 0.07."""
MAX_SIDE_RESIDUAL = 0.005
"""Residual of the sheet's sides, relative to the longer one, from which the sheet counts as bent in more than one
direction: the height of a line of text on A4."""
MAX_WARPED_RESIDUAL = 0.15
"""Residual of letters after the warp [letter heights] from which lines look crooked."""
MAX_EXTRAPOLATED = 0.25
"""Extrapolated share of the page from which a warning is given."""
LEAST_KEPT = 0.97
"""Share of the sheet's region on the page below which a warning is given: its rim alone is 1 to 2 %."""


def photo_report(
    sheet: FittedSheet, lines: TextLines | None, creases: float, scale: str, focal_from: str, kept: float | None = None
) -> tuple[PhotoReport, tuple[Diagnostic, ...]]:
    """Build the report and the warnings of a fitted sheet.

    Parameters
    ----------
    sheet : FittedSheet
    lines : TextLines or None
    creases : float
        See `crease_length`.
    scale, focal_from : str
        See `PhotoReport`.
    kept : float, optional
        Share of the sheet's region that the page shows.
    """
    height = lines.letter_height if lines is not None else None
    text = _is_letter(sheet, lines)
    before = _relative_rms(sheet, text, height, sheet.cylinder_fit.residual_px)
    after = _relative_rms(sheet, text, height, sheet.warped_residual_px)
    slack = 2 * height / sheet.cylinder.focal if height else 0.02 * float((sheet.warp.high - sheet.warp.low).max())
    extrapolated = extrapolated_share(sheet, slack)
    sides = _side_residual(sheet)
    warnings = _warnings(before, after, sides, extrapolated, creases, scale)
    if kept is not None and kept < LEAST_KEPT:
        warnings += (_cut_off(kept),)
    borders = sheet.observations.sides is not None and sheet.shade is None
    seen = {"text-lines": lines is not None, "borders": borders, "shading": sheet.shade}
    shape = " and ".join(what for what, there in seen.items() if there)
    report = PhotoReport(
        shape=shape,
        scale=scale,
        focal_px=float(sheet.cylinder.focal),
        focal_from=focal_from,
        lines=0 if lines is None else len(lines.height),
        letters=0 if lines is None else len(lines.line),
        straightness=after,
        bent_one_way=before,
        extrapolated_share=extrapolated,
        creases=creases,
        kept_share=kept,
        confidence=_confidence(after, sides, sheet.shade, extrapolated, creases),
    )
    return report, warnings


def _is_letter(sheet: FittedSheet, lines: TextLines | None) -> Bools:
    """Which observed positions are letters."""
    letters = np.arange(len(sheet.observations.photo_xy)) < (0 if lines is None else len(lines.line))
    return np.asarray(letters)


def _relative_rms(sheet: FittedSheet, text: Bools, height: float | None, residual_px: np.ndarray) -> float | None:
    return None if height is None else rms(residual_px[text], np.maximum(sheet.cylinder_fit.weight[text], 0.1)) / height


def _side_residual(sheet: FittedSheet) -> float | None:
    """Rms residual of the sheet's sides before the warp, relative to the longer one."""
    if sheet.observations.sides is None:
        return None
    side = np.isin(sheet.observations.group, sheet.observations.sides)
    longer = float((sheet.warp.high - sheet.warp.low).max()) * sheet.cylinder.focal
    return float(np.sqrt(np.mean(sheet.cylinder_fit.residual_px[side] ** 2))) / longer


def _cut_off(kept: float) -> Diagnostic:
    sentence = f"the page shows {100 * kept:.0f} % of what looks like the sheet on the photo; the rest was cut off"
    return Diagnostic("page-incomplete", sentence, "compare it with the photo")


def _warnings(
    before: float | None, after: float | None, sides: float | None, extrapolated: float, creases: float, scale: str
) -> tuple[Diagnostic, ...]:
    warnings = []
    if scale == "unknown":
        warnings.append(
            Diagnostic(
                "size-unknown",
                "one photo does not tell how large the sheet is: all millimetres are guesses",
                "give {paper} or {width_mm}",
            )
        )
    cannot = "one photo cannot show such a shape, so positions between its lines and sides are rough"
    scan = "make a 3D scan"
    if creases > FOLDED:
        warnings.append(
            Diagnostic(
                "sheet-folded",
                f"the sheet is folded or crumpled: its paper shows creases {creases:.1f} times as long as its shorter "
                f"side (edges of a large grey picture look the same); {cannot}",
                scan,
            )
        )
    elif (before or 0) > MAX_LINE_RESIDUAL:
        sentence = f"the sheet is folded or crumpled, or its lines are not straight in print; {cannot}"
        warnings.append(Diagnostic("sheet-folded", sentence, scan))
    elif sides is not None and sides > MAX_SIDE_RESIDUAL:
        warnings.append(
            Diagnostic(
                "sides-bent",
                f"the sheet is bent in more than one direction: its sides fit no other sheet better than to "
                f"{100 * sides:.1f} % of its length; {cannot}",
                scan,
            )
        )
    if (after or 0) > MAX_WARPED_RESIDUAL:
        sentence = f"text lines remain crooked on the page, by {after:.2f} letter heights (rms)"
        warnings.append(Diagnostic("lines-crooked", sentence))
    if extrapolated > MAX_EXTRAPOLATED:
        warnings.append(
            Diagnostic(
                "page-extrapolated",
                f"{100 * extrapolated:.0f} % of the page lies beyond the text and borders used, and was extrapolated",
            )
        )
    return tuple(warnings)


def _confidence(
    after: float | None, sides: float | None, shade: float | None, extrapolated: float, creases: float
) -> str:
    parts = []
    if after is not None:
        parts.append(f"text lines are expected to be straight to {after:.2f} letter heights (rms)")
    if sides is not None:
        parts.append(f"the sheet's sides fit a sheet bent in one direction to {100 * sides:.1f} % of its length")
    if shade is not None:
        parts.append(f"the blank paper's brightness fits that of such a sheet to {100 * shade:.1f} %")
    parts.append(f"creases {'are' if creases > FOLDED else 'are not'} seen in its paper")
    parts.append(f"{100 * extrapolated:.0f} % of the page were extrapolated")
    sentence = "; ".join(parts)
    return sentence[0].upper() + sentence[1:] + "."
