"""Detect laser lines to a few hundredths of a pixel, with the reflectance of the print divided out.

The laser-on photo shows reflectance x (ambient + laser light), the laser-off photo reflectance x ambient light. Their
quotient minus 1 is laser over ambient light, free of the print, which would bias the peak of a line towards bright
paper beside a letter.
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
"""Half width of the averaging window for peak detection [px]."""

MIN_SIGMA = 6.0
"""Least peak height in standard deviations of the noise; noise reaches 5 once in 3 million pixels."""

FLANK = 0.2
"""The fit extends to where a line has fallen to this share of its peak; below, ambient light and noise dominate."""

DIP = 0.5
"""Between two lines light falls below this share of the fainter peak."""

WIDEST = 40
"""Largest half width of a line [px]."""

CLIPPED = 0.98
"""Share of the highest code value from which pixels are saturated and ignored in the fit."""

ROUNDS = 3
"""Iterations of the fit; a fourth would change weights by less than 1 %."""

FIT_SIGMA = 2.0
"""Least laser light of a pixel in the fit, in standard deviations of the noise."""

FLANK_WIDTHS = 1.5
"""Both flanks must carry the fitted light up to so many widths from the centre."""

MIN_NOISE = 0.3
"""Least noise [code values]: that of rounding."""

MIN_REFLECTANCE = 0.004
"""Least divisor, relative to full light: dark ink under weak light; dividing by less only amplifies noise."""


class Stripes(NamedTuple):
    """Laser lines along the rows (or columns) of one photo.

    Attributes
    ----------
    at : (count, lines) float64 [px]
        Crossings of the lines with each row (column), ascending; NaN unless all lines were detected.
    sd : (count, lines) float64 [px]
        Standard deviation of `at` from the camera's noise.
    width : (count, lines) float64 [px]
        Standard deviation of the line's Gaussian profile.
    clipped_share : float
        Share of saturated pixels in the lines.
    """

    at: Floats
    sd: Floats
    width: Floats
    clipped_share: float


class LaserOffImage(NamedTuple):
    """A prepared laser-off photo, for many laser-on photos of the same view.

    Attributes
    ----------
    light : (count, length) float32
        Linear light, lines along the second axis.
    reflectance : (count, length) float32
        Divisor; the light itself, or ones to keep the print.
    """

    light: NDArray[np.float32]
    reflectance: NDArray[np.float32]


def laser_channel(laser_on: Pixels, laser_off: Pixels) -> int:
    """Channel (0, 1, 2: red, green, blue) to which the laser adds most light."""
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
        rows: search along each row, for vertical lines. columns: along each column, for horizontal ones.
    divide : bool
        False keeps the print, to measure the effect of the division.
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
    """Detect laser lines in every row (or column) of a photo.

    With q = (on - k off) / off, k the change of ambient light between the photos (median of on / off), lines are the
    `lines` highest peaks of q, averaged over a few pixels with inverse-variance weights. A Gaussian, ln q = a + b x +
    c x^2, is fitted to each with weights (model / noise)^2 in three iterations (Guo 2011, "A simple algorithm for
    fitting a Gaussian function"), without saturated pixels; the line is at -b / 2c.

    Parameters
    ----------
    laser_on : (rows, cols, 3) uint8 or uint16
        sRGB.
    laser_off : Print
        From `laser_off_image`, for the same channel and direction.
    channel : int
    along : {"rows", "columns"}
    lines : int
        Number of lines. Rows with fewer are dropped, since the missing one is unknown.
    noise : float, optional
        Standard deviation of on - off without laser [code values]; measured by default.

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
    """One channel, search direction contiguous in memory."""
    plane = photo[..., channel]
    return np.ascontiguousarray(plane if along == "rows" else plane.T)  # type: ignore[return-value]


def _sample(lines: Pixels) -> slice:
    """About 200 lines of an image, enough for a median."""
    return slice(None, None, max(1, len(lines) // 200))


def _ambient_change_and_noise(
    laser_on: NDArray[np.float32], laser_off: NDArray[np.float32], slope: NDArray[np.float32]
) -> tuple[float, float]:
    """Ratio of ambient light between two photos, and noise of their difference [code values].

    Medians: most pixels have no laser light.
    """
    paper = laser_off > np.median(laser_off)  # dark background and print carry too little light
    change = float(np.median(laser_on[paper] / laser_off[paper])) if paper.any() else 1.0
    deviation = np.abs(laser_on - np.float32(change) * laser_off) / slope
    return change, max(float(1.4826 * np.median(deviation)), MIN_NOISE)


@njit(cache=True, nogil=True)
def _find_in_rows(first, last, code, light, noise, laser_off, reflectance, change, clipped, found, counts):  # type: ignore[no-untyped-def]
    """Fit the lines in rows first to last: position, standard deviation, width."""
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
    """Least squares of y = A d over a window: A, and A minus MIN_SIGMA standard deviations."""
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
    """Find the highest peaks, ascending by position: (peak, begin, end) of each; False if there are fewer."""
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
    for k in range(1, len(peaks)):  # insertion sort of a few
        j = k
        while j > 0 and peaks[j - 1, 0] > peaks[j, 0]:
            for c in range(3):
                peaks[j - 1, c], peaks[j, c] = peaks[j, c], peaks[j - 1, c]
            j -= 1
    return True


@njit(cache=True, nogil=True)
def _is_shoulder(strength, taken, peak, step):  # type: ignore[no-untyped-def]
    """Whether a peak is the flank of an already found line: no dip between them."""
    x = peak
    while 0 <= x < len(strength) and strength[x] > DIP * strength[peak]:
        if taken[x]:
            return True
        x += step
    return False


@njit(cache=True, nogil=True)
def _flank_end(strength, peak, step):  # type: ignore[no-untyped-def]
    """Descend from a peak to FLANK of its height, or to the beginning of another line."""
    x, least = peak, strength[peak]
    while 0 <= x + step < len(strength) and abs(x - peak) < WIDEST and strength[x] > FLANK * strength[peak]:
        if least < DIP * strength[peak] and strength[x + step] > 1.5 * least:
            break
        x += step
        least = min(least, strength[x])
    return x


@njit(cache=True, nogil=True)
def _fit(peak, y, v, d, strength, code, clipped, fit, counts):  # type: ignore[no-untyped-def]
    """Weighted parabola fit of ln(y / d): vertex, its standard deviation, width of the Gaussian; NaN if it fails."""
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
    """Whether both flanks of a line carry light; at the edge of the sheet one does not."""
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
