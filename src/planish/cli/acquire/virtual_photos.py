"""`planish acquire virtual photos`: photos of a sheet from around, as a phone takes them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from planish.gallery import PhotoShoot, Sheet
    from planish.types import Page

COUNT = 10
SMALL_PX = (1600, 1200)


def photos(folder: Path, sheet: Sheet, small: bool) -> Page:
    """Write photos/IMG_0.jpg and so on, with a card of 40 mm beside the sheet, and their true cameras."""
    return write_photo_shoot(folder, sheet, small=small).page


def write_photo_shoot(folder: Path, sheet: Sheet, *, small: bool = False) -> PhotoShoot:
    """The same; returns all that is known about the photos."""
    from planish.gallery import photo_shoot, typeset_sheet
    from planish.gallery.photo_shoot import PHOTO_PX
    from planish.io import make_folder, write_json
    from planish.io.cameras import camera_as_json
    from planish.io.files import write_bytes

    shoot = photo_shoot(sheet, typeset_sheet(sheet)[0], COUNT, rng=0, photo_px=SMALL_PX if small else PHOTO_PX)
    make_folder(folder / "photos")
    names = [f"IMG_{k}.jpg" for k in range(len(shoot.photos))]
    for name, photo in zip(names, shoot.photos, strict=True):
        write_bytes(folder / "photos" / name, phone_jpeg(photo))
    cameras = {name: camera_as_json(camera) for name, camera in zip(names, shoot.cameras, strict=True) if camera}
    write_json(folder / "cameras.json", {"cameras": cameras, "note": "the true cameras of photos/*.jpg, in mm"})
    return shoot


def phone_jpeg(photo: NDArray) -> bytes:
    """JPEG whose EXIF tells the focal length in whole millimetres of 35 mm film, as phones do."""
    import io

    from PIL import Image

    from planish.gallery.photo_shoot import FOCAL

    exif_ifd, focal_35_mm, film_mm = 0x8769, 0xA405, 43.27
    rows, cols = photo.shape[:2]
    exif = Image.Exif()
    exif.get_ifd(exif_ifd)[focal_35_mm] = round(film_mm * FOCAL * cols / (rows**2 + cols**2) ** 0.5)
    file = io.BytesIO()
    Image.fromarray(photo).save(file, "JPEG", quality=92, exif=exif)
    return file.getvalue()
