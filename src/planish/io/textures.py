"""Images that a mesh file names: found on the disk, and which faces show which of them."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np
from numpy.typing import NDArray

from planish.io.polygons import Polygons
from planish.types import Diagnostic, Floats, Ints, freeze

Image = Path | bytes
"""A file, or the bytes of one inside the mesh file."""


@dataclass(frozen=True, eq=False)
class MeshImages:
    """The images of a mesh file.

    Attributes
    ----------
    names : tuple of str
        As the file has them, for messages.
    files : tuple of (Path, bytes or None)
        None where an image is missing.
    of_face : (p,) int32
        Number of the image that each polygon shows; -1 for none.
    warnings : tuple of Diagnostic
        On images that could not be used.
    """

    names: tuple[str, ...]
    files: tuple[Image | None, ...]
    of_face: Ints
    warnings: tuple[Diagnostic, ...] = ()

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def shown(self) -> list[int]:
        """Numbers of the images that faces show, the one with most faces first."""
        counts = np.bincount(self.of_face[self.of_face >= 0], minlength=len(self.names))
        order = np.argsort(-counts, kind="stable")
        return [int(k) for k in order if counts[k]]


def no_images(faces: int) -> MeshImages:
    """The images of a mesh of so many faces that has none."""
    return MeshImages((), (), np.full(faces, -1, np.int32))


def find_beside(path: Path, name: str, inside: Path | None = None) -> Path | None:
    """Find a file that a mesh file names: where it says, else of that name beside the mesh (as after a move).

    A name that is spelled otherwise on the disk is taken where exactly one there is equal after Unicode
    normalisation (NFC) and case folding: Windows and macOS do not tell such names apart, so programs mix them.

    Only within the folder `inside`, where one is given: a mesh from a stranger may name any file of this machine.
    """
    as_posix = name.replace("\\", "/")
    here = (as_posix, PureWindowsPath(name).name)
    for candidate in (path.parent / name, *(path.parent / one for one in here)):
        if _is_allowed(candidate, inside):
            return candidate
    for one in here:
        found = _folded(path.parent, PurePosixPath(one))
        if found is not None and _is_allowed(found, inside):
            return found
    return None


def find_image(path: Path, name: str, inside: Path | None = None) -> tuple[Path | None, list[Diagnostic]]:
    """The image file that a mesh file names, and a warning where there is none."""
    found = find_beside(path, name, inside)
    if found is not None:
        return found, []
    alike = _alike(path.parent, name)
    hint = f"there is {', '.join(alike)}: rename it, or give it as {{photo}}" if alike else ""
    return None, [Diagnostic("image-missing", f"{path} names the image {name}, which does not exist", hint)]


def transformed_uv(polygons: Polygons, faces: NDArray[np.intp], scale: Floats, offset: Floats) -> Polygons:
    """The texture coordinates of some faces (rows of polygons) as uv * scale + offset; they get rows of their own."""
    assert polygons.uv is not None
    assert polygons.uv_corners is not None
    chosen = np.zeros(len(polygons.sizes), bool)
    chosen[faces] = True
    at = np.repeat(chosen, polygons.sizes) & (polygons.uv_corners >= 0)
    rows, place = np.unique(polygons.uv_corners[at], return_inverse=True)
    uv_corners = polygons.uv_corners.copy()
    uv_corners[at] = place.reshape(-1) + len(polygons.uv)
    uv = np.concatenate([polygons.uv, polygons.uv[rows] * scale + offset])
    return replace(polygons, uv=uv, uv_corners=uv_corners)


def _is_allowed(candidate: Path, inside: Path | None) -> bool:
    try:
        return candidate.is_file() and (inside is None or candidate.resolve().is_relative_to(inside.resolve()))
    except (OSError, ValueError):
        return False


def _plain(name: str) -> str:
    """What two spellings of a name have in common."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def _folded(folder: Path, name: PurePosixPath) -> Path | None:
    """The only file below the folder whose path is equal to the name but for case and Unicode form."""
    at = folder
    for part in name.parts:
        if part in (".", ".."):
            at = at / part
            continue
        try:
            same = [entry for entry in at.iterdir() if _plain(entry.name) == _plain(part)]
        except OSError:
            return None
        if len(same) != 1:
            return None
        at = same[0]
    return at


def _alike(folder: Path, name: str) -> list[str]:
    """Files beside the mesh whose names differ from the wanted one by spelling or suffix alone."""
    wanted = PureWindowsPath(name)
    try:
        entries = sorted(entry.name for entry in folder.iterdir() if entry.is_file())
    except OSError:
        return []
    spelled = [entry for entry in entries if _plain(entry) == _plain(wanted.name)]
    stems = [entry for entry in entries if _plain(PurePosixPath(entry).stem) == _plain(wanted.stem)]
    images = [entry for entry in stems if PurePosixPath(entry).suffix.lower() in _IMAGE_SUFFIXES]
    return (spelled or images)[:3]


_IMAGE_SUFFIXES = {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".webp", ".bmp", ".jp2", ".heic", ".avif", ".dng"}
