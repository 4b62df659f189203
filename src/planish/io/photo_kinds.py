"""Photos that Pillow does not read, told by their first bytes: camera raw, HEIC, textures of graphics cards."""

from __future__ import annotations

import io
import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planish.errors import InputError, MissingExtraError, install_command
from planish.memory import check_memory

_OTHERS = {
    b"\xabKTX 20\xbb": "a texture for graphics cards (KTX2)",
    b"\xabKTX 11\xbb": "a texture for graphics cards (KTX)",
    b"DDS ": "a texture for graphics cards (DDS)",
    b"8BPS": "a Photoshop file (PSD)",
    b"%PDF": "a PDF",
    b"GIF8": "a GIF",
    b"v/1\x01": "a depth map or an HDR image (OpenEXR)",
    b"#?RADIANCE": "an HDR image (Radiance)",
}
_HEIF_BRANDS = {b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1"}
_AVIF_BRANDS = {b"avif", b"avis"}
_RAW_STARTS = {
    b"FUJIFILMCCD-RAW": "Fujifilm",
    b"IIRO": "Olympus",
    b"IIRS": "Olympus",
    b"IIU\0": "Panasonic",
    b"FOVb": "Sigma",
}
_NEW_SUBFILE_TYPE, _PHOTOMETRIC, _SUB_IFDS, _DNG_VERSION, _COMPRESSION = 254, 262, 330, 50706, 259
_CFA, _LINEAR_RAW = 32803, 34892
_REDUCED = 1
_MOST_IFDS, _MOST_ENTRIES = 64, 1000


class OtherPhoto(NamedTuple):
    """A photo that another library decodes: what it is, for messages, and the library."""

    said: str
    library: str


def other_kind(name: str, data: bytes) -> OtherPhoto | None:
    """What a file is if Pillow is not to decode it; None for all else.

    Raises
    ------
    InputError
        If it is an image that no library of ours reads.
    """
    for start, said in _OTHERS.items():
        if data.startswith(start):
            raise InputError(f"{name} is {said}; save it as JPEG, PNG or TIFF")
    if data[4:8] == b"ftyp":
        brands = {data[8:12], *(data[at : at + 4] for at in range(16, min(struct.unpack_from(">I", data)[0], 64), 4))}
        if brands & _HEIF_BRANDS and not brands & _AVIF_BRANDS:
            return OtherPhoto("a HEIC photo", "heif")
        if b"crx " in brands:
            return OtherPhoto("a camera's raw photo (Canon CR3)", "raw")
    maker = next((made for start, made in _RAW_STARTS.items() if data.startswith(start)), None)
    if maker:
        return OtherPhoto(f"a camera's raw photo ({maker})", "raw")
    if data[8:10] == b"CR" and data[:2] == b"II":
        return OtherPhoto("a camera's raw photo (Canon CR2)", "raw")
    return OtherPhoto("a camera's raw photo", "raw") if _is_raw_tiff(data) else None


def decode_other(name: str, data: bytes, kind: OtherPhoto) -> tuple[NDArray, bytes | None]:
    """Decode such a photo: pixels (rows, cols, 3) uint8 or uint16, upright, and its colour profile.

    Raises
    ------
    InputError
        If it is damaged.
    MissingExtraError
        If the library is not installed.
    """
    return (_by_heif if kind.library == "heif" else _by_rawpy)(name, data, kind)


def _by_heif(name: str, data: bytes, kind: OtherPhoto) -> tuple[NDArray, bytes | None]:
    try:
        import pillow_heif
    except ImportError:
        raise MissingExtraError(
            f"{name} is {kind.said}; to read it: {install_command('photos')}, or save it as JPEG"
        ) from None
    try:
        file = pillow_heif.open_heif(data, convert_hdr_to_8bit=False)
        width, height = file.size
        check_memory(8.0 * width * height, f"{name} with its {width * height / 1e6:.0f} megapixels", "make it smaller")
        pixels = np.array(file)  # a copy: what it shows is the file's own memory
    except InputError:
        raise
    except Exception as problem:  # whatever the library raises on damaged files
        raise InputError(
            f"{name} is {kind.said}, but damaged or cut short: {' '.join(str(problem).split())[:100]}"
        ) from problem
    return pixels, file.info.get("icc_profile") or None


def _by_rawpy(name: str, data: bytes, kind: OtherPhoto) -> tuple[NDArray, bytes | None]:
    try:
        import rawpy
    except ImportError:
        raise MissingExtraError(
            f"{name} is {kind.said}; to develop it: {install_command('photos')}, or save it as TIFF or JPEG"
        ) from None
    try:
        with rawpy.imread(io.BytesIO(data)) as raw:
            size = raw.sizes
            need = 16.0 * size.raw_width * size.raw_height
            check_memory(need, f"{name} with its {size.raw_width} x {size.raw_height} pixels", "give a smaller photo")
            pixels = raw.postprocess(use_camera_wb=True, output_bps=16, no_auto_bright=True, user_flip=0)
    except InputError:
        raise
    except Exception as problem:  # whatever the library raises on damaged files
        said = problem.args[0] if problem.args else problem
        reason = " ".join((said.decode("ascii", "replace") if isinstance(said, bytes) else str(said)).split())
        raise InputError(
            f"{name} is {kind.said} that cannot be developed ({reason[:100]}); develop it with the camera's program and"
            " save it as TIFF or JPEG"
        ) from problem
    return pixels, None


def _is_raw_tiff(data: bytes) -> bool:
    """Whether a TIFF holds a camera's raw pixels, as DNG, NEF, ARW and others do: its first image is a thumbnail then.

    Told by the tag DNGVersion, a colour filter array or linear raw as photometric interpretation in any directory, or
    by a first directory that is a reduced image with others below it.
    """
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(data[:4])
    if order is None or len(data) < 8:
        return False
    waiting, first = [struct.unpack_from(order + "I", data, 4)[0]], True
    seen: set[int] = set()
    while waiting and len(seen) < _MOST_IFDS:
        at = waiting.pop(0)
        if at in seen or not 8 <= at <= len(data) - 2:
            continue
        seen.add(at)
        tags, following = _directory(data, at, order)
        if _DNG_VERSION in tags or tags.get(_PHOTOMETRIC, [0])[0] in (_CFA, _LINEAR_RAW):
            return True
        below = tags.get(_SUB_IFDS, [])
        if first and below and tags.get(_NEW_SUBFILE_TYPE, [0])[0] & _REDUCED:
            return True
        waiting += [*below, following]
        first = False
    return False


def _directory(data: bytes, at: int, order: str) -> tuple[dict[int, list[int]], int]:
    """The tags of a TIFF's directory that hold short or long numbers, and where the next one is (0: nowhere)."""
    count = min(struct.unpack_from(order + "H", data, at)[0], _MOST_ENTRIES)
    tags: dict[int, list[int]] = {}
    for k in range(count):
        entry = at + 2 + 12 * k
        if entry + 12 > len(data):
            return tags, 0
        tag, kind, number = struct.unpack_from(order + "HHI", data, entry)
        code, size = {1: ("B", 1), 3: ("H", 2), 4: ("I", 4), 13: ("I", 4)}.get(kind, ("", 0))
        if not size or not 0 < number <= _MOST_IFDS:
            continue
        where = entry + 8 if size * number <= 4 else struct.unpack_from(order + "I", data, entry + 8)[0]
        if where + size * number <= len(data):
            tags[tag] = list(struct.unpack_from(f"{order}{number}{code}", data, where))
    end = at + 2 + 12 * count
    return tags, struct.unpack_from(order + "I", data, end)[0] if end + 4 <= len(data) else 0
