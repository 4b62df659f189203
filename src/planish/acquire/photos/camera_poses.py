"""Where photos of a sheet were taken: incremental structure from motion by COLMAP (Schönberger and Frahm 2016)."""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.acquire.photos.features import Features, find_features
from planish.display.one_line import one_line
from planish.errors import InputError, MissingExtraError, install_command
from planish.geometry import camera_position
from planish.types import Camera, Floats

SEED = 1
SIGACTION_BYTES = 512
"""More than the structure has on any system: 152 on Linux."""
MIN_MATCHES = 15
"""Of two photos, COLMAP's own."""
MIN_POINTS = 60
"""Fewer points than this do not tell the shape of a sheet from that of noise."""
MIN_ANGLE_DEG = 4.0
"""Median of the largest angle between two rays to a point. At 4 degrees depth is fourteen times less sure than place; a
film from one place, or a phone turned about itself, has less than 2, photos from around 30 and more."""


@dataclass(frozen=True, eq=False)
class Lens:
    """The lens of one or several photos.

    Attributes
    ----------
    shape_rc : (int, int)
    focal_px : float [px]
    calibrated : Camera or None
        If it is known: its matrix and distortion are kept as they are.
    """

    shape_rc: tuple[int, int]
    focal_px: float
    calibrated: Camera | None = None


@dataclass(frozen=True, eq=False)
class CameraPoses:
    """Cameras of photos, and what they saw in common.

    Attributes
    ----------
    cameras : tuple of Camera or None
        One for each photo, all in one world frame of unknown scale; None for photos that could not be placed.
    points : (n, 3) float64
        In the same frame.
    views : (n,) int32
        How many photos saw each point.
    error_px : float
        Mean distance of features from their projected points.
    angle_deg : float
        Median over the points of the largest angle between two of their rays.
    """

    cameras: tuple[Camera | None, ...]
    points: Floats
    views: NDArray[np.int32]
    error_px: float
    angle_deg: float

    __repr__ = one_line

    def scaled(self, factor: float) -> CameraPoses:
        """The same in another unit."""
        cameras = tuple(c and scaled_pose(c, factor) for c in self.cameras)
        return replace(self, cameras=cameras, points=factor * self.points)


def scaled_pose(camera: Camera, factor: float) -> Camera:
    """The camera in a world so many times as large."""
    return replace(camera, translation=factor * camera.translation)


@contextmanager
def _kept_sigterm() -> Iterator[None]:
    """Keep this process's handler of SIGTERM: COLMAP's log installs one that prints a stack trace and aborts.

    By the C library, as Python sets handlers in its main thread only.
    """
    library = ctypes.CDLL(None) if os.name == "posix" else None
    kept = ctypes.create_string_buffer(SIGACTION_BYTES)
    if library is not None:
        library.sigaction(signal.SIGTERM, None, kept)
    try:
        yield
    finally:
        if library is not None:
            library.sigaction(signal.SIGTERM, kept, None)


def import_pycolmap() -> Any:
    """Import pycolmap.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        with _kept_sigterm():
            import pycolmap
    except ImportError:
        raise MissingExtraError(
            f"finding where photos were taken needs pycolmap: {install_command('photos')}"
        ) from None
    return pycolmap


def find_camera_poses(
    photos: Sequence[NDArray[np.uint8]],
    lens_of_photo: Sequence[int],
    lenses: Sequence[Lens],
    known: Sequence[Camera] | None = None,
) -> CameraPoses:
    """Find where photos were taken, from what they show in common.

    Parameters
    ----------
    photos : sequence of (rows, cols) uint8
        In the orientation of the sensor, so that all photos of one lens share its axis.
    lens_of_photo : sequence of int
        The number of each photo's lens.
    lenses : sequence of Lens
    known : sequence of Camera, optional
        The cameras, where they are known; only the points are sought then, in their frame.

    Raises
    ------
    InputError
        If fewer than two photos show the same thing, or all were taken from one place.
    MissingExtraError
        If pycolmap is not installed.
    """
    pycolmap = import_pycolmap()
    features = find_features(photos)
    with TemporaryDirectory(prefix="planish-") as folder, _quiet(pycolmap):
        database = Path(folder) / "features.db"
        lens_ids = _write_features(pycolmap, database, features, lens_of_photo, lenses, known)
        matching = pycolmap.FeatureMatchingOptions(use_gpu=False)
        pycolmap.match_exhaustive(database, matching_options=matching, device=pycolmap.Device.cpu)
        if known is None:
            model = _map(pycolmap, database, Path(folder), lens_ids, lenses)
        else:
            model = _triangulate(pycolmap, database, Path(folder), known)
    if model is None or model.num_points3D() < MIN_POINTS:
        count = 0 if model is None else model.num_points3D()
        raise InputError(
            f"the {len(photos)} photos have {'no' if count == 0 else f'only {count}'} places in common that fit one "
            "sheet; photograph the same sheet, lying still, from around, each photo overlapping the others, sharp, and "
            "with something printed on it"
        )
    return _collect(model, len(photos), lens_of_photo, lenses, known)


@contextmanager
def _quiet(pycolmap: Any) -> Iterator[None]:
    """COLMAP writes its log to stderr; only fatal errors are let through."""
    level = pycolmap.logging.minloglevel
    pycolmap.logging.minloglevel = 3
    try:
        yield
    finally:
        pycolmap.logging.minloglevel = level


def _write_features(
    pycolmap: Any,
    path: Path,
    features: Sequence[Features],
    lens_of_photo: Sequence[int],
    lenses: Sequence[Lens],
    known: Sequence[Camera] | None,
) -> list[int]:
    """Write cameras, photos and features into COLMAP's database; return the ids of the lenses."""
    with pycolmap.Database.open(path) as database:
        if known is None:
            ids = [database.write_camera(_colmap_camera(pycolmap, lens.calibrated, lens)) for lens in lenses]
            id_of_photo = [ids[lens] for lens in lens_of_photo]
        else:
            ids = [database.write_camera(_colmap_camera(pycolmap, camera)) for camera in known]
            id_of_photo = ids
        for k, (keypoints, descriptors) in enumerate(features):
            number = database.write_image(pycolmap.Image(name=str(k), camera_id=id_of_photo[k]))
            corner_based = keypoints + np.array([0.5, 0.5, 0, 0], np.float32)  # COLMAP's pixel centres are at halves
            database.write_keypoints(number, corner_based)
            kind = pycolmap.FeatureExtractorType.SIFT
            database.write_descriptors(number, pycolmap.FeatureDescriptors(kind, descriptors))
    return ids


def _colmap_camera(pycolmap: Any, camera: Camera | None, lens: Lens | None = None) -> Any:
    """COLMAP's camera: the given one, or one to be found, its axis in the middle and with two radial terms."""
    if camera is None:
        assert lens is not None
        rows, cols = lens.shape_rc
        parameters = [lens.focal_px, cols / 2, rows / 2, 0, 0]
        return pycolmap.Camera(model="RADIAL", width=cols, height=rows, params=parameters, has_prior_focal_length=True)
    rows, cols = camera.shape_rc
    k1, k2, p1, p2, *more = np.concatenate([camera.distortion, np.zeros(8)])[:8]
    matrix = camera.matrix
    parameters = [matrix[0, 0], matrix[1, 1], matrix[0, 2] + 0.5, matrix[1, 2] + 0.5, k1, k2, p1, p2, *more]
    return pycolmap.Camera(model="FULL_OPENCV", width=cols, height=rows, params=parameters, has_prior_focal_length=True)


def _map(pycolmap: Any, database: Path, folder: Path, lens_ids: Sequence[int], lenses: Sequence[Lens]) -> Any:
    """The largest model that COLMAP makes of the photos; None where there is none."""
    options = pycolmap.IncrementalPipelineOptions(min_model_size=2, extract_colors=False, random_seed=SEED)
    options.min_num_matches = MIN_MATCHES
    options.constant_cameras = {n for n, lens in zip(lens_ids, lenses, strict=True) if lens.calibrated is not None}
    models = pycolmap.incremental_mapping(database, folder, folder, options)
    return max(models.values(), key=lambda model: (model.num_reg_images(), model.num_points3D()), default=None)


def _triangulate(pycolmap: Any, database: Path, folder: Path, known: Sequence[Camera]) -> Any:
    """The points seen by known cameras."""
    model = pycolmap.Reconstruction()
    with pycolmap.Database.open(database) as opened:
        for camera in opened.read_all_cameras():
            model.add_camera_with_trivial_rig(camera)
        for image in opened.read_all_images():
            camera = known[int(image.name)]
            pose = pycolmap.Rigid3d(np.column_stack([camera.rotation, np.ravel(camera.translation)]))
            model.add_image_with_trivial_frame(image, pose)
    options = pycolmap.IncrementalPipelineOptions(extract_colors=False, random_seed=SEED)
    return pycolmap.triangulate_points(model, database, folder, folder, options=options, refine_intrinsics=False)


def _collect(
    model: Any, count: int, lens_of_photo: Sequence[int], lenses: Sequence[Lens], known: Sequence[Camera] | None
) -> CameraPoses:
    cameras: list[Camera | None] = [None] * count
    for number in model.reg_image_ids():
        image = model.image(number)
        k = int(image.name)
        if known is not None:
            cameras[k] = known[k]
            continue
        pose, lens = image.cam_from_world(), lenses[lens_of_photo[k]]
        if lens.calibrated is not None:
            like = lens.calibrated
        else:
            focal, x, y, k1, k2 = model.camera(image.camera_id).params
            matrix = np.array([[focal, 0, x - 0.5], [0, focal, y - 0.5], [0, 0, 1]])
            like = Camera(matrix, np.eye(3), np.zeros(3), lens.shape_rc, np.array([k1, k2, 0.0, 0.0]))
            if folds(like):
                raise InputError(
                    f"{len(model.reg_image_ids())} of {count} photos fit each other, but have only "
                    f"{len(model.points3D)} places in common, too few to find their lens; take more photos, from "
                    "nearer, sharp, each showing the whole sheet",
                    "give the calibrated lens with {camera}",
                )
        cameras[k] = replace(like, rotation=pose.rotation.matrix(), translation=np.asarray(pose.translation))
    points = list(model.points3D.values())
    xyz = np.array([point.xyz for point in points])
    seen_by = [[int(model.image(e.image_id).name) for e in point.track.elements] for point in points]
    found = CameraPoses(
        tuple(cameras),
        xyz,
        np.array([len(set(each)) for each in seen_by], np.int32),
        float(model.compute_mean_reprojection_error()),
        _median_angle(xyz, seen_by, cameras),
    )
    if found.angle_deg < MIN_ANGLE_DEG:
        raise InputError(
            f"the photos were taken from nearly the same place: their rays meet at {found.angle_deg:.1f} degrees, "
            "which tells no depth; walk around the sheet, so that each photo looks from another side, 20 to 40 degrees "
            "off the vertical"
        )
    return found


def folds(camera: Camera) -> bool:
    """Whether a lens shows one place twice, which no lens does: r (1 + k1 r^2 + k2 r^4) falls within the photo.

    Examples
    --------
    >>> matrix = np.array([[900.0, 0, 360], [0, 900, 288], [0, 0, 1]])
    >>> lens = Camera(matrix, np.eye(3), np.zeros(3), (576, 720), np.array([0.03, -0.02, 0, 0]))
    >>> folds(lens), folds(replace(lens, distortion=np.array([-0.24, -6.8, 0, 0])))
    (False, True)
    """
    rows, cols = camera.shape_rc
    k1, k2 = camera.distortion[:2]
    x, y = (max(c, n - 1 - c) / camera.matrix[0, 0] for c, n in zip(camera.matrix[:2, 2], (cols, rows), strict=True))
    square = np.linspace(0, x**2 + y**2, 100)
    return bool((1 + 3 * k1 * square + 5 * k2 * square**2 <= 0).any())


def _median_angle(points: Floats, seen_by: Sequence[Sequence[int]], cameras: Sequence[Camera | None]) -> float:
    """Median of the largest angle [degrees] between two rays to a point."""
    eyes = np.array([np.full(3, np.nan) if c is None else camera_position(c) for c in cameras])
    some = range(0, len(points), max(1, len(points) // 2000))
    angles = []
    for k in some:
        rays = eyes[list(seen_by[k])] - points[k]
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        angles.append(np.arccos(np.clip((rays @ rays.T).min(), -1, 1)))
    return float(np.degrees(np.median(angles)))
