"""Photos of a sheet on a table, taken with a phone from around, and the truth about all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import spatial

from planish.errors import UsageError
from planish.gallery.artwork import hills
from planish.gallery.light import Light
from planish.gallery.marker_card import MarkerCard
from planish.gallery.photo_scene import FloatMap, LitScene, draw_scene, lit_scene
from planish.gallery.pixel_to_page import FineMesh, fine_mesh, project
from planish.gallery.sheets import Sheet, flat
from planish.gallery.table_top import Table, table_top
from planish.types import Camera, Floats, Page

PHOTO_PX = (3056, 2292)
"""Seven megapixels."""

FOCAL = 3714 / 3056
"""Focal length over the photo's long side: 45 degrees across, a phone's main camera of 43 mm as photographers say."""

LENS = (0.03, -0.02, 0.0, 0.0)
"""Radial distortion k1 k2: 1.3 per mille at half the way to the photo's corner, 6 per mille in it."""

LAMP = Light(position_mm=(-380.0, 420.0, 950.0), ambient=0.4, exposure=0.85)
"""A lamp over the table, and light from the room."""

TILT_DEG = (15.0, 38.0)
"""Of the views off the vertical."""

DISTANCE_MM = 500.0
"""Least distance of the phone; sheets that do not fit the photo from there are taken from farther away."""

MARGIN = 0.03
"""Of the photo, left free around sheet and cards."""

CELL_MM = 1.0
"""Grid of the sheet's mesh."""

TABLE_HALF_MM = 450.0

GAP_MM = 14.0
"""Between sheet and cards."""

OUT_OF_FOCUS = 6.0
"""Blur of a photo out of focus, in thousandths of its long side: letters are gone."""


@dataclass(frozen=True, eq=False)
class PhotoShoot:
    """Photos of one sheet, and the truth.

    Attributes
    ----------
    photos : tuple of (rows, cols, 3) uint8
        In the order in which they were taken, from around.
    cameras : tuple of (Camera or None)
        That took them: world of `Sheet.bend`. None for photos of another subject.
    useful : tuple of bool
        False for photos out of focus and of another subject.
    sheet : Sheet
    page : Page
        Its print.
    mesh : FineMesh
        The sheet as it lies on the table: points, faces and places on the page.
    rim : (k, 3) float64 [mm]
        The sheet's edge, closed, clockwise seen from the printed side, from the page's top left corner.
    cards : tuple of MarkerCard
        On the table beside it.
    """

    photos: tuple[NDArray[np.uint8], ...]
    cameras: tuple[Camera | None, ...]
    useful: tuple[bool, ...]
    sheet: Sheet
    page: Page
    mesh: FineMesh
    rim: Floats
    cards: tuple[MarkerCard, ...]

    def locate(self, points: Floats) -> tuple[Floats, Floats]:
        """Find the places of the page next to points in space.

        Newton's method on the sheet itself from the nearest point of the mesh: u <- u + J^+ (p - bend(u)).

        Parameters
        ----------
        points : (k, 3) float64 [mm]
            In the world of the cameras.

        Returns
        -------
        page_xy : (k, 2) float64 [mm]
        distance : (k,) float64 [mm]
            From the sheet.

        Examples
        --------
        >>> from planish.gallery import sheet, typeset_sheet
        >>> wave = sheet("wave")
        >>> shoot = photo_shoot(wave, typeset_sheet(wave, 60)[0], 1, photo_px=(400, 300), rng=0)
        >>> page_xy, distance = shoot.locate(wave.bend(np.array([[100.2, 50.7]])))
        >>> page_xy.round(2).tolist(), distance.round(3).tolist()
        ([[100.2, 50.7]], [0.0])
        """
        size = np.array([self.sheet.width_mm, self.sheet.height_mm])
        u = self.mesh.page_xy[spatial.KDTree(self.mesh.points).query(points)[1]]
        best, least = u, np.linalg.norm(points - self.sheet.bend(u), axis=1)
        step = 1e-3
        for _ in range(6):
            here = self.sheet.bend(u)
            jacobian = np.stack([(self.sheet.bend(u + step * e) - here) / step for e in np.eye(2)], axis=2)
            moved = np.einsum("kij,ki->kj", jacobian, points - here)  # an isometry: J^T J is the unit matrix
            u = np.clip(u + np.clip(moved, -self.mesh.cell_mm, self.mesh.cell_mm), 0, size)
            distance = np.linalg.norm(points - self.sheet.bend(u), axis=1)
            better = distance < least
            best = np.where(better[:, None], u, best)
            least = np.minimum(least, distance)
        return best, least


def photo_shoot(
    sheet: Sheet,
    page: Page,
    count: int,
    *,
    rng: np.random.Generator | int,
    photo_px: tuple[int, int] = PHOTO_PX,
    cards: int = 1,
    card_mm: float = 40.0,
    table: Table = "wood",
    out_of_focus: int = 0,
    other_subjects: int = 0,
    distance_mm: float = DISTANCE_MM,
    lens: Sequence[float] = LENS,
    light: Light = LAMP,
    blur_px: float = 0.7,
    grain: float = 1.5,
) -> PhotoShoot:
    """Photograph a sheet with a phone: once nearly from above, then from around.

    The lamp, the sheet and the cards stay where they are; the phone is aimed, turned and held at its distance by hand,
    and exposes every photo for itself.

    Parameters
    ----------
    sheet : Sheet
    page : Page
        Its print, as `typeset_sheet` gives it.
    count : int
        Useful photos.
    rng : numpy.random.Generator or int
        Source of all that is random here, or its seed.
    photo_px : (int, int)
        Long and short side of the photos. All are stored as the sensor reads them, the long side across.
    cards : int
        Up to four cards with an ArUco marker, each with a number of its own, on the table around the sheet.
    card_mm : float
        Side of their black squares.
    table : {"wood", "plain", "white"}
    out_of_focus, other_subjects : int
        Further photos, that are useless; they come in between.
    distance_mm : float
        Of the phone; more where the sheet does not fit the photo.
    lens : sequence of float
        Distortion, as OpenCV has it: k1 k2 p1 p2 k3.
    light : Light
    blur_px : float
        Standard deviation of the lens's blur, for photos of `PHOTO_PX`; smaller ones are less blurred.
    grain : float
        Standard deviation of the noise, in levels of 255.

    Examples
    --------
    >>> from planish.gallery import sheet, typeset_sheet
    >>> letter = sheet("letter")
    >>> shoot = photo_shoot(letter, typeset_sheet(letter, 60)[0], 3, photo_px=(400, 300), out_of_focus=1, rng=0)
    >>> len(shoot.photos), shoot.photos[0].shape, sum(shoot.useful)
    (4, (300, 400, 3), 3)
    """
    _check(count, cards, photo_px)
    rng = np.random.default_rng(rng)
    mesh = fine_mesh(sheet, CELL_MM)
    laid = _lay_cards(mesh, cards, card_mm, rng)
    scene = _scene(sheet, mesh, page, laid, table, photo_px, light, rng)
    seen = np.concatenate([mesh.points[::7], *(card.outline for card in laid)])
    rows, cols = min(photo_px), max(photo_px)
    matrix = _matrix((rows, cols), rng)
    views, others = (
        _views(photos, seen, (rows, cols), distance_mm, matrix, np.asarray(lens, float), rng)
        for photos in (count, out_of_focus)
    )
    blur = blur_px * cols / PHOTO_PX[0]
    photos = [_exposed(draw_scene(scene, camera), blur, grain, light.gamma, rng) for camera in views]
    shots: list[tuple[NDArray[np.uint8], Camera | None, bool]] = [
        (photo, camera, True) for photo, camera in zip(photos, views, strict=True)
    ]
    useless: list[tuple[NDArray[np.uint8], Camera | None, bool]] = [
        (_exposed(draw_scene(scene, camera), OUT_OF_FOCUS * cols / 1000, grain, light.gamma, rng), camera, False)
        for camera in others
    ]
    useless += [(photo, None, False) for photo in _other_subjects(other_subjects, photo_px, light, blur, grain, rng)]
    for shot in useless:
        shots.insert(int(rng.integers(1, len(shots) + 1)), shot)
    taken, cameras, useful = zip(*shots, strict=True)
    return PhotoShoot(taken, cameras, useful, sheet, page, mesh, _rim(sheet), laid)


def _check(count: int, cards: int, photo_px: tuple[int, int]) -> None:
    if count < 1:
        raise UsageError(f"{count} photos were asked for; at least one is wanted")
    if not 0 <= cards <= 4:
        raise UsageError(f"{cards} cards were asked for; there is room for up to four, one at each side of the sheet")
    if min(photo_px) < 100:
        raise UsageError(f"photos of {photo_px[0]} x {photo_px[1]} pixels were asked for; at least 100 each way")


def _scene(
    sheet: Sheet,
    mesh: FineMesh,
    page: Page,
    cards: tuple[MarkerCard, ...],
    table: Table,
    photo_px: tuple[int, int],
    light: Light,
    rng: np.random.Generator,
) -> LitScene:
    pixel_mm = DISTANCE_MM / (FOCAL * max(photo_px))
    top = table_top(table, TABLE_HALF_MM, max(0.3, 2 * pixel_mm), rng)
    return lit_scene(sheet, mesh, page, cards, top, TABLE_HALF_MM, light)


def _lay_cards(mesh: FineMesh, count: int, side_mm: float, rng: np.random.Generator) -> tuple[MarkerCard, ...]:
    """Lay cards below the sheet's foot, above its head, right and left of it; farther off where its edge is high."""
    low, high = mesh.points[:, :2].min(axis=0), mesh.points[:, :2].max(axis=0)
    middle, half = (low + high) / 2, (high - low) / 2
    quiet = side_mm / 4
    sides = np.array([[0.0, -1.0], [0.0, 1.0], [1.0, 0.0], [-1.0, 0.0]])
    if half[0] > half[1]:  # the long side of the photos lies along the sheet's: cards go to its ends
        sides = sides[[2, 3, 1, 0]]
    numbers = rng.permutation(50)[:count]
    cards = []
    for number, side in zip(numbers, sides, strict=False):
        edge = (mesh.points[:, :2] - middle) @ side > half @ np.abs(side) - 25.0
        hides = 0.8 * mesh.points[edge, 2].max()  # what an edge hides from 38 degrees off the vertical
        away = half + GAP_MM + hides + quiet + side_mm / 2
        along = rng.uniform(-0.5, 0.5) * np.abs(side[::-1]) * (half - side_mm / 2)
        centre = middle + side * away + along
        turn = float(rng.uniform(-12, 12))
        cards.append(MarkerCard(int(number), (float(centre[0]), float(centre[1])), turn, side_mm, quiet))
    return tuple(cards)


def _views(
    count: int,
    seen: Floats,
    shape_rc: tuple[int, int],
    distance_mm: float,
    matrix: Floats,
    lens: Floats,
    rng: np.random.Generator,
) -> list[Camera]:
    """Aim the phone: first nearly from above, then from all sides in turn."""
    azimuths = rng.uniform(0, 360) + 360 * (np.arange(count) + rng.uniform(-0.2, 0.2, count)) / max(count - 1, 1)
    tilts = rng.uniform(*TILT_DEG, count)
    tilts[:1] = rng.uniform(2, 5)
    long_axis = 0.0 if np.ptp(seen[:, 0]) > np.ptp(seen[:, 1]) else 90.0
    cameras = []
    for azimuth, tilt in zip(np.radians(azimuths), np.radians(tilts), strict=True):
        away = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
        turn = np.radians(long_axis + 180.0 * rng.integers(2) + rng.uniform(-9, 9))
        aim = (seen.min(axis=0) + seen.max(axis=0)) / 2 + [*rng.uniform(-8, 8, 2), 0.0]
        distance = distance_mm * rng.uniform(0.95, 1.08)
        camera = _aimed(aim + distance * away, aim, turn, matrix, shape_rc, lens)
        for _ in range(40):  # step back until everything is in the photo
            if _fits(camera, seen):
                break
            distance *= 1.02
            camera = _aimed(aim + distance * away, aim, turn, matrix, shape_rc, lens)
        cameras.append(camera)
    return cameras


def _matrix(shape_rc: tuple[int, int], rng: np.random.Generator) -> Floats:
    """Focal length and principal point of one phone, the latter a little beside the middle."""
    rows, cols = shape_rc
    focal = FOCAL * cols
    off = rng.uniform(-0.004, 0.004, 2) * cols
    return np.array([[focal, 0, (cols - 1) / 2 + off[0]], [0, focal, (rows - 1) / 2 + off[1]], [0, 0, 1]])


def _aimed(eye: Floats, aim: Floats, turn: float, matrix: Floats, shape_rc: tuple[int, int], lens: Floats) -> Camera:
    """Camera at `eye` that looks at `aim`, its rows along the direction `turn` [rad] of the table."""
    forward = (aim - eye) / np.linalg.norm(aim - eye)
    right = np.array([np.cos(turn), np.sin(turn), 0.0])
    right -= (right @ forward) * forward
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return Camera(matrix, rotation, -rotation @ eye, shape_rc, lens)


def _fits(camera: Camera, points: Floats) -> bool:
    rows, cols = camera.shape_rc
    xy, _ = project(camera, points)
    low = MARGIN * cols
    return bool(xy.min() > low and xy[:, 0].max() < cols - low and xy[:, 1].max() < rows - low)


def _exposed(
    linear: FloatMap, blur_px: float, grain: float, gamma: float, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Photo of linear light: exposure of its own, blur, noise."""
    gain = np.float32(rng.uniform(0.92, 1.05))
    blurred = cv2.GaussianBlur(linear, (0, 0), blur_px) if blur_px > 0.2 else linear
    noise = rng.standard_normal(linear.shape, np.float32)
    photo = np.empty(linear.shape, np.uint8)
    for top in range(0, len(photo), 256):
        rows = slice(top, top + 256)
        levels = np.clip(gain * blurred[rows], 0, 1) ** np.float32(1 / gamma)
        photo[rows] = np.clip(np.rint(255 * levels + np.float32(grain) * noise[rows]), 0, 255)
    return photo


def _other_subjects(
    count: int, photo_px: tuple[int, int], light: Light, blur: float, grain: float, rng: np.random.Generator
) -> list[NDArray[np.uint8]]:
    """Photos of a picture postcard on another table."""
    if not count:
        return []
    card = flat(150.0, 100.0)
    picture = Page(hills(900, 600, seed=int(rng.integers(1 << 30))), np.ones((600, 900), bool), 152.4)
    mesh = fine_mesh(card, CELL_MM)
    scene = _scene(card, mesh, picture, (), "plain", photo_px, light, rng)
    shape = min(photo_px), max(photo_px)
    views = _views(count, mesh.points, shape, 300.0, _matrix(shape, rng), np.zeros(4), rng)
    return [_exposed(draw_scene(scene, camera), blur, grain, light.gamma, rng) for camera in views]


def _rim(sheet: Sheet, step_mm: float = 0.5) -> Floats:
    """Edge of the sheet, closed."""
    w, h = sheet.width_mm, sheet.height_mm
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h], [0, 0]])
    lengths = np.concatenate([[0], np.cumsum([w, h, w, h])])
    at = np.linspace(0, lengths[-1], 1 + round(lengths[-1] / step_mm))
    at = np.unique(np.concatenate([at, lengths]))
    return sheet.bend(np.stack([np.interp(at, lengths, corners[:, k]) for k in range(2)], axis=1))
