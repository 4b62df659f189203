"""How a scan is to be smoothed, from how much noise it has and whether neighbours share it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from planish.geometry.guards import TINY
from planish.parallel import ParallelFor
from planish.surface.local_quadrics import SAME_SIDE, SAME_SIDE_OF_STEEP
from planish.surface.noise import FROM_MEAN, FROM_MEDIAN, local_sigma
from planish.surface.noise_scale import NoiseScale, noise_scale
from planish.surface.normals import NOISE, median_edge, sample
from planish.surface.smooth_surface import MeasuredScan
from planish.types import Floats

BUCKLED = 0.003
"""Noise, in spacings, from which on there is something to smooth. Clean scans read 0 to 0.002 (4,000 to 300,000
points, regular and random meshes); 0.03 mm of noise alike over 3 pixels reads 0.003 and makes the sheet 0.01 % too
large, white noise of this size 0.001 %."""

BENT, MOSTLY_NOISE = 3.4, 0.5
"""The buckling must also make up for enough of what normals of neighbours differ by: for the more, the more they
do. Its square over theirs is 0.9 to 2.8 for white noise, 0.2 to 0.4 if alike over one pixel, 0.09 to 0.2 over three;
up to 0.07 on clean random meshes, 0.09 to 0.16 on real ones with 2 to 3 degrees between points (handheld_sheet), which
smoothing harms. The limit is BENT times the difference in radians, at most MOSTLY_NOISE."""

ROUNDS_PER_NOISE, FEWEST, MOST = 60, 6, 24
"""Rounds of smoothing for noise of one spacing: 6 at 0.05 mm, 8 at 0.07, 24 at 0.2, 0.5 mm between points. Half as many
again make normals a tenth better and lengths no better."""

NOISIEST = 0.9
"""The rounds are right for all but this part of a sheet whose noise varies."""

LEAST_NOISE = 0.1
"""Of the variance of the typical noise: below, true bends are what normals differ by."""

NOISY_SLACK, CLEAN_SLACK = 1e-3, 5e-5
"""What the sheet may buckle more than it does raw, mean angle defect [rad], by lengths that are smoothed or not."""

SHARED, SHARED_WIDELY = 0.45, 0.7
"""Correlation of neighbours from which noise counts as shared: white noise reads -0.1 to 0.05, printed sheets under
structured light 0.4 (david: smoothing them more does harm), 1 point 0.6, ripple of 7 points 0.75. Up to SHARED_WIDELY
noise that the angles show as well is smoothed as white noise is, whose creases stay sharper: with 1 point and 0.07 mm
the crumpled sheet is 0.035 mm out, smoothed as shared noise 0.073."""

STRONG = 0.25
"""Shared noise of more than this part of an edge is first taken out by quadrics: normals do not tell its creases. A
flat board with 0.36 edges of noise is 37.4 x 38.9 mm without them, 36.3 x 36.5 with them and in truth (36.4)."""

FOLDED = 10.0
"""Strong shared noise is none where squared differences of normals are, in the mean, so many times their median: there
facets lie between folds. Real ripple and noise read 1.2 to 3, a board with sharp waves 7, ripple over folds 3.5,
crumpled paper 14 and more; where its facets are but three points wide (A4 in 4,000 points) it reads 5, and passes."""

ROUGH = 0.4
"""White noise, in edges, from which points are moved onto the surface: a plane in steps of 1.5 edges is 39.5 mm wide
without that, 39.2 with it, 38.9 in truth. At 0.3 edges it rounds creases (letter: 0.053 mm out, not 0.027)."""

STEEP = 0.17
"""Typical difference of the normals of neighbours [rad] from which quadrics come first, too; ripple that smoothing
copes with reads 0.05 to 0.1, real walls under Gray code 0.26."""

SHARED_REACH, SHARED_REACH_AT_MOST = 2.0, 0.2
"""Normals of neighbours count although they differ by this many times what they do around [rad], in every round: ripple
makes them differ less and less while it is smoothed, and would be left half done where the sheet is bent."""


class Plan(NamedTuple):
    """How a scan is to be smoothed.

    Attributes
    ----------
    rounds : int
    reach : float
        Least squared difference of normals up to which neighbours count.
    slack : float [rad]
        By how much the sheet may buckle more than it does raw.
    move : bool
        Whether points are moved onto the surface; else only what is white is taken out of them, along known rays.
    same_side : float
        Where points are first moved onto quadrics: least cosine between the normals of neighbours; else 0.
    """

    rounds: int
    reach: float
    slack: float
    move: bool = False
    same_side: float = 0.0


CLEAN = Plan(0, 0.0, CLEAN_SLACK)


def plan_smoothing(scan: MeasuredScan, buckling: float, parallel_for: ParallelFor) -> Plan:
    """Tell white noise, shared noise and none, and note in the scan's rows where there is more and less of it."""
    step = median_edge(scan.rows, scan.edges)
    scale = noise_scale(scan.points, scan.rows, scan.ring, scan.spacing, BUCKLED * scan.spacing, parallel_for)
    noisy = _is_noisy(buckling, step)
    strong = scale.height > STRONG * scan.spacing
    if strong and scale.alike > SHARED and _mean_step(scan) > FOLDED * step:
        scale = NoiseScale(0.0, 0.0)
    elif scale.alike > SHARED and (not noisy or scale.alike > SHARED_WIDELY or strong):
        return plan_for_shared(scan, parallel_for, strong=strong)
    if not scale.height and not noisy:
        return CLEAN
    least = scale.height / FROM_MEDIAN
    noise = FROM_MEAN * local_sigma(scan.points, scan.ring_noise, scan.spacing, parallel_for, least)
    scan.rows[:, NOISE] = np.maximum((noise / max(float(np.median(noise)), TINY)) ** 2, LEAST_NOISE)
    rounds = int(np.clip(ROUNDS_PER_NOISE * np.quantile(noise, NOISIEST) / scan.spacing, FEWEST, MOST))
    return Plan(rounds, 0.0, NOISY_SLACK, move=scale.height > ROUGH * scan.spacing)


def plan_for_shared(scan: MeasuredScan, parallel_for: ParallelFor, *, strong: bool = False) -> Plan:
    """Noise that neighbours share makes their normals differ less than it should; so reach does not follow them."""
    a, b = scan.edges[:, 0], scan.edges[:, 1]
    step = scan.rows[a, :3] - scan.rows[b, :3]
    size = np.sqrt(np.einsum("ij,ij->i", step, step).astype(np.float64))
    count = len(scan.points)
    sums = np.bincount(a, size, count) + np.bincount(b, size, count)
    mean: Floats = sums / np.maximum(np.diff(scan.ring.start), 1)
    typical_size = float(np.median(mean))
    local = local_sigma(scan.points, mean, scan.spacing, parallel_for)
    scan.rows[:, NOISE] = np.clip((local / max(typical_size, 1e-9)) ** 2, LEAST_NOISE, 1 / LEAST_NOISE)
    reach = min(SHARED_REACH * typical_size, SHARED_REACH_AT_MOST) ** 2
    same_side = SAME_SIDE_OF_STEEP if typical_size > STEEP else SAME_SIDE if strong else 0.0
    return Plan(MOST, reach, math.inf, move=True, same_side=same_side)


def _mean_step(scan: MeasuredScan) -> float:
    """Mean squared difference of the normals of neighbours, over a sample."""
    some = scan.edges[sample(len(scan.edges))]
    step = scan.rows[some[:, 0], :3] - scan.rows[some[:, 1], :3]
    return float(np.einsum("ij,ij->i", step, step).mean())


def _is_noisy(buckling: float, step: float) -> bool:
    """Tell noise from bends, by how much the sheet buckles and the squared difference of normals of neighbours."""
    return buckling > BUCKLED and buckling**2 > min(BENT * math.sqrt(step), MOSTLY_NOISE) * step
