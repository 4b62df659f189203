"""Make the pictures of docs/gallery.md, warped photo | scan | restored page: python docs/make_gallery.py."""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from planish.cli.acquire.virtual_files import SHEETS
from planish.cli.main import run
from planish.io import read_photo
from planish.report import side_by_side


def main() -> None:
    """Run the demo on each of its sheets and set three of its pictures in a row."""
    out = Path(__file__).parent / "gallery"
    out.mkdir(exist_ok=True)
    for sheet in SHEETS:
        with tempfile.TemporaryDirectory() as folder:
            run(["demo", sheet, "-o", folder, "--quiet"])
            stages = Path(folder) / "stages"
            names = ("1-warped", "3-mesh-before", "5-restored")
            pictures = [read_photo(stages / f"{name}.png").pixels for name in names]
        Image.fromarray(np.asarray(side_by_side(pictures, height=480))).save(out / f"{sheet}.jpg", quality=85)


if __name__ == "__main__":
    main()
