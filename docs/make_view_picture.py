"""Draw docs/view.jpg, the page to look at of a folded letter, on its way down: python docs/make_view_picture.py.

Needs Chromium.
"""

import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

import planish
from planish.gallery import sheet, virtual_scan
from planish.view import view_page

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))

from browser import browser  # noqa: E402

SIZE = {"width": 1440, "height": 900}
STEP = 9


def main() -> None:
    """Make the page, look at it, keep what is seen."""
    scan = virtual_scan(sheet("letter"), noise_mm=0.05).scan
    with TemporaryDirectory() as folder, browser() as program:
        path = Path(folder) / "letter.html"
        path.write_bytes(view_page(planish.restore(scan), "A letter folded in three"))
        page = program.new_page(viewport=SIZE)
        page.goto(path.as_uri())
        page.wait_for_selector(":root[data-ready]")
        page.locator("#step").fill(str(STEP))
        page.locator("#step").blur()
        page.evaluate("scrollTo(0, 0)")
        page.wait_for_timeout(1000)
        row = page.locator("#step").bounding_box()
        clip = {"x": 0, "y": 0, "width": SIZE["width"], "height": row["y"] + 38}
        shot = Image.open(BytesIO(page.screenshot(full_page=True, clip=clip)))
    shot.convert("RGB").save(HERE / "view.jpg", quality=82, optimize=True)


if __name__ == "__main__":
    main()
