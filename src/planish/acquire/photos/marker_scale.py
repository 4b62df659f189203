"""The size of things from photos of printed markers: millimetres per unit of the cameras' world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize
from scipy.spatial.transform import Rotation

from planish.acquire.photos.markers import Markers, corners_of
from planish.errors import InputError
from planish.geometry import camera_position
from planish.types import Camera, Floats

SAME_PX = 3.0
"""A detection whose corners are farther than this from where two other photos put them shows another marker, or one
that was moved. Cameras found from the photos are good to 0.2 px."""

LEAST_PARALLAX_DEG = 2.0
"""Between photos that place a marker. From one place, with the phone turned only, nothing has a depth; with two degrees
a twentieth of a pixel is a per mille of it."""

SAME_PLACE = 0.01
"""Photos nearer to each other than this, relative to the two farthest apart, do not place a marker: one that moved
between them would seem to have a parallax."""

REFUSED_SIGMA = 4.0
LEAST_REFUSED_PX = 0.5
"""Corners farther off than both, a multiple of the robust standard deviation and so many pixels, are left out."""

LEAST_SIGMA_PX = 0.03
"""Of a corner: what sides of 150 to 300 pixels leave in photos of the gallery."""

SAME_SIZE = 0.03
"""Markers whose sides differ by more than this from the median are not of the stated side: other prints, or letters
that look like a marker. Printers are off by 1 %."""

LEAST_ERROR = 2e-4
"""Of the size, however well photos agree: a hundredth of a millimetre in 40 is what cards and cameras leave."""


@dataclass(frozen=True)
class ScaleEstimate:
    """Size of the cameras' world.

    Attributes
    ----------
    factor : float
        Millimetres per unit.
    relative_error : float
        Standard error of the factor, relative to it: from leaving out each photo in turn, and from what several
        markers say. What the printer did to the marker's side is not in it.
    markers : tuple of int
        Numbers of the markers that were used; a number comes twice where two cards have it.
    photos : tuple of int
        Photos that show any of them, ascending.
    refused : tuple of int
        Numbers of markers that were found but have another size, or no square.
    """

    factor: float
    relative_error: float
    markers: tuple[int, ...]
    photos: tuple[int, ...]
    refused: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class _Group:
    """One marker of the world: its corners, without distortion, in the photos that show it."""

    number: int
    photos: tuple[int, ...]
    corners_xy: Floats


def scale_from_markers(
    markers: Sequence[Markers], cameras: Sequence[Camera | None], side_mm: float
) -> ScaleEstimate | None:
    """Find how many millimetres a unit of the cameras' world has.

    A square of unknown side and pose is fitted to the corners of each marker in all photos, by least squares in pixels.

    Parameters
    ----------
    markers : sequence of Markers
        Of every photo, from `find_markers`.
    cameras : sequence of (Camera or None)
        Of the same photos, in any unit; None for photos that are not placed.
    side_mm : float
        Side of the black squares.

    Returns
    -------
    ScaleEstimate or None
        None where no marker is seen by two photos from different places.

    Raises
    ------
    InputError
        Where markers of several sizes are seen and none of the sizes is that of most of them.
    """
    groups = _groups(markers, cameras)
    fits = [(group, _fit(group, cameras)) for group in groups]
    fits = [(group, fit) for group, fit in fits if np.isfinite(fit[0])]
    if not fits:
        return None
    sides = np.array([fit[0] for _, fit in fits])
    kept = _same_size(sides, [group for group, _ in fits])
    refused = tuple(group.number for (group, _), keep in zip(fits, kept, strict=True) if not keep)
    used = [pair for pair, keep in zip(fits, kept, strict=True) if keep]
    side, error = _mean(np.array([fit[0] for _, fit in used]), np.array([fit[1] for _, fit in used]))
    photos = tuple(sorted({photo for group, _ in used for photo in group.photos}))
    numbers = tuple(sorted(group.number for group, _ in used))
    return ScaleEstimate(side_mm / side, float(np.hypot(error / side, LEAST_ERROR)), numbers, photos, refused)


def _groups(markers: Sequence[Markers], cameras: Sequence[Camera | None]) -> list[_Group]:
    """Detections that show one marker of the world; several cards may have one number, and cards may be moved."""
    seen: dict[int, list[tuple[int, Floats]]] = {}
    for photo, (found, camera) in enumerate(zip(markers, cameras, strict=True)):
        if camera is None or not len(found.ids):
            continue
        for number, corners in zip(found.ids, corners_of(found, camera), strict=True):
            seen.setdefault(int(number), []).append((photo, corners))
    groups = []
    for number, detections in seen.items():
        rest = detections
        while len(rest) >= 2:
            best = _largest_agreement(rest, cameras)
            if len(best) < 2:
                break
            groups.append(_Group(number, tuple(rest[k][0] for k in best), np.stack([rest[k][1] for k in best])))
            rest = [detection for k, detection in enumerate(rest) if k not in best]
    return groups


def _largest_agreement(detections: list[tuple[int, Floats]], cameras: Sequence[Camera | None]) -> list[int]:
    """Rows of the detections, one a photo, that agree with the four points some pair of them gives."""
    best: list[int] = []
    least = np.inf
    eyes = np.array([_eye(cameras[photo]) for photo, _ in detections])
    apart = np.linalg.norm(eyes[:, None] - eyes, axis=2)
    for i in range(len(detections)):
        for j in range(i + 1, len(detections)):
            if apart[i, j] <= SAME_PLACE * apart.max():  # also of one photo
                continue
            pair = [detections[i], detections[j]]
            if _parallax_deg(*((cameras[photo], xy.mean(axis=0)) for photo, xy in pair)) < LEAST_PARALLAX_DEG:
                continue
            points = _triangulate([cameras[photo] for photo, _ in pair], np.stack([xy for _, xy in pair]))
            off = np.array([np.abs(_seen(cameras[photo], points) - xy).max() for photo, xy in detections])
            rows: dict[int, int] = {}
            for k in np.argsort(off):
                if off[k] < SAME_PX:
                    rows.setdefault(detections[k][0], int(k))
            chosen = sorted(rows.values())
            total = float(off[chosen].sum())
            if len(chosen) > len(best) or (len(chosen) == len(best) and total < least):
                best, least = chosen, total
    return best


def _eye(camera: Camera | None) -> Floats:
    assert camera is not None
    return camera_position(camera)


def _parallax_deg(*places: tuple[Camera | None, Floats]) -> float:
    """Angle between the rays of two cameras through places in photos without distortion."""
    a, b = (camera.rotation.T @ np.linalg.solve(camera.matrix, [*xy, 1.0]) for camera, xy in places if camera)
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _triangulate(cameras: Sequence[Camera | None], xy: Floats) -> Floats:
    """Points (k, 3) from their places (photos, k, 2) in photos without distortion: least squares of both equations."""
    lens = [(c.matrix @ np.column_stack([c.rotation, np.ravel(c.translation)])) for c in cameras if c is not None]
    points = np.empty((xy.shape[1], 3))
    for k in range(xy.shape[1]):
        rows = np.concatenate([xy[m, k, :, None] * p[2] - p[:2] for m, p in enumerate(lens)])
        points[k] = np.linalg.lstsq(rows[:, :3], -rows[:, 3], rcond=None)[0]
    return points


def _seen(camera: Camera | None, points: Floats) -> Floats:
    """Places of points in a photo without distortion; NaN behind the camera."""
    assert camera is not None
    seen = (points @ camera.rotation.T + np.ravel(camera.translation)) @ camera.matrix.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(seen[:, 2:] > 0, seen[:, :2] / seen[:, 2:], np.nan))


def _fit(group: _Group, cameras: Sequence[Camera | None]) -> tuple[float, float]:
    """Side of a marker and its standard error, in units of the world; NaN where it is no square."""
    used = [cameras[photo] for photo in group.photos]
    points = _triangulate(used, group.corners_xy)
    edges = np.roll(points, -1, axis=0) - points
    start = _pose_parameters(points, float(np.linalg.norm(edges, axis=1).mean()))
    if not np.isfinite(_residuals(start, used, group.corners_xy)).all():
        return np.nan, np.nan
    weight = np.ones(group.corners_xy.shape[:2])
    solution = _solve(start, used, group.corners_xy, weight)
    off = np.linalg.norm(_residuals(solution, used, group.corners_xy), axis=2)
    limit = max(LEAST_REFUSED_PX, REFUSED_SIGMA * 1.4826 / 1.1774 * float(np.median(off)))
    weight = (off <= limit).astype(float)
    if weight.sum() < 6 or np.median(off) > SAME_PX:
        return np.nan, np.nan
    solution = _solve(solution, used, group.corners_xy, weight)
    side = float(np.exp(solution[6]))
    count = len(used)
    error = side * _formal_error(solution, used, group.corners_xy, weight)
    if count < 3:  # no photo can be left out: one per cent is what two photos of a card leave at worst
        return side, max(error, 0.01 * side)
    without = np.array([
        np.exp(_solve(solution, _drop(used, k), np.delete(group.corners_xy, k, 0), np.delete(weight, k, 0))[6])
        for k in range(count)
    ])  # fmt: skip
    return side, max(error, float(np.sqrt((count - 1) / count * ((without - without.mean()) ** 2).sum())))


def _formal_error(parameters: Floats, cameras: Sequence[Camera | None], xy: Floats, weight: Floats) -> float:
    """Standard error of the side, relative to it, if corners were off independently: variance times (J^T J)^-1."""
    residual = weight[..., None] * _residuals(parameters, cameras, xy)
    variance = max(LEAST_SIGMA_PX**2, float((residual**2).sum()) / max(2 * float(weight.sum()) - 7, 1))
    step = 1e-6 * np.array([1, 1, 1, *3 * [np.exp(parameters[6])], 1])
    ahead, behind = (
        [(weight[..., None] * _residuals(parameters + sign * d, cameras, xy)).ravel() for d in np.diag(step)]
        for sign in (1, -1)
    )
    jacobian = (np.array(ahead) - behind) / 2e-6
    inverse = np.linalg.pinv(jacobian @ jacobian.T, hermitian=True)
    return float(np.sqrt(variance * inverse[6, 6]))


def _drop(cameras: list[Camera | None], k: int) -> list[Camera | None]:
    return cameras[:k] + cameras[k + 1 :]


def _pose_parameters(points: Floats, side: float) -> Floats:
    """Rotation vector, centre and logarithm of the side of a square near four points."""
    right = points[1] + points[2] - points[0] - points[3]
    down = points[2] + points[3] - points[0] - points[1]
    right /= np.linalg.norm(right)
    down -= (down @ right) * right
    down /= np.linalg.norm(down)
    rotation = np.stack([right, down, np.cross(right, down)], axis=1)
    return np.concatenate([Rotation.from_matrix(rotation).as_rotvec(), points.mean(axis=0), [np.log(side)]])


SQUARE = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])


def _residuals(parameters: Floats, cameras: Sequence[Camera | None], xy: Floats) -> Floats:
    """Pixels (photos, 4, 2) between the square's corners and the detected ones."""
    rotation = Rotation.from_rotvec(parameters[:3]).as_matrix()
    points = np.exp(parameters[6]) * SQUARE @ rotation.T + parameters[3:6]
    return np.stack([_seen(camera, points) for camera in cameras]) - xy


def _solve(start: Floats, cameras: Sequence[Camera | None], xy: Floats, weight: Floats) -> Floats:
    def cost(parameters: Floats) -> Floats:
        return np.asarray((weight[..., None] * _residuals(parameters, cameras, xy)).ravel())

    scale = np.exp(start[6])
    scales = np.array([1, 1, 1, scale, scale, scale, 1])
    return np.asarray(optimize.least_squares(cost, start, x_scale=scales, method="trf").x)


def _same_size(sides: Floats, groups: list[_Group]) -> list[bool]:
    """Which sides agree with those of the markers that most photos show."""
    near = np.abs(np.log(sides[:, None] / sides)) < SAME_SIZE
    votes = near @ [len(group.photos) for group in groups]
    best = int(np.argmax(votes))
    if np.any(2 * votes[~near[best]] > votes[best]):
        found = ", ".join(
            f"{group.number} ({side / sides[best]:.2f})" for group, side in zip(groups, sides, strict=True)
        )
        raise InputError(
            f"the markers beside the sheet have different sizes: {found}; markers of one size are wanted",
            "cover those that are not of the stated size, and take the photos again",
        )
    return [bool(same) for same in near[best]]


def _mean(values: Floats, errors: Floats) -> tuple[float, float]:
    """Weighted mean and its error, larger where the values differ by more than their errors say."""
    weight = 1 / np.maximum(errors, 1e-6 * values) ** 2
    mean = float((weight * values).sum() / weight.sum())
    error = float(1 / np.sqrt(weight.sum()))
    if len(values) > 1:
        error *= max(1.0, float(np.sqrt((weight * (values - mean) ** 2).sum() / (len(values) - 1))))
    return mean, error
