"""Shade removed under many lights, with the geometry, without it, and not at all: python benchmarks/shading.py.

Sheets of the gallery are scanned virtually (0.05 mm of noise, 12 megapixels) and drawn at 300 dpi through the true
geometry, so that only the light is judged; the normals are those of the noisy scan. Each cell of the table reads
geometry / background / none.

paper: how far the grey of blank paper runs, from its 10 % to its 90 % quantile, in percent of its median, before white
is clipped. Blank is what is white on the true page, 1.2 mm from print and 2 mm from the edge; its grey (code values) is
taken over squares of 1 mm, so that the sensor's grain is not measured; what the photo clipped is left out, as nobody
knows how bright it was. creases: the same within 10 mm of where
the sheet turns by 2.2 degrees a millimetre or more. picture: mean grey of the printed picture against its true one;
`grey half` is the worst for a method that looks at brightness alone, one even grey over the lower half of the page.
stamp: distance of the red stamp's mean colour from the true one in CIE Lab (CIE76, D65), inside its strokes.
`leaves light each other` adds what paper sends on to paper, once (diffuse, reflectance 0.8), most at the spine.
Prints a Markdown table.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter

import cv2
import numpy as np

from machine import machine
from planish.color import code_values, linear_light
from planish.gallery import Light, Sheet, VirtualScan, sheet, typeset_page, virtual_scan
from planish.gallery.light import irradiance
from planish.gallery.sheets import normals
from planish.illumination import EvenlyLit, remove_shading
from planish.mesh import repair as repair
from planish.render import draw
from planish.settings import ShadingSettings
from planish.surface import smooth_normals
from planish.types import Floats, Page

GAMMA = 2.2
LAMP = Light()
LIGHTS: dict[str, tuple[Light, ...]] = {
    "lamp near": (LAMP,),
    "lamp from the side": (Light(position_mm=(420.0, 60.0, 260.0), ambient=0.1),),
    "two lamps": (Light(position_mm=(330.0, 40.0, 380.0), ambient=0.1), Light(position_mm=(-260.0, 120.0, 420.0))),
    "half from all around": (Light(ambient=1.0),),
    "vignette": (LAMP,),
    "warm": (LAMP,),
    "overexposed": (replace(LAMP, exposure=1.15),),
}
TINTS = {"warm": (1.0, 0.86, 0.62)}
BOUNCE = "leaves light each other"
LIGHTS[BOUNCE] = (LAMP,)
VIGNETTE = 0.35
"""Light of the photo's corners with that light is (1 + VIGNETTE) ** -2 of its middle's."""

CASES = (
    *((name, "lamp near", "text") for name in ("book", "spread", "wave", "miura", "curl", "letter")),
    *((name, "lamp from the side", "text") for name in ("book", "spread", "letter")),
    *(("book", light, "text") for light in ("two lamps", "half from all around", "vignette", "warm", "overexposed")),
    ("spread", BOUNCE, "text"),
    *((name, "lamp near", "picture, stamp") for name in ("book", "spread", "wave", "letter", "flat")),
    *(("book", light, "picture, stamp") for light in ("lamp from the side", "two lamps", "vignette", "warm")),
    *(("spread", light, "picture, stamp") for light in ("lamp from the side", BOUNCE)),
    *((name, "lamp near", "grey half") for name in ("book", "spread", "wave", "letter")),
    ("book", "lamp from the side", "grey half"),
    ("spread", BOUNCE, "grey half"),
)
METHODS = ("geometry", "background", "none")

GREY, GREY_MARGIN_MM = 150, 12.0
REFLECTANCE, BOUNCE_MM = 0.8, 4.0
SQUARE_MM = 1.0
FROM_PRINT_MM, FROM_EDGE_MM = 1.2, 2.0
CREASE_MM, CREASE_DEG = 10.0, 2.2


@dataclass
class Case:
    made: VirtualScan
    page: Page
    normals: Floats


def scanned(name: str, light: str, print_: str) -> Case:
    """A sheet of the gallery under one of the lights, drawn through the true geometry."""
    bent, printed = sheet(name), None
    if print_ != "text":
        printed = typeset_page(bent.width_mm, bent.height_mm, picture=print_ != "grey half", stamp=True)
    if print_ == "grey half" and printed:
        printed = half_grey(printed[0]), printed[1]
    made = virtual_scan(bent, noise_mm=0.05, printed=printed, light=LIGHTS[light][0])
    photo = np.asarray(made.scan.photo)
    if len(LIGHTS[light]) > 1 or light in ("vignette", *TINTS):
        others = [np.asarray(virtual_scan(bent, printed=printed, light=lamp).scan.photo) for lamp in LIGHTS[light][1:]]
        photo = relit([photo, *others], vignette=VIGNETTE * (light == "vignette"), tint=TINTS.get(light, (1, 1, 1)))
        made = replace(made, scan=replace(made.scan, photo=photo))
    prepared = repair(made.scan)
    found = smooth_normals(made.scan.mesh, prepared.topology)
    page = draw(made.scan, made.truth_xy, (bent.width_mm, bent.height_mm)).page
    return Case(made, bounced(page, bent) if light == BOUNCE else page, found)


def half_grey(page: Page) -> Page:
    """The page with one even grey over its lower half, within margins."""
    pixels = np.array(page.pixels)
    margin = round(GREY_MARGIN_MM * page.dpi / 25.4)
    pixels[len(pixels) // 2 : -margin, margin:-margin] = GREY
    return replace(page, pixels=pixels)


def bounced(page: Page, bent: Sheet) -> Page:
    """The page with the light added that the sheet sends on to itself: E' = E + rho / pi int E cos cos' / d^2 dA.

    Computed between patches of a few millimetres of blank paper; at most as bright as white.
    """
    cols, rows = (round(mm / BOUNCE_MM) for mm in (bent.width_mm, bent.height_mm))
    x, y = np.meshgrid((np.arange(cols) + 0.5) * bent.width_mm / cols, (np.arange(rows) + 0.5) * bent.height_mm / rows)
    places = np.stack([x, y], axis=-1).reshape(-1, 2)
    points, upward = bent.bend(places), normals(bent, places)
    direct = irradiance(LAMP, points, upward, np.ones(len(points)))
    more = np.empty(len(points))
    for i, (at, normal) in enumerate(zip(points, upward, strict=True)):
        way = points - at
        squared = np.maximum((way**2).sum(axis=1), BOUNCE_MM**2)
        leaving, arriving = np.maximum(-(upward * way).sum(axis=1), 0), np.maximum(way @ normal, 0)
        more[i] = REFLECTANCE / np.pi * BOUNCE_MM**2 * (direct * leaving * arriving / squared**2).sum()
    ratio = cv2.resize((1 + more / direct).reshape(rows, cols), page.pixels.shape[1::-1], interpolation=cv2.INTER_CUBIC)
    light = linear_light(256)[np.asarray(page.pixels)] * ratio[..., None]
    codes = code_values(np.dtype(np.uint8))
    return replace(page, pixels=codes[np.rint(65535 * np.clip(light, 0, 1)).astype(np.uint16)])


def relit(photos: list[np.ndarray], *, vignette: float, tint: tuple[float, float, float]) -> np.ndarray:
    """The mean of photos in linear light, through a filter, by a lens that darkens towards its rim."""
    light = sum((p / np.float32(255)) ** GAMMA for p in photos) / len(photos) * np.array(tint, np.float32)
    rows, cols = light.shape[:2]
    y, x = np.mgrid[0:rows, 0:cols].astype(np.float32)
    off_axis = ((x - (cols - 1) / 2) ** 2 + (y - (rows - 1) / 2) ** 2) / ((rows**2 + cols**2) / 4)
    light = light / (1 + vignette * off_axis[..., None]) ** 2
    return np.clip(np.rint(255 * light ** (1 / GAMMA)), 0, 255).astype(np.uint8)


def unevenness(case: Case, made: EvenlyLit | None, where: np.ndarray) -> float:
    """From the 10 % to the 90 % quantile of blank squares' grey, in percent of their median."""
    side = round(SQUARE_MM * case.page.dpi / 25.4)
    light = linear_light(256)[np.asarray(case.page.pixels)]
    rows, cols = (n // side for n in light.shape[:2])
    squares = light[: rows * side, : cols * side].reshape(rows, side, cols, side, 3).mean(axis=(1, 3))
    if made is not None:
        y, x = np.mgrid[0:rows, 0:cols].astype(np.float32)
        middle = [((k + 0.5) * side - 0.5 * made.cell_px) / made.cell_px for k in (x, y)]
        squares = squares / cv2.remap(made.light, *middle, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    grey = (squares @ np.array([0.2126, 0.7152, 0.0722]))[where] ** (1 / GAMMA)
    low, middling, high = np.quantile(grey, [0.1, 0.5, 0.9])
    return float(100 * (high - low) / middling)


def blank(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Squares that are white on the true page and known; and those of them beside a crease."""
    dpi = case.page.dpi
    clipped = np.asarray(case.page.pixels).max(axis=2) == 255
    white = (np.asarray(case.made.page.pixels).min(axis=2) == 255) & case.page.known & ~clipped
    reach, edge = (round(mm * dpi / 25.4) for mm in (FROM_PRINT_MM, FROM_EDGE_MM))
    free = cv2.erode(white.astype(np.uint8), np.ones((2 * reach + 1, 2 * reach + 1)), borderValue=1) > 0
    free[:edge], free[-edge:], free[:, :edge], free[:, -edge:] = False, False, False, False
    side = round(SQUARE_MM * dpi / 25.4)
    rows, cols = (n // side for n in free.shape)
    squares = free[: rows * side, : cols * side].reshape(rows, side, cols, side).all(axis=(1, 3))
    return squares, squares & beside_creases(case.made.sheet, squares.shape, side * 25.4 / dpi)


def beside_creases(bent: Sheet, shape: tuple[int, int], mm: float) -> np.ndarray:
    """Squares within CREASE_MM of a place where the sheet turns by CREASE_DEG a millimetre."""
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]] + 0.5
    around = [np.stack([x + dx, y + dy], axis=-1).reshape(-1, 2) * mm for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1))]
    around = [np.clip(at, 0, [bent.width_mm, bent.height_mm]) for at in around]
    left, right, above, below = (normals(bent, at).reshape(*shape, 3) for at in around)
    turns = [np.degrees(np.linalg.norm(b - a, axis=2)) / (2 * mm) for a, b in ((left, right), (above, below))]
    crease = (np.maximum(*turns) >= CREASE_DEG).astype(np.uint8)
    reach = round(CREASE_MM / mm)
    return cv2.dilate(crease, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))) > 0


def picture_off(true: np.ndarray, pixels: np.ndarray) -> float:
    """Mean grey of the largest printed area against the true one, in percent."""
    printed = cv2.erode((true.min(axis=2) < 250).astype(np.uint8), np.ones((15, 15)))
    _, patch, size, _ = cv2.connectedComponentsWithStats(cv2.dilate(printed, np.ones((15, 15))))
    inside = cv2.erode((patch == 1 + size[1:, cv2.CC_STAT_AREA].argmax()).astype(np.uint8), np.ones((25, 25))) > 0
    return float(100 * (pixels[inside].mean() / true[inside].mean() - 1))


def stamp_off(true: np.ndarray, pixels: np.ndarray) -> float:
    """Distance in Lab of the stamp's mean colour from the true one."""
    red = (true[..., 0].astype(int) - true[..., 1] > 120).astype(np.uint8)
    inside = cv2.erode(red, np.ones((5, 5))) > 0
    return float(np.linalg.norm(lab(pixels[inside]) - lab(true[inside])))


def lab(pixels: np.ndarray) -> np.ndarray:
    """Mean light of sRGB pixels as L*, a*, b*."""
    mean = linear_light(256)[pixels].mean(axis=0).astype(np.float64)
    code = np.where(mean <= 0.0031308, 12.92 * mean, 1.055 * mean ** (1 / 2.4) - 0.055)
    return cv2.cvtColor(code.astype(np.float32)[None, None], cv2.COLOR_RGB2Lab)[0, 0]


def measured(case: Case, method: str) -> list[str]:
    """Paper, creases, picture, stamp under one method."""
    made = removed(case, method) if method != "none" else None
    pixels, true = np.asarray((made or case).page.pixels), np.asarray(case.made.page.pixels)
    paper, creases = blank(case)
    with_stamp = (true[..., 0].astype(int) - true[..., 1] > 120).any()
    with_picture = with_stamp or (true == GREY).mean() > 0.1
    return [
        f"{unevenness(case, made, paper):.2f}",
        f"{unevenness(case, made, creases):.2f}" if creases.sum() > 30 else "",
        f"{picture_off(true, pixels):+.1f}" if with_picture else "",
        f"{stamp_off(true, pixels):.1f}" if with_stamp else "",
    ]


def removed(case: Case, method: str) -> EvenlyLit:
    settings = ShadingSettings(shading=method)
    return remove_shading(case.page, case.made.scan, case.made.truth_xy, case.normals, settings)


def seconds(case: Case) -> float:
    """The least of several runs."""
    taken = []
    for _ in range(8):
        start = perf_counter()
        removed(case, "geometry")
        taken.append(perf_counter() - start)
    return min(taken)


def main() -> None:
    print(machine(), "\n")
    print("| sheet | light | print | paper, % | creases, % | picture, % | stamp, Delta E |")
    print("|---|---|---|---|---|---|---|")
    for name, light, print_ in CASES:
        case = scanned(name, light, print_)
        found = zip(*(measured(case, method) for method in METHODS), strict=True)
        cells = [" / ".join(figures).strip(" /") for figures in found]
        print(f"| {name} | {light} | {print_} | " + " | ".join(cells) + " |", flush=True)
    megapixels = case.page.known.size / 1e6
    print(f"\nThe last of them, {megapixels:.1f} megapixels, took {seconds(case):.2f} s by geometry.")


if __name__ == "__main__":
    main()
