"""Make the pictures of docs/photos.md from virtual photos: python docs/make_photos_pictures.py."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from planish import restore
from planish.acquire.photos.scan import SourcePhoto, from_photos
from planish.gallery import PhotoShoot, photo_shoot, sheet, typeset_sheet
from planish.io import way_up
from planish.report import heat_map
from planish.settings import BinarizeSettings, PhotoSettings, RenderSettings, RestoreSettings, ShadingSettings

OUT = Path(__file__).parent / "photos"
SMALL = (1600, 1200)
SIDE = 460
INK, FAINT, PHONE, SHEET = (60, 60, 58), (190, 188, 180), (196, 78, 40), (226, 222, 208)


def main() -> None:
    """Ten photos of a letter, where they were taken from, its page, and photos that are no use."""
    OUT.mkdir(exist_ok=True)
    letter = sheet("letter")
    page, _ = typeset_sheet(letter)
    shoot = photo_shoot(letter, page, 10, rng=1, photo_px=SMALL)
    _rows([_smaller(photo, 250) for photo in shoot.photos], 5).save(OUT / "ten-photos.jpg", quality=88)
    _side_by_side(_from_above(shoot), _from_the_side(shoot)).save(OUT / "places.png")
    _from_photo_to_page(shoot).save(OUT / "page.jpg", quality=88)
    useless = photo_shoot(letter, page, 1, rng=4, photo_px=SMALL, out_of_focus=1, other_subjects=1)
    cut = useless.photos[0][380:1130, 560:1560]
    bad = [p for p, useful in zip(useless.photos, useless.useful, strict=True) if not useful]
    _rows([_smaller(photo, 400) for photo in (*bad, cut)], 3).save(OUT / "no-use.jpg", quality=88)


def _from_photo_to_page(shoot: PhotoShoot) -> Image.Image:
    """One of the photos, turned upright, and the page that all of them give, with what was measured."""
    sources = [SourcePhoto(f"IMG_{k}.jpg", photo) for k, photo in enumerate(shoot.photos)]
    found = from_photos(sources, PhotoSettings(marker_mm=40.0))
    settings = RestoreSettings(
        render=RenderSettings(dpi=150.0),
        shading=ShadingSettings(shading="background"),
        binarize=BinarizeSettings(binarize="none"),
    )
    done = restore(found.acquired.scan, settings, None, way_up)
    page, flat = done.page, done.flattening
    assert page is not None
    faces = found.acquired.scan.mesh.faces
    share = heat_map(flat.page_xy, faces, found.acquired.confidence, flat.size_mm, "1 measured, 0 bridged")
    photo = shoot.photos[2]
    camera = shoot.cameras[2]
    assert camera is not None
    up = camera.rotation @ [0, 1, 0]  # of the page, in the photo: y runs down
    upright = np.rot90(photo, 1 if up[0] > 0 else 3)
    pictures = [Image.fromarray(np.ascontiguousarray(p)) for p in (upright, page.pixels, share)]
    tall = [p.resize((round(p.width * 620 / p.height), 620), Image.Resampling.LANCZOS) for p in pictures]
    whole = Image.new("RGB", (sum(p.width for p in tall) + 32, 620), "white")
    left = 0
    for picture in tall:
        whole.paste(picture, (left, 0))
        left += picture.width + 16
    return whole


def _smaller(photo: NDArray[np.uint8], width: int) -> Image.Image:
    image = Image.fromarray(photo)
    return image.resize((width, round(image.height * width / image.width)), Image.Resampling.LANCZOS)


def _rows(images: list[Image.Image], columns: int, gap: int = 8) -> Image.Image:
    width, height = images[0].size
    rows = -(-len(images) // columns)
    whole = Image.new("RGB", (columns * (width + gap) - gap, rows * (height + gap) - gap), "white")
    for k, image in enumerate(images):
        whole.paste(image, (k % columns * (width + gap), k // columns * (height + gap)))
    return whole


def _side_by_side(left: Image.Image, right: Image.Image) -> Image.Image:
    return _rows([left, right], 2, 16)


def _eyes(shoot: PhotoShoot) -> NDArray[np.float64]:
    return np.array([-camera.rotation.T @ camera.translation for camera in shoot.cameras if camera is not None])


def _panel(title: str) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    image = Image.new("RGB", (SIDE, SIDE), (252, 252, 250))
    draw = ImageDraw.Draw(image)
    draw.text((SIDE / 2, 12), title, INK, ImageFont.load_default(17), anchor="mt")
    return image, draw


def _from_above(shoot: PhotoShoot, scale: float = 0.55) -> Image.Image:
    """Sheet, card and phones on the plane of the table."""
    image, draw = _panel("from above")

    def at(xy: NDArray[np.float64]) -> list[tuple[float, float]]:
        return [(SIDE / 2 + scale * x, SIDE / 2 + 10 - scale * y) for x, y in xy[:, :2]]

    draw.polygon(at(shoot.rim), SHEET, FAINT)
    for card in shoot.cards:
        draw.polygon(at(card.outline), (255, 255, 255), FAINT)
        draw.polygon(at(card.corners), INK)
    for eye in _eyes(shoot):
        (x, y) = at(eye[None])[0]
        draw.ellipse((x - 7, y - 7, x + 7, y + 7), PHONE)
    return image


def _from_the_side(shoot: PhotoShoot, scale: float = 0.55) -> Image.Image:
    """Phones by their distance from the vertical and their height."""
    image, draw = _panel("from the side")
    left, base = SIDE / 2 - 70, SIDE - 60
    draw.line([(20, base), (SIDE - 20, base)], FAINT, 2)
    width = scale * np.ptp(shoot.rim[:, 0]) / 2
    draw.line([(left - width, base - 3), (left + width, base - 3)], INK, 5)
    for degrees in (15, 38):
        angle = np.radians(degrees)
        end = (left + 620 * scale * np.sin(angle), base - 620 * scale * np.cos(angle))
        draw.line([(left, base), end], FAINT, 1)
        draw.text(end, f"{degrees}°", FAINT, ImageFont.load_default(15), anchor="lb")
    for eye in _eyes(shoot):
        x, y = left + scale * np.hypot(*eye[:2]), base - scale * eye[2]
        draw.line([(left, base), (x, y)], (236, 214, 200), 1)
        draw.ellipse((x - 7, y - 7, x + 7, y + 7), PHONE)
    return image


if __name__ == "__main__":
    main()
