"""Checks of what users give: arrays of the right kind and shape, or one sentence that says what was found."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError
from planish.types.arrays import Bools, Floats, Ints, Pixels, frozen_copy

_ROUNDING = 1e-6
"""How far floating photos may lie outside 0 to 1: rounding of float32."""

_LEAST_PHOTO = 8
"""Least side of a photo whose places are checked: of fewer pixels a sheet may fill one."""


_FARTHEST_PX = 1e12
"""Beyond, numbers of 64 bits are no longer good to a ten-thousandth of a pixel, and their squares overflow soon."""


def check_points(given: object) -> Floats:
    """Points as (n, 3) float64, read-only.

    Raises
    ------
    InputError
        For another shape, and for masked, object or other arrays that are no real numbers.
    """
    array = _numbers(given, "points", "an array of points (n, 3)")
    if not array.size:
        return _frozen(np.zeros((0, 3)))
    if array.ndim != 2 or array.shape[1] != 3:
        found = f"points have the shape {array.shape}; (n, 3) is wanted, x y z of every point"
        if array.ndim == 2 and array.shape[0] == 3:
            raise InputError(found, "transpose the array: points.T")
        if array.ndim == 2 and array.shape[1] == 2:
            raise InputError(found, "a scan needs the third coordinate")
        raise InputError(found)
    return frozen_copy(array.astype(np.float64, copy=False), given)


def check_faces(given: object, points: int) -> Ints:
    """Triangles as (m, 3) int32, read-only.

    Parameters
    ----------
    given : array_like
    points : int
        How many points there are.

    Raises
    ------
    InputError
        For quads or another shape, for numbers that are not whole, and for indices that no point has.
    """
    array = _numbers(given, "faces", "an array of faces (m, 3)")
    if not array.size:
        return _frozen(np.zeros((0, 3), np.int32))
    if array.dtype.kind == "f":
        raise InputError(f"faces are {array.dtype}; whole numbers are wanted, rows of points counted from 0")
    if array.ndim != 2 or array.shape[1] != 3:
        found = f"faces have the shape {array.shape}; (m, 3) is wanted, three points of every triangle"
        if array.ndim == 2 and array.shape[1] == 4:
            raise InputError(found, "split each of these quads into two triangles")
        if array.ndim == 2 and array.shape[0] == 3:
            raise InputError(found, "transpose the array: faces.T")
        raise InputError(found)
    if array.min() < 0 or array.max() >= points:  # before the cast to int32, which would wrap around
        beyond = (array < 0) | (array >= points)
        row = int(np.argmax(beyond.any(axis=1)))
        index = int(array[row, np.argmax(beyond[row])])
        raise InputError(f"face {row} uses point {index}, but there are {points:,} points (both counted from 0)")
    return frozen_copy(array.astype(np.int32, copy=False), given)


def check_photo(given: object) -> Pixels:
    """A photo as (rows, cols, 3) uint8 or uint16, read-only.

    Grey (rows, cols) becomes three equal channels; floats from 0 to 1 become uint16, so that nothing is lost.

    Raises
    ------
    InputError
        For another shape or type, or floats outside 0 to 1.
    """
    array = _numbers(given, "the photo", "an image (rows, cols, 3) or (rows, cols)")
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[..., 0]
    if array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] != 3) or not array.size:
        found = f"the photo has the shape {array.shape}; (rows, cols, 3) or (rows, cols) is wanted"
        if array.ndim == 3 and array.shape[2] == 4:
            raise InputError(found, "leave out the alpha channel: photo[..., :3]")
        if array.ndim == 3 and array.shape[0] == 3:
            raise InputError(found, "put the channels last: photo.transpose(1, 2, 0)")
        raise InputError(found)
    if array.dtype.kind == "f":
        low, high = float(array.min()), float(array.max())
        if not (low >= -_ROUNDING and high <= 1 + _ROUNDING):  # so that NaN is refused as well
            raise InputError(
                f"the photo holds {array.dtype} from {low:g} to {high:g}; floats from 0 to 1 are wanted, or uint8 or "
                "uint16"
            )
        array = np.round(np.clip(array, 0, 1) * 65535).astype(np.uint16)
    elif array.dtype not in (np.uint8, np.uint16):
        raise InputError(f"the photo is {array.dtype}; uint8, uint16, or floats from 0 to 1 are wanted")
    return frozen_copy(array if array.ndim == 3 else np.repeat(array[..., None], 3, axis=2), given)


def check_photo_xy(given: object, points: int, faces: int) -> Floats:
    """Places on the photo as (n, 2) per point or (m, 3, 2) per face corner, float64, read-only.

    Raises
    ------
    InputError
        For another shape, or numbers that are not real.
    """
    array = _numbers(given, "photo_xy", "an array of places")
    if array.shape not in ((points, 2), (faces, 3, 2)):
        raise InputError(
            f"photo_xy has the shape {array.shape}; wanted is ({points}, 2), x y of every point, or ({faces}, 3, 2), "
            "x y of every corner of every face"
        )
    return frozen_copy(known_places(array.astype(np.float64, copy=False)), given)


def known_places(photo_xy: Floats) -> Floats:
    """Places on a photo (..., 2), with NaN for those that are no numbers or absurdly far from any photo.

    Examples
    --------
    >>> known_places(np.array([[3.0, 4.0], [np.inf, 0.0], [7.0, -1e300]])).tolist()
    [[3.0, 4.0], [nan, nan], [nan, nan]]
    """
    with np.errstate(invalid="ignore"):
        known = (np.abs(photo_xy) < _FARTHEST_PX).all(axis=-1, keepdims=True)
    return photo_xy if known.all() else np.where(known, photo_xy, np.nan)


def check_sides(given: object) -> tuple[float, float]:
    """Two sides of a sheet in mm.

    Raises
    ------
    InputError
        If they are not two numbers above 0.

    Examples
    --------
    >>> check_sides([210, 297])
    (210.0, 297.0)
    """
    try:
        sides = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        sides = np.zeros(0)
    if sides.shape != (2,) or not (np.isfinite(sides) & (sides > 0)).all():
        raise InputError(f"paper_mm is {given!r}; wanted are two sides in mm, above 0")
    return float(sides[0]), float(sides[1])


def check_view(given: object) -> Floats:
    """A view from afar: (2, 4), column and row as functions of (x, y, z, 1).

    Raises
    ------
    InputError
        If it is of another shape, not finite, or flat: its directions of column and row must differ.
    """
    try:
        view = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        view = np.zeros(0)
    if view.shape != (2, 4) or not np.isfinite(view).all() or not np.cross(view[0, :3], view[1, :3]).any():
        raise InputError("sheet_view is wanted as (2, 4) finite numbers that map (x, y, z, 1) to column and row")
    return frozen_copy(view, given)


def check_mask(given: object) -> Bools:
    """The mask of a sheet as (rows, cols) bool, read-only: true where it is not 0.

    Raises
    ------
    InputError
        For another shape, or a mask that is 0 all over.
    """
    is_bool = isinstance(given, np.ndarray) and given.dtype == bool
    array = np.asarray(given) if is_bool else _numbers(given, "the mask of the sheet", "an image (rows, cols)")
    if array.ndim == 3:
        array = np.asarray(array.any(axis=2))
    if array.ndim != 2 or not array.size:
        raise InputError(f"the mask of the sheet has the shape {array.shape}; (rows, cols) is wanted")
    if not array.any():
        raise InputError("the mask of the sheet is black all over; paint it white where the sheet is")
    return frozen_copy(array.astype(bool, copy=False), given)


def check_places_on(photo: Pixels, photo_xy: Floats) -> None:
    """Refuse places that cannot be pixels of a photo.

    Raises
    ------
    InputError
        Where they are texture coordinates from 0 to 1, or none lies on the photo.
    """
    places = photo_xy[np.isfinite(photo_xy).all(axis=-1)]
    rows, cols = photo.shape[:2]
    if not len(places) or min(rows, cols) < _LEAST_PHOTO:
        return
    low, high = places.min(axis=0), places.max(axis=0)
    if low.min() >= 0 and high.max() <= 1 and len(places) > 3:
        raise InputError(
            f"photo_xy runs from {low.min():g} to {high.max():g}, but the photo is {cols} x {rows} pixels; pixels are "
            "wanted, x right and y down",
            "of texture coordinates: (u * columns - 0.5, (1 - v) * rows - 0.5)",
        )
    if not ((places > -1) & (places < [cols, rows])).all(axis=1).any():
        raise InputError(
            f"no part of the sheet falls on the photo: photo_xy runs from ({low[0]:.0f}, {low[1]:.0f}) to "
            f"({high[0]:.0f}, {high[1]:.0f}), and the photo is {cols} x {rows} pixels"
        )


def check_camera_size(photo: Pixels, shape_rc: tuple[int, int]) -> None:
    """Refuse a camera whose numbers are for a photo of another size.

    Raises
    ------
    InputError
    """
    if photo.shape[:2] != tuple(shape_rc):
        raise InputError(
            f"the photo is {photo.shape[1]} x {photo.shape[0]} pixels, but the camera is for one of {shape_rc[1]} x "
            f"{shape_rc[0]}; give the camera of this photo"
        )


def check_place(given: object, what: str) -> Floats:
    """A place in space as (3,) float64, read-only.

    Raises
    ------
    InputError
        For anything but three finite numbers.
    """
    array = _numbers(given, what, "a place (x, y, z)")
    if array.size != 3 or not np.isfinite(array).all():
        raise InputError(f"{what} is {array.tolist()}; three finite numbers are wanted, x y z")
    return frozen_copy(array.astype(np.float64, copy=False).ravel(), given)


def _numbers(given: object, what: str, wanted: str) -> NDArray[Any]:
    """Real numbers as a plain array."""
    if isinstance(given, np.ma.MaskedArray):
        raise InputError(f"{what} came as a masked array; {wanted} is wanted", "fill it: array.filled()")
    try:
        array = np.asarray(given)
    except ValueError:  # rows of different lengths
        raise InputError(f"{what} came as rows of different lengths; {wanted} is wanted") from None
    if array.dtype.kind not in "iuf":
        found = f"an array of {array.dtype}" if array.ndim else f"a {type(given).__name__}"
        raise InputError(f"{what} came as {found}; {wanted} of numbers is wanted")
    return array


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array.flags.writeable = False
    return array
