"""ArUco markers in photos: which ones, and where their sides are, to a few hundredths of a pixel.

OpenCV finds the markers and reads their numbers; its corners are good to about a pixel. The sides are measured anew:
on a line across a side the light rises from black to white, and its mean says where the edge is, whatever the blur
(`edge_offsets`). Phones sharpen their photos and bend their tones, and ink spreads: all this moves every edge of a
marker by one length towards the white, the cells' as well as the sides'. The cells know how far (`dark_growth`), since
their distances from edge to like edge stay what they were. Without that, sharpening makes a card of 40 mm 0.3 % larger.

Points of an edge, not corners, are kept, for only a camera that is known tells which curve a side of a square makes in
a photo; `corners_of` intersects them.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from planish.color import linear_light, to_uint8
from planish.geometry import project
from planish.geometry.triangulation import rays
from planish.types import Camera, Floats, Pixels

DICTIONARY = cv2.aruco.DICT_4X4_50

CELLS = 6
"""Cells across a marker: four of its number, and a black rim."""

SEARCH_PX = 2000
"""Long side of the photo on which markers are looked for. With half of it markers under 50 pixels are missed in photos
of 7 megapixels, with twice as much the search takes four times as long and finds no more."""

SMALLEST_PX = 24.0
"""Sides shorter than this are not measured: their rim is narrower than the blur on both of its sides."""

ENDS = 0.08
"""Of a side, left out at its corners, where the other side's blur begins."""

CELL_ENDS = 0.25
"""The same of a cell's edge."""

LEAST_SHARES = 8.0
"""Of the cells' edges, in squares of what they tell: the dictionary's numbers have 14 to 46 of it. With fewer the mean
is no better than nothing: a side is right to 0.3 px then, by sharpening."""

LARGEST_GROWTH_PX = 2.0
"""Of dark parts; more is no edge's."""

STEP_PX = 0.25
"""Of the samples across a side."""

CLEAR = 0.12
"""Least difference of white and black across a side, in linear light: less is shade or gloss."""

WIDEST_RMS_PX = 0.6
"""Edges that wave more than this are no sides of a flat square in focus: markers that are bent, covered or imagined in
print. Those of the gallery's photos wave by 0.05 to 0.15; with half of it blurred photos lose their markers."""


@dataclass(frozen=True, eq=False)
class Markers:
    """Markers of one photo.

    Attributes
    ----------
    ids : (m,) int
        Numbers in the dictionary DICT_4X4_50; one number may come several times.
    corners_xy : (m, 4, 2) float64 [px]
        Corners of the black square, without regard to the lens: upper left, then clockwise as printed.
    sides_xy : tuple of m tuples of four (k, 2) float64 [px]
        Points of the sides that begin at these corners.
    """

    ids: NDArray[np.int64]
    corners_xy: Floats
    sides_xy: tuple[tuple[Floats, Floats, Floats, Floats], ...]


def find_markers(image: Pixels) -> Markers:
    """Find the ArUco markers of DICT_4X4_50 in a photo.

    Parameters
    ----------
    image : (rows, cols) or (rows, cols, 3) uint8 or uint16
        In the code values of sRGB: edges lie where linear light is at its mean.

    Examples
    --------
    >>> drawn = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(DICTIONARY), 7, 120)
    >>> markers = find_markers(np.pad(drawn, 60, constant_values=255))
    >>> markers.ids.tolist(), markers.corners_xy.round(1).tolist()
    ([7], [[[59.5, 59.5], [179.5, 59.5], [179.5, 179.5], [59.5, 179.5]]])
    """
    levels = to_uint8(np.asarray(image))
    small, factor = _shrunk(levels)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(DICTIONARY))
    found, numbers, _ = detector.detectMarkers(small)
    ids, corners, sides = [], [], []
    for number, quad in zip(np.ravel([] if numbers is None else numbers), found, strict=True):
        rough = (np.asarray(quad, np.float64).reshape(4, 2) + 0.5) / factor - 0.5
        measured = _measure_sides(levels, rough, int(number))
        if measured is not None:
            ids.append(int(number))
            sides.append(measured)
            corners.append(_intersect(measured))
    return Markers(np.array(ids, np.int64), np.array(corners, np.float64).reshape(-1, 4, 2), tuple(sides))


def corners_of(markers: Markers, camera: Camera) -> Floats:
    """Corners of markers as a camera without distortion would see them, (m, 4, 2) float64 [px].

    Straight lines are fitted to the sides where the lens does not bend them.
    """
    corners = np.empty((len(markers.ids), 4, 2))
    for k, sides in enumerate(markers.sides_xy):
        corners[k] = _intersect(tuple(without_distortion(camera, side) for side in sides))
    return corners


def without_distortion(camera: Camera, xy: Floats) -> Floats:
    """Pixels of the same camera matrix and no distortion, (k, 2) float64 [px]."""
    directions, _ = rays(camera, xy)
    seen = directions @ camera.rotation.T @ camera.matrix.T
    return np.asarray(seen[:, :2] / seen[:, 2:])


def with_distortion(camera: Camera, xy: Floats) -> Floats:
    """The other way round: where a lens puts what `without_distortion` made straight."""
    seen = np.column_stack([xy, np.ones(len(xy))]) @ np.linalg.inv(camera.matrix).T
    return project(Camera(camera.matrix, np.eye(3), np.zeros(3), camera.shape_rc, camera.distortion), seen)


def _shrunk(levels: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], float]:
    grey = levels if levels.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(levels), cv2.COLOR_RGB2GRAY)
    factor = min(1.0, SEARCH_PX / max(grey.shape))
    if factor == 1.0:
        return grey, 1.0
    shape = tuple(round(factor * side) for side in grey.shape[::-1])
    return np.asarray(cv2.resize(grey, shape, interpolation=cv2.INTER_AREA), np.uint8), shape[0] / grey.shape[1]


def _measure_sides(
    levels: NDArray[np.uint8], quad: Floats, number: int
) -> tuple[Floats, Floats, Floats, Floats] | None:
    """Points of the four sides of a marker, or None where one of them is no straight edge."""
    side_px = np.linalg.norm(np.roll(quad, -1, axis=0) - quad, axis=1)
    if side_px.min() < SMALLEST_PX:
        return None
    reach = float(np.clip(0.4 * side_px.min() / CELLS, 1.5, 8.0))
    low = np.maximum(np.floor(quad.min(axis=0) - 2 * reach).astype(int), 0)
    high = np.minimum(np.ceil(quad.max(axis=0) + 2 * reach).astype(int) + 1, levels.shape[1::-1])
    light = linear_light(256)[levels[low[1] : high[1], low[0] : high[0]]]
    light = light if light.ndim == 2 else light.mean(axis=2)
    for _ in range(3):  # the windows move onto the sides
        sides = []
        for k in range(4):
            start, end = quad[k] - low, quad[(k + 1) % 4] - low
            points = _edge_points(light, start, end, reach)
            if points is None:
                return None
            sides.append(points + low)
        quad = _intersect(tuple(sides))
        if not np.isfinite(quad).all():
            return None
    growth = dark_growth(light, quad - low, number, reach)
    sides = [side - growth * _outward(quad[k], quad[(k + 1) % 4]) for k, side in enumerate(sides)]
    rms = max(np.sqrt(np.mean(_distances(side, *_line(side)) ** 2)) for side in sides)
    return (sides[0], sides[1], sides[2], sides[3]) if rms < WIDEST_RMS_PX else None


def dark_growth(light: NDArray[np.float32], quad: Floats, number: int, reach: float) -> float:
    """How far a marker's dark parts reach beyond their true edges [px]: by sharpening, bent tones or spread ink.

    Let all edges move by g from dark to bright. The square is then 2 g wider, and an edge on the grid's line i, which
    the square's corners put at i (6 p + 2 g) / 6 - g with p the width of a cell, lies at i p + s g, where s is 1 if the
    bright cell is the further one and -1 if not: it is found g (1 + s (1 - i / 3)) from dark to bright of its place.

    Parameters
    ----------
    light : (rows, cols) float32
        Linear light around the marker.
    quad : (4, 2) float64 [px]
        Its corners, as its sides have them.
    number : int
        Of the dictionary: what its cells are.
    reach : float [px]
        On both sides of an edge.

    Returns
    -------
    float
        0 where the cells' edges are not clear.
    """
    cells = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(DICTIONARY), number, CELLS) > 127
    grid = cv2.getPerspectiveTransform(
        np.array([[0, 0], [CELLS, 0], [CELLS, CELLS], [0, CELLS]], np.float32), quad.astype(np.float32)
    )
    products, squares = 0.0, 0.0
    for upright in (True, False):
        bright = cells if upright else cells.T
        for line in range(1, CELLS):
            for row in np.flatnonzero(bright[:, line] != bright[:, line - 1]):
                sign = 1.0 if bright[row, line] else -1.0
                ends = np.array([[line, row], [line, row + 1]], np.float64)
                # the white must be on the left hand of the way from start to end, y down
                if (sign > 0) != upright:
                    ends = ends[::-1]
                start, end = cv2.perspectiveTransform((ends if upright else ends[:, ::-1])[None], grid)[0]
                points = _edge_points(light, start, end, reach, CELL_ENDS)
                if points is None:
                    continue
                share = 1 + sign * (1 - line / 3)
                found = float(((points - start) @ _outward(start, end)).mean())
                products += share * found
                squares += share**2
    growth = products / squares if squares > LEAST_SHARES else 0.0
    return growth if abs(growth) < LARGEST_GROWTH_PX else 0.0


def _outward(start: Floats, end: Floats) -> Floats:
    """Unit vector to the left hand of the way from start to end, y down: out of a square whose corners go clockwise."""
    along = (end - start) / np.linalg.norm(end - start)
    return np.array([along[1], -along[0]])


def _edge_points(
    light: NDArray[np.float32], start: Floats, end: Floats, reach: float, ends: float = ENDS
) -> Floats | None:
    """Points of an edge near the line from start to end, white on the left hand: (k, 2), or None for no edge."""
    along, outward = end - start, _outward(start, end)
    t = np.linspace(ends, 1 - ends, max(8, int(np.linalg.norm(along))))
    offsets = STEP_PX * np.arange(-int(reach / STEP_PX), int(reach / STEP_PX) + 1)
    at = (start + t[:, None] * along)[:, None] + offsets[:, None] * outward
    profiles = ndimage.map_coordinates(light, [at[..., 1], at[..., 0]], order=1, mode="nearest")
    shift, clear = edge_offsets(profiles, STEP_PX)
    if clear.mean() < 0.7:
        return None
    middle = start + t[clear, None] * along
    return np.asarray(middle + shift[clear, None] * outward)


def edge_offsets(profiles: NDArray[np.floating], step: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Place of the edge in profiles from dark to bright, by the area under them.

    An edge at x that was blurred by anything symmetrical has the mean (B (x + w) + W (w - x)) / 2 w over a window from
    -w to w, with the levels B and W of both ends: so x = w (W + B - 2 mean) / (W - B).

    Parameters
    ----------
    profiles : (k, n) float
        Linear light, `step` apart, around 0.
    step : float

    Returns
    -------
    offset : (k,) float64
    clear : (k,) bool
        Whether there is an edge, and within the middle half of the window.

    Examples
    --------
    >>> x = np.arange(-4, 4.1, 0.25)
    >>> edge_offsets(np.clip(0.5 + (x - 0.6) / 2, 0, 1)[None], 0.25)[0].round(2).tolist()
    [0.6]
    """
    count = profiles.shape[1]
    width = step * (count - 1) / 2
    ends = max(2, count // 8)
    dark, bright = profiles[:, :ends].mean(axis=1), profiles[:, -ends:].mean(axis=1)
    inner = profiles.sum(axis=1) - 0.5 * (profiles[:, 0] + profiles[:, -1])  # trapezoids
    mean = inner / (count - 1)
    rise = bright - dark
    clear = rise > CLEAR
    offset = width * (bright + dark - 2 * mean) / np.where(clear, rise, 1.0)
    return np.asarray(offset, np.float64), clear & (np.abs(offset) < width / 2)


def _line(points: Floats) -> tuple[Floats, Floats]:
    """Line through points: middle and normal; points four robust standard deviations off it are left out."""
    used = points
    for _ in range(4):
        middle = used.mean(axis=0)
        normal = np.linalg.svd(used - middle, full_matrices=False)[2][1]
        off = np.abs(_distances(points, middle, normal))
        kept = points[off <= 4 * 1.4826 * np.median(off) + 1e-6]
        if len(kept) == len(used):
            break
        used = kept
    return middle, normal


def _distances(points: Floats, middle: Floats, normal: Floats) -> Floats:
    return np.asarray((points - middle) @ normal)


def _intersect(sides: tuple[Floats, ...]) -> Floats:
    """Corners where the lines through neighbouring sides meet, (4, 2); side k runs from corner k to the next."""
    lines = [_line(side) for side in sides]
    corners = np.full((4, 2), np.nan)
    for k in range(4):
        (a, m), (b, n) = lines[k - 1], lines[k]
        system = np.stack([m, n])
        if abs(np.linalg.det(system)) > 0.05:  # under three degrees between sides
            corners[k] = np.linalg.solve(system, [m @ a, n @ b])
    return corners
