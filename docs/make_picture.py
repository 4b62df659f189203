"""Make the README's picture, warped photo | scan | restored page, with the program: python docs/make_picture.py."""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from planish.cli.main import run
from planish.io import read_photo
from planish.report import side_by_side


def main() -> None:
    """Run the demo on a bound page and set three of its pictures in a row."""
    with tempfile.TemporaryDirectory() as folder:
        run(["demo", "book", "-o", folder, "--quiet"])
        stages = Path(folder) / "stages"
        pictures = [read_photo(stages / f"{name}.png").pixels for name in ("1-warped", "3-mesh-before", "5-restored")]
    Image.fromarray(np.asarray(side_by_side(pictures, height=560))).save(Path(__file__).parent / "demo.jpg", quality=88)


if __name__ == "__main__":
    main()
