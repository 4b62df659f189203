"""Laser lines on a photo, to a few hundredths of a pixel, with the print under them divided out.

A laser photo shows reflectance times (room light + laser light), the laser-off photo reflectance times room light.
Their quotient less 1 is laser light over room light: print, which drags the brightest place of a line towards the
paper beside a letter, is no longer in it.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planish.color import linear_light
from planish.geometry.guards import SINGULAR, TINY
from planish.parallel import thread_pool
from planish.types import Floats, Pixels

Direction = Literal["rows", "columns"]

WINDOW = 2
"""Pixels on either side over which a line's strength is averaged before its top is looked for."""

MIN_SIGMA = 6.0
"""So many standard deviations of the camera's noise a line must stand out; noise reaches 5 once in 3 million pixels."""

FLANK = 0.2
"""The fit to a line ends where it has fallen to this part of its top: below, room light and noise count for more."""

DIP = 0.5
"""Between two lines the light falls to less than this part of the fainter one."""

WIDEST = 40
"""Pixels on either side of its top that a line may have."""

CLIPPED = 0.98
"""Of the highest code value: there the sensor is full, and the pixel says nothing of the line's shape."""

ROUNDS = 3
"""Of the fit; the weights change by less than a hundredth in a fourth."""

FIT_SIGMA = 2.0
"""A pixel counts in the fit if its laser light is more than so many standard deviations of the noise."""

FLANK_WIDTHS = 1.5
"""So many of the line's widths from its middle there must be light as the fit has it, to either side."""

MIN_NOISE = 0.3
"""In code values: that of rounding alone."""

MIN_REFLECTANCE = 0.004
"""Of full light: the reflectance of deep black ink under weak light, below which dividing amplifies noise alone."""


class Stripes(NamedTuple):
    """Laser lines along the rows (or columns) of one photo.

    Attributes
    ----------
    at : (count, lines) float64 [px]
        Where each line crosses each row (column), in ascending order; NaN where not all lines were seen.
    sd : (count, lines) float64 [px]
        Standard deviation that the camera's noise gives `at`.
    width : (count, lines) float64 [px]
        Standard deviation of the line's Gaussian profile.
    clipped_share : float
        Of the pixels in the lines.
    """

    at: Floats
    sd: Floats
    width: Floats
    clipped_share: float


class LaserOffImage(NamedTuple):
    """What the laser-off photo says, ready for many laser photos of the same view.

    Attributes
    ----------
    light : (count, length) float32
        Linear light, lines along the second axis.
    reflectance : (count, length) float32
        What to divide by; the light itself, or ones to leave the print in.
    """

    light: NDArray[np.float32]
    reflectance: NDArray[np.float32]


def laser_channel(laser_on: Pixels, laser_off: Pixels) -> int:
    """Which of red, green and blue (0, 1, 2) the laser adds most to."""
    rows, cols = (slice(None, None, max(1, side // 1000)) for side in laser_on.shape[:2])
    gain = np.maximum(laser_on[rows, cols].astype(np.float32) - laser_off[rows, cols], 0)
    return int((gain**2).sum(axis=(0, 1)).argmax())


def laser_off_image(
    laser_off: Pixels, channel: int, along: Direction = "rows", *, divide: bool = True
) -> LaserOffImage:
    """Prepare a laser-off photo for `find_stripes`.

    Parameters
    ----------
    laser_off : (rows, cols, 3) uint8 or uint16
        sRGB.
    channel : int
    along : {"rows", "columns"}
        rows: look along each row, for lines that run down the photo. columns: along each column.
    divide : bool
        False leaves the print in the lines: only to measure what dividing is worth.
    """
    plane, table = _plane(laser_off, channel, along), linear_light(np.iinfo(laser_off.dtype).max + 1)
    light = np.empty(plane.shape, np.float32)
    for k in range(0, len(plane), 256):  # numpy makes 8 bytes of every index
        light[k : k + 256] = table[plane[k : k + 256]]
    return LaserOffImage(light, np.maximum(light, np.float32(MIN_REFLECTANCE)) if divide else np.ones_like(light))


def find_stripes(
    laser_on: Pixels,
    laser_off: LaserOffImage,
    channel: int,
    along: Direction = "rows",
    *,
    lines: int = 1,
    noise: float | None = None,
) -> Stripes:
    """Find laser lines in every row (or column) of a photo.

    With q = (lit - k off) / off, k the change of the room's light between the photos (the median of lit / off), a line
    is where q averaged over a few pixels, each counted by how sure it is, has one of its `lines` highest tops. There
    ln q = a + b x + c x^2, a Gaussian, is fitted with weights (model / noise)^2 in three rounds (Guo 2011, "A simple
    algorithm for fitting a Gaussian function"), clipped pixels left out; the line is at -b / 2c.

    Parameters
    ----------
    laser_on : (rows, cols, 3) uint8 or uint16
        sRGB.
    laser_off : Print
        From `laser_off_image`, of the same channel and direction.
    channel : int
    along : {"rows", "columns"}
    lines : int
        How many there are. Rows in which fewer are seen are left out: which line is missing cannot be told.
    noise : float, optional
        Standard deviation of lit - off where there is no laser, in code values. By default it is measured.

    Returns
    -------
    Stripes

    Examples
    --------
    >>> x = np.arange(60.0)
    >>> paper = np.where(x < 31, 0.6, 0.05)  # an edge of ink under the line
    >>> light = paper * np.stack([1 + 0 * x, 1 + np.exp(-((x - 30.3) ** 2) / 18)])
    >>> code = np.rint(65535 * (1.055 * (light / 1.2) ** (1 / 2.4) - 0.055)).astype(np.uint16)
    >>> laser_off, laser_on = (np.repeat(np.repeat(row[None, :, None], 9, 0), 3, 2) for row in code)
    >>> find_stripes(laser_on, laser_off_image(laser_off, 1), 1).at[:2, 0].round(2).tolist()
    [30.3, 30.3]
    """
    levels = np.iinfo(laser_on.dtype).max + 1
    light = linear_light(levels)
    slope = np.gradient(light)
    code = _plane(laser_on, channel, along)
    change, measured = _ambient_change_and_noise(
        light[code[_sample(code)]], laser_off.light[_sample(code)], slope[code[_sample(code)]]
    )
    noise = measured if noise is None else noise
    count = len(code)
    found = np.full((count, lines, 3), np.nan)
    counts = np.zeros((count, 2), np.int64)
    clipped = int(CLIPPED * (levels - 1))
    with thread_pool() as parallel_for:
        given = code, light, noise * slope, laser_off.light, laser_off.reflectance, change, clipped
        parallel_for(_find_in_rows, count, *given, found, counts, block=64)
    return Stripes(found[..., 0], found[..., 1], found[..., 2], float(counts[:, 1].sum() / max(counts[:, 0].sum(), 1)))


def _plane(photo: Pixels, channel: int, along: Direction) -> Pixels:
    """One channel, lines to be looked along in memory order."""
    plane = photo[..., channel]
    return np.ascontiguousarray(plane if along == "rows" else plane.T)  # type: ignore[return-value]


def _sample(lines: Pixels) -> slice:
    """About 200 lines of an image: enough for a median."""
    return slice(None, None, max(1, len(lines) // 200))


def _ambient_change_and_noise(
    laser_on: NDArray[np.float32], laser_off: NDArray[np.float32], slope: NDArray[np.float32]
) -> tuple[float, float]:
    """Change of the room's light between two photos, and the noise of their difference in code values.

    Most pixels have no laser on them, so medians measure the room.
    """
    paper = laser_off > np.median(laser_off)  # a dark table, or print, has no light to compare
    change = float(np.median(laser_on[paper] / laser_off[paper])) if paper.any() else 1.0
    deviation = np.abs(laser_on - np.float32(change) * laser_off) / slope
    return change, max(float(1.4826 * np.median(deviation)), MIN_NOISE)


@njit(cache=True, nogil=True)
def _find_in_rows(first, last, code, light, noise, laser_off, reflectance, change, clipped, found, counts):  # type: ignore[no-untyped-def]
    """Find the lines of rows first to last: place, its deviation, width."""
    n = code.shape[1]
    y, v, strength, score = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    peaks = np.empty((found.shape[1], 3), np.int64)
    fits = np.empty((found.shape[1], 3))
    for i in range(first, last):
        for x in range(n):
            y[x] = light[code[i, x]] - change * laser_off[i, x]
            v[x] = noise[code[i, x]] ** 2
        _line_amplitude(y, v, reflectance[i], strength, score)
        if not _highest_peaks(strength, score, peaks):
            continue
        for k in range(len(peaks)):
            _fit(peaks[k], y, v, reflectance[i], strength, code[i], clipped, fits[k], counts[i])
        for k in range(len(peaks)):
            found[i, k] = fits[k]


@njit(cache=True, nogil=True)
def _line_amplitude(y, v, d, strength, score):  # type: ignore[no-untyped-def]
    """Least squares of y = A d over a window: A, and A less SURE deviations of it."""
    n = len(y)
    above, below = 0.0, TINY
    for x in range(-WINDOW, n):
        if x + WINDOW < n:
            above += y[x + WINDOW] * d[x + WINDOW] / v[x + WINDOW]
            below += d[x + WINDOW] ** 2 / v[x + WINDOW]
        if x - WINDOW - 1 >= 0:
            above -= y[x - WINDOW - 1] * d[x - WINDOW - 1] / v[x - WINDOW - 1]
            below -= d[x - WINDOW - 1] ** 2 / v[x - WINDOW - 1]
        if x >= 0:
            strength[x] = above / below
            score[x] = strength[x] - MIN_SIGMA / np.sqrt(below)


@njit(cache=True, nogil=True)
def _highest_peaks(strength, score, peaks):  # type: ignore[no-untyped-def]
    """Find the highest tops, in ascending order: (top, begin, end) of each; False if there are fewer."""
    n = len(score)
    taken = np.zeros(n, np.bool_)
    k = 0
    while k < len(peaks):
        best = -1
        for x in range(n):
            if not taken[x] and score[x] > 0 and (best < 0 or score[x] > score[best]):
                best = x
        if best < 0:
            return False
        low, high = _flank_end(strength, best, -1), _flank_end(strength, best, 1)
        shoulder = _is_shoulder(strength, taken, best, -1) or _is_shoulder(strength, taken, best, 1)
        taken[low : high + 1] = True
        if not shoulder:
            peaks[k, 0], peaks[k, 1], peaks[k, 2] = best, low, high + 1
            k += 1
    for k in range(1, len(peaks)):  # a handful: insertion
        j = k
        while j > 0 and peaks[j - 1, 0] > peaks[j, 0]:
            for c in range(3):
                peaks[j - 1, c], peaks[j, c] = peaks[j, c], peaks[j - 1, c]
            j -= 1
    return True


@njit(cache=True, nogil=True)
def _is_shoulder(strength, taken, peak, step):  # type: ignore[no-untyped-def]
    """Whether there is no dip between a top and a line that was found already: then it is that line's flank."""
    x = peak
    while 0 <= x < len(strength) and strength[x] > DIP * strength[peak]:
        if taken[x]:
            return True
        x += step
    return False


@njit(cache=True, nogil=True)
def _flank_end(strength, peak, step):  # type: ignore[no-untyped-def]
    """Walk down from a top to where it has fallen to FLANK of itself, or another line begins."""
    x, least = peak, strength[peak]
    while 0 <= x + step < len(strength) and abs(x - peak) < WIDEST and strength[x] > FLANK * strength[peak]:
        if least < DIP * strength[peak] and strength[x + step] > 1.5 * least:
            break
        x += step
        least = min(least, strength[x])
    return x


@njit(cache=True, nogil=True)
def _fit(peak, y, v, d, strength, code, clipped, fit, counts):  # type: ignore[no-untyped-def]
    """Weighted parabola through ln(y / d): its top, the top's deviation, the Gaussian's width; else NaN."""
    fit[:] = np.nan
    a, b, c = 0.0, 0.0, 0.0
    for iteration in range(ROUNDS):
        m = np.zeros(5)  # sums of w u^k
        r = np.zeros(3)  # sums of w u^k z
        zz, count = 0.0, 0
        for x in range(peak[1], peak[2]):
            if iteration == 0:
                counts[0] += 1
                counts[1] += code[x] >= clipped
            if code[x] >= clipped or y[x] <= 0 or y[x] * y[x] < FIT_SIGMA * FIT_SIGMA * v[x]:
                continue
            u = float(x - peak[0])
            model = np.exp(min(a + (b + c * u) * u, 50.0)) if iteration else max(strength[x], 0.0)
            w = (d[x] * model) ** 2 / v[x]
            z = np.log(y[x] / d[x])
            power = w
            for k in range(5):
                m[k] += power
                if k < 3:
                    r[k] += power * z
                power *= u
            zz += w * z * z
            count += 1
        if count < 4:
            return
        # the inverse of [[m0 m1 m2] [m1 m2 m3] [m2 m3 m4]] by its cofactors
        p, q, s = m[2] * m[4] - m[3] ** 2, m[2] * m[3] - m[1] * m[4], m[1] * m[3] - m[2] ** 2
        t, e, g = m[0] * m[4] - m[2] ** 2, m[1] * m[2] - m[0] * m[3], m[0] * m[2] - m[1] ** 2
        det = m[0] * p + m[1] * q + m[2] * s
        if not det > SINGULAR * m[0] * m[2] * m[4]:
            return
        a, b, c = (
            (p * r[0] + q * r[1] + s * r[2]) / det,
            (q * r[0] + t * r[1] + e * r[2]) / det,
            (s * r[0] + e * r[1] + g * r[2]) / det,
        )
        if not c < 0:
            return
    u = -b / (2 * c)
    if not peak[1] - 1 <= peak[0] + u <= peak[2] or not _has_both_flanks(peak, u, a, b, c, y, v, d, code, clipped):
        return
    chi_square = max((zz - a * r[0] - b * r[1] - c * r[2]) / (count - 3), 1.0) if count > 3 else 1.0
    by_b, by_c = -1 / (2 * c), b / (2 * c * c)
    variance = chi_square * (by_b * by_b * t + 2 * by_b * by_c * e + by_c * by_c * g) / det
    fit[0], fit[1], fit[2] = peak[0] + u, np.sqrt(max(variance, 0.0)), np.sqrt(-1 / (2 * c))


@njit(cache=True, nogil=True)
def _has_both_flanks(peak, u, a, b, c, y, v, d, code, clipped):  # type: ignore[no-untyped-def]
    """Whether light is there on both sides of a line's middle; at the sheet's edge one falls into the dark."""
    reach = FLANK_WIDTHS * np.sqrt(-1 / (2 * c))
    for side in (-1, 1):
        measured_light, expected, variance = 0.0, 0.0, 0.0
        for x in range(max(int(peak[0] + u - reach), 0), min(int(peak[0] + u + reach) + 2, len(y))):
            at = x - peak[0] - u
            if 0 < side * at <= reach and code[x] < clipped:
                measured_light += y[x]
                expected += d[x] * np.exp(min(a + (b + c * (x - peak[0])) * (x - peak[0]), 50.0))
                variance += v[x]
        if measured_light < expected / 2 - 3 * np.sqrt(variance):
            return False
    return True
