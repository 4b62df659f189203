"""Identify scan, photos and cameras among uploaded files, and check that each matches its file type."""

from __future__ import annotations

import warnings
import zipfile
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from planish.settings import MESH_SUFFIXES, ServeSettings
from planish.web.form import Form
from planish.web.problems import HTTPProblem
from planish.web.unpack import unpack

IMAGES = {
    **dict.fromkeys((".jpg", ".jpeg"), "JPEG"),
    **dict.fromkeys((".heic", ".heif"), "HEIC"),
    ".png": "PNG",
    **dict.fromkeys((".tif", ".tiff"), "TIFF"),
    ".webp": "WebP",
    ".bmp": "BMP",
    **dict.fromkeys((".jp2", ".j2k"), "JPEG 2000"),
    **dict.fromkeys((".ppm", ".pgm", ".pnm"), "PPM"),
}
_TEXT_SUFFIXES = (".obj", ".mtl", ".gltf", ".json")
_COMPANION_SUFFIXES = (".mtl", ".bin", ".json")
_DECODERS = ("JPEG", "PNG", "TIFF", "WEBP", "BMP", "JPEG2000", "PPM")
_TIFXYZ_FILES = {"meta.json", "x.tif", "y.tif", "z.tif"}
_HEAD_BYTES = 1 << 16


@dataclass(frozen=True)
class Upload:
    """A validated upload: names of files in its folder.

    Attributes
    ----------
    scan : str
        File name, or "." for a tifxyz, which is the folder itself; "" where photos alone were sent.
    photo, camera : tuple of str
    title : str
        Name for display.
    """

    scan: str
    photo: tuple[str, ...]
    camera: tuple[str, ...]
    title: str


def inspect_upload(form: Form, folder: Path, limits: ServeSettings) -> Upload:
    """Check all files of an upload, unpack a zip, and identify scan, photos and cameras.

    Raises
    ------
    HTTPProblem
        415 for unsupported file types, 413 if a limit is exceeded, 422 if the files are not exactly one scan.
    """
    files = form.files["scan"]
    if not files:
        raise HTTPProblem(
            422,
            "no scan was sent; send its files as scan: OBJ, PLY, GLB or glTF, several photos of a sheet, or one zip",
        )
    title = files[0].name
    zips = [path for path in files if path.suffix.lower() == ".zip"]
    if zips:
        if len(files) > 1:
            raise HTTPProblem(
                422, f"{zips[0].name!a} was sent with other files; send one zip alone, or files without a zip"
            )
        files = _unpack_zip(zips[0], folder, limits)
    for path in (*files, *form.files["photo"], *form.files["camera"]):
        _check_file(path, limits)
    _check_kinds(form)
    if {path.name for path in files} >= _TIFXYZ_FILES:
        return _upload(".", form.files["photo"], form.files["camera"], title if zips else "tifxyz")
    meshes = [path for path in files if path.suffix.lower() in MESH_SUFFIXES]
    images = [path for path in files if path.suffix.lower() in IMAGES]
    if not meshes and images:
        return _photos(images, [path for path in files if path.suffix.lower() == ".json"], form, title)
    if len(meshes) != 1:
        what = "no mesh is" if not meshes else f"{len(meshes)} meshes are"
        raise HTTPProblem(422, f"{what} among the files; expected one (OBJ, PLY, glTF, STL, ...), or a tifxyz")
    photo, camera = form.files["photo"], form.files["camera"]
    if not photo and not _references_image(meshes[0], files):
        photo, camera = _find_photo_and_camera(files, camera)
    if len(camera) not in (0, 1, len(photo)):
        raise HTTPProblem(
            422, f"{len(photo)} photos but {len(camera)} cameras were sent; send one camera per photo, or one for all"
        )
    return _upload(meshes[0].name, photo, camera, title if zips else meshes[0].name)


def _photos(images: list[Path], camera: list[Path], form: Form, title: str) -> Upload:
    """Photos of one sheet, without a scan."""
    images, camera = [*images, *form.files["photo"]], [*camera, *form.files["camera"]]
    if len(images) == 1 and ({"marker-mm", "distance-mm"} & set(form.values) or camera):
        raise HTTPProblem(
            422,
            "one photo does not show how large a marker or a distance is on a bent sheet, and needs no camera file; "
            "choose the sheet's paper or type its width, or send several photos taken from around",
        )
    if len(camera) > 1:
        raise HTTPProblem(422, f"{len(camera)} files of cameras were sent; send one for all photos, or none")
    return _upload("", images, camera, title if len(form.files["scan"]) == 1 else f"{len(images)} photos")


def _upload(scan: str, photo: list[Path], camera: list[Path], title: str) -> Upload:
    return Upload(scan, tuple(path.name for path in photo), tuple(path.name for path in camera), title)


def _unpack_zip(path: Path, folder: Path, limits: ServeSettings) -> list[Path]:
    if not zipfile.is_zipfile(path):
        raise HTTPProblem(415, f"{path.name} is not a zip file")
    moved = path.rename(folder.parent / "upload.zip")  # the archive may contain a file of its own name
    try:
        return [one for one in unpack(moved, folder, limits) if _keep_or_delete(one)]
    finally:
        moved.unlink()


def _keep_or_delete(path: Path) -> bool:
    """Whether an unpacked file may belong to a scan; others are deleted."""
    keep = path.suffix.lower() in (*MESH_SUFFIXES, *IMAGES, *_COMPANION_SUFFIXES)
    if not keep:
        path.unlink()
    return keep


def _check_file(path: Path, limits: ServeSettings) -> None:
    suffix, name = path.suffix.lower(), ascii(path.name)
    if suffix not in (*MESH_SUFFIXES, *IMAGES, *_COMPANION_SUFFIXES):
        raise HTTPProblem(415, f"{name} has an unsupported file type; send OBJ, PLY, GLB or glTF, photos, or one zip")
    if path.stat().st_size == 0:
        raise HTTPProblem(422, f"{name} is empty (0 bytes); was it copied completely?")
    if suffix in IMAGES:
        _check_image(path, name, limits)
        return
    head = _read_head(path)
    if suffix in _TEXT_SUFFIXES and b"\0" in head:
        raise HTTPProblem(415, f"{name} has the file type of a text but is binary")
    magic = {".ply": (b"ply",), ".glb": (b"glTF",), ".gltf": (b"{",), ".json": (b"{", b"[")}
    if suffix in magic and not head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(magic[suffix]):
        raise HTTPProblem(415, f"{name} is not a valid {suffix[1:].upper()} file")


def _check_image(path: Path, name: str, limits: ServeSettings) -> None:
    """Check an image by its header, without decoding it. What it holds counts, not how its name ends."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
            try:
                width, height = _heic_size(path) if _is_heif(path) else _image_size(path)
            finally:
                Image.MAX_IMAGE_PIXELS = limit
    except HTTPProblem:
        raise
    except Exception:  # decoders raise many classes of exceptions on damaged files
        raise HTTPProblem(415, f"{name} is not a readable image; was it copied completely?") from None
    if width * height > limits.megapixels * 1e6:
        raise HTTPProblem(
            413,
            f"{name} has {width * height / 1e6:.0f} megapixels ({width} x {height}); the limit is "
            f"{limits.megapixels:g}",
        )


def _is_heif(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(8)[4:] == b"ftyp"


def _image_size(path: Path) -> tuple[int, int]:
    with Image.open(path, formats=_DECODERS) as image:
        return image.size


def _heic_size(path: Path) -> tuple[int, int]:
    try:
        import pillow_heif
    except ImportError:
        raise HTTPProblem(
            415, f"{path.name!a} is a HEIC photo, which this service cannot read; save it as JPEG"
        ) from None
    width, height = pillow_heif.open_heif(path).size
    return width, height


def _check_kinds(form: Form) -> None:
    for path in form.files["photo"]:
        if path.suffix.lower() not in IMAGES:
            raise HTTPProblem(415, f"{path.name!a} was sent as photo but is not an image")
    for path in form.files["camera"]:
        if path.suffix.lower() != ".json":
            raise HTTPProblem(415, f"{path.name!a} was sent as camera but is not a JSON file")


def _find_photo_and_camera(files: list[Path], camera: list[Path]) -> tuple[list[Path], list[Path]]:
    """Photos and cameras among the files of a mesh that references no image."""
    images = [path for path in files if path.suffix.lower() in IMAGES]
    camera = camera or [path for path in files if path.suffix.lower() == ".json"]
    return (images if camera or len(images) == 1 else []), camera


def _references_image(mesh: Path, files: list[Path]) -> bool:
    """Whether the mesh file embeds or references an image."""
    suffix = mesh.suffix.lower()
    if suffix == ".obj":
        return any(b"map_" in _read_head(path) for path in files if path.suffix.lower() == ".mtl")
    return suffix != ".ply" or b"TextureFile" in _read_head(mesh)


def _read_head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD_BYTES)
