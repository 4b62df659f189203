"""Make the pictures of docs/photos.md from virtual photos: python docs/make_photos_pictures.py."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from planish.gallery import PhotoShoot, photo_shoot, sheet, typeset_sheet

OUT = Path(__file__).parent / "photos"
SMALL = (1600, 1200)
SIDE = 460
INK, FAINT, PHONE, SHEET = (60, 60, 58), (190, 188, 180), (196, 78, 40), (226, 222, 208)


def main() -> None:
    """Ten photos of a letter, where they were taken from, and photos that are no use."""
    OUT.mkdir(exist_ok=True)
    letter = sheet("letter")
    page, _ = typeset_sheet(letter)
    shoot = photo_shoot(letter, page, 10, rng=1, photo_px=SMALL)
    _rows([_smaller(photo, 250) for photo in shoot.photos], 5).save(OUT / "ten-photos.jpg", quality=88)
    _side_by_side(_from_above(shoot), _from_the_side(shoot)).save(OUT / "places.png")
    useless = photo_shoot(letter, page, 1, rng=4, photo_px=SMALL, out_of_focus=1, other_subjects=1)
    cut = useless.photos[0][380:1130, 560:1560]
    bad = [p for p, useful in zip(useless.photos, useless.useful, strict=True) if not useful]
    _rows([_smaller(photo, 400) for photo in (*bad, cut)], 3).save(OUT / "no-use.jpg", quality=88)


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
