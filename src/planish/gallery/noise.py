"""The errors of range scanners: white, correlated, rippled, rounded to steps, with spikes; alike or varying."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, spatial

from planish.types import Floats, Ints

Noise = float | tuple[float, float]
"""Standard deviation [mm]: one for the whole sheet, or at its top left and bottom right corners, linear between."""

LONGEST_EDGE = 4.0
"""Triangles with an edge of more typical edges span a hole or a bay of the sheet, and are left out."""


@dataclass(frozen=True)
class NoiseSpec:
    """What goes wrong in a scan; all that is given adds up.

    Attributes
    ----------
    white_mm : float or (float, float)
        Standard deviation of errors that every point has for itself; two numbers: from the top left to the bottom
        right corner of the sheet.
    correlated_mm : float or (float, float)
        Standard deviation of errors that neighbours share,
    correlation_px : float
        over so many points: white noise blurred by a Gaussian of this standard deviation.
    ripple_mm : float
        Height of a sine wave, as a projector's columns leave it,
    ripple_px : float
        so many points long,
    ripple_deg : float
        in this direction (0 is along the rows).
    step_mm : float
        Depths are rounded to whole multiples of this; 0 leaves them.
    spikes : float
        Share of the points that are off by `spike_mm`, in either direction.
    spike_mm : (float, float)
        Least and greatest size of a spike.
    keep : float
        Share of the points that are left after the mesh was thinned out, at random, and joined anew.
    """

    white_mm: Noise = 0.0
    correlated_mm: Noise = 0.0
    correlation_px: float = 3.0
    ripple_mm: float = 0.0
    ripple_px: float = 7.0
    ripple_deg: float = 6.0
    step_mm: float = 0.0
    spikes: float = 0.0
    spike_mm: tuple[float, float] = (1.0, 6.0)
    keep: float = 1.0


def noise_spec(noise: NoiseSpec | None, noise_mm: Noise, correlation_px: float) -> NoiseSpec:
    """Spec that the short forms stand for: white noise, or correlated noise where a length is given."""
    if noise is not None:
        return noise
    if correlation_px > 0:
        return NoiseSpec(correlated_mm=noise_mm, correlation_px=correlation_px)
    return NoiseSpec(white_mm=noise_mm)


def noise_at(
    lattice_rc: NDArray[np.int64], place: Floats, noise: NoiseSpec, rng: np.random.Generator, axes: int = 1
) -> Floats:
    """Draw the errors of the points of a scan, but for the rounding to steps.

    Parameters
    ----------
    lattice_rc : (n, 2) int
        Row and column of every point in the range image.
    place : (n, 2) float64
        On the sheet, 0 to 1 both ways from its top left corner.
    noise : NoiseSpec
    rng : numpy.random.Generator
    axes : int
        Independent errors for every point.

    Returns
    -------
    (n, axes) float64 [mm]

    Examples
    --------
    >>> rc = np.argwhere(np.ones((200, 200)))
    >>> errors = noise_at(rc, rc / 199, NoiseSpec(correlated_mm=(0.1, 0.3)), np.random.default_rng(0))
    >>> float(errors.std().round(2))
    0.2
    """
    error = np.zeros((len(place), axes))
    if not len(place):  # holes and cuts may leave nothing of a sheet
        return error
    if noise.white_mm not in (0, (0, 0)):
        error += rng.standard_normal(error.shape) * _at(noise.white_mm, place)
    if noise.correlated_mm not in (0, (0, 0)):
        low = lattice_rc.min(axis=0)
        shape = lattice_rc.max(axis=0) - low + 1
        fields = [_correlated(shape, noise.correlation_px, rng)[tuple((lattice_rc - low).T)] for _ in range(axes)]
        error += np.stack(fields, axis=1) * _at(noise.correlated_mm, place)
    if noise.ripple_mm:
        across = np.radians(noise.ripple_deg)
        phase = 2 * np.pi / noise.ripple_px * (lattice_rc @ [np.sin(across), np.cos(across)])
        error += noise.ripple_mm * np.sin(phase[:, None] + rng.uniform(0, 2 * np.pi, axes))
    if noise.spikes:
        size = rng.uniform(*noise.spike_mm, error.shape) * rng.choice([-1.0, 1.0], error.shape)
        error += np.where(rng.random(len(place)) < noise.spikes, size.T, 0.0).T
    return error


def rounded(depth: Floats, step_mm: float) -> Floats:
    """Depths as whole multiples of a step, or as they are where it is 0."""
    return np.rint(depth / step_mm) * step_mm if step_mm else depth


def thinned(page_xy: Floats, keep: float, rng: np.random.Generator) -> tuple[NDArray[np.int64], Ints]:
    """A random part of the points of a sheet, joined anew on the flat page.

    Returns
    -------
    used : (k,) int64
        Rows of the points that are left, ascending.
    faces : (m, 3) int32
        Of those points.
    """
    used = np.sort(rng.choice(len(page_xy), max(3, round(keep * len(page_xy))), replace=False))
    at = page_xy[used]
    faces = spatial.Delaunay(at).simplices.astype(np.int32)
    u, v = at[faces[:, 1]] - at[faces[:, 0]], at[faces[:, 2]] - at[faces[:, 0]]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    faces = np.where((area < 0)[:, None], faces, faces[:, ::-1])  # y is down: counter-clockwise has area < 0
    longest = np.linalg.norm(at[faces] - at[np.roll(faces, 1, axis=1)], axis=2).max(axis=1)
    return used, faces[(longest < LONGEST_EDGE * np.median(longest)) & (np.abs(area) > 1e-9)]


def _at(noise_mm: Noise, place: Floats) -> Floats:
    first, last = noise_mm if isinstance(noise_mm, tuple) else (noise_mm, noise_mm)
    return np.asarray(first + (last - first) * place.mean(axis=1))[:, None]


def _correlated(shape: NDArray[np.int64], correlation_px: float, rng: np.random.Generator) -> Floats:
    """White noise blurred and brought back to a standard deviation of 1."""
    field: Floats = ndimage.gaussian_filter(rng.standard_normal(shape), correlation_px, mode="wrap")
    return field / field.std()
