"""Several photos of one sheet, with what is known of their cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planish.acquire.photos.scan import SourcePhoto
from planish.errors import InputError, UsageError
from planish.io.cameras import holds_many, read_camera, scaled_camera
from planish.io.exif import focal_length_px
from planish.io.images import Photo, as_stored, read_photo
from planish.io.views import refuse_twice
from planish.types import Camera, Diagnostic, Floats

SUFFIXES = {
    *(".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".bmp", ".jp2", ".ppm"),
    *(".heic", ".heif", ".avif", ".dng", ".nef", ".cr2", ".arw"),
}
"""Of the files of a folder that are taken for photos."""


def photo_files(given: Sequence[Path]) -> list[Path]:
    """The photos that a user named: files as they are, and the photos of folders by name.

    Raises
    ------
    InputError
        If a folder holds no photo, or a file was given twice.
    """
    files: list[Path] = []
    for path in given:
        if path.is_dir():
            found = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
            if not found:
                raise InputError(f"the folder {path} holds no photos")
            files += found
        else:
            files.append(path)
    refuse_twice(files)
    return files


def read_photo_set(
    files: Sequence[Path],
    camera: Path | None = None,
    between: tuple[str, float, float, float, float] | None = None,
) -> tuple[list[SourcePhoto], list[Camera] | None, list[Diagnostic]]:
    """Read photos for `planish.acquire.photos.scan.from_photos`.

    Parameters
    ----------
    files : sequence of Path
    camera : Path, optional
        One calibrated lens that took all of them; or a file with the cameras of all photos by name, with their poses.
    between : (str, float, float, float, float), optional
        Two marked places, as in `PhotoSettings`.

    Returns
    -------
    photos : list of SourcePhoto
        In the orientation of the sensor.
    cameras : list of Camera, or None
        Where their poses are known.
    warnings : list of Diagnostic

    Raises
    ------
    InputError
        If a file cannot be read, or the camera is of another size than the photos.
    UsageError
        If places are marked beside a photo, or in one that is not among them.
    """
    if between is not None and not any(_is_named(file, between[0]) for file in files):
        raise UsageError(f"places were marked in {between[0]}, which is none of the {len(files)} photos")
    warnings: list[Diagnostic] = []
    photos: list[SourcePhoto] = []
    cameras: list[Camera] = []
    posed = camera is not None and holds_many(camera)
    for file in files:
        image = read_photo(file)
        warnings += [note for note in image.warnings if note.code != "exif-orientation-ignored"]
        shape_rc = image.pixels.shape[0], image.pixels.shape[1]
        lens = None
        if camera is not None:
            read = read_camera(camera, file.name, photo_shape=shape_rc, warnings=warnings)
            lens = scaled_camera(read, shape_rc)
            if lens is None:
                raise InputError(
                    f"{camera} is of photos of {read.shape_rc[1]} x {read.shape_rc[0]} pixels, but {file} has "
                    f"{shape_rc[1]} x {shape_rc[0]}"
                )
        if posed:
            assert lens is not None
            cameras.append(lens)
        marked = None if between is None or not _is_named(file, between[0]) else _marked(file, image, between[1:])
        photos.append(
            SourcePhoto(file.name, image.pixels, focal_length_px(file), None if posed else lens, image.icc, marked)
        )
    if cameras or len(photos) < 2 or photos[0].lens is None:
        return photos, cameras or None, warnings
    shared = photos[0].lens  # one lens, not one for each photo
    same = all(photo.pixels.shape == photos[0].pixels.shape for photo in photos)
    return [replace(photo, lens=shared) for photo in photos] if same else photos, None, warnings


def _is_named(file: Path, name: str) -> bool:
    return file == Path(name) or file.name == name


def _marked(file: Path, image: Photo, places: tuple[float, float, float, float]) -> Floats:
    """Two places (2, 2) in a photo's stored pixels."""
    xy = as_stored(np.array(places).reshape(2, 2), image)
    rows, cols = image.pixels.shape[:2]
    if not ((xy >= 0) & (xy <= [cols - 1, rows - 1])).all():
        shown = f"{rows} x {cols}" if image.orientation >= 5 else f"{cols} x {rows}"
        raise UsageError(f"a place was marked beside {file}, which is shown with {shown} pixels")
    return xy
