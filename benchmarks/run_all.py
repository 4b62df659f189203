"""Run every benchmark and write docs/benchmarks-*.md from what they print: python benchmarks/run_all.py [NAME ...].

With names (the scripts' stems) only those sections are made anew; the others stay as they are.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
DOCS = HERE.parent / "docs"
HEAD = """# {title}

How the tables are made, and how to read them: [benchmarks](benchmarks.md).
"""

PAGES = {
    "benchmarks-flattening.md": (
        "Benchmarks: flattening",
        "paper_table stability rest_lengths flattening unwrapping segment discs sensitivity random_sheets",
    ),
    "benchmarks-noise.md": ("Benchmarks: noise and the expected error", "noise expected_error"),
    "benchmarks-pages.md": (
        "Benchmarks: pages",
        "restored_pages pages compare page_sense binarized sharpness shading colours curled_map",
    ),
    "benchmarks-devices.md": ("Benchmarks: devices and photos", "acquire laser photo photos photo_field"),
    "benchmarks-verdicts.md": (
        "Benchmarks: verdicts, and scans of others",
        "verdicts surroundings cases batch batch_of_ten_thousand",
    ),
}
"""Title and sections of every page, in their order. Sections that are not in `SECTIONS` are written by hand."""

SECTIONS = {
    "paper_table": (
        "The paper's Table 1",
        "The paper flattened two documents, reduced to 1,000 points, in 28 and 30 s (Pentium III, 996 MHz; bending "
        "sticks and flattening). Below the same particle system, with the paper's bending sticks (straight) and with "
        "unfolded ones. With all points the particle system is far from settled after the steps it was given: a "
        "push travels one stick a round, so steps grow with the square of the points along a side. That is what "
        "the `multigrid` method is for.",
    ),
    "stability": (
        "How large a step each particle system bears",
        "Brown & Seales' masses and springs, moved by explicit Euler steps, beside the paper's sticks, moved by "
        "Verlet's and by Euler's; 1,000 points. Explicit steps burst springs as soon as dt exceeds damping "
        "sqrt(m / k); sticks never burst, by either step. "
        "![How each run ended, over time step and stiffness](stability.png)",
        "--picture docs/stability.png",
    ),
    "restored_pages": (
        "Restored pages, start to end",
        "`planish restore` with default settings, 300 dpi. The character error is Tesseract's.",
    ),
    "pages": (
        "Restored pages beside the true ones",
        "`planish restore` with default settings, 300 dpi. Cells with three figures: page / the same drawn through the "
        "true geometry / the raw photo. Networks that flatten a single photo reach MS-SSIM 0.54 to 0.58 on their own "
        "benchmark of real photos; without a scan they have less to go on, so the figures do not compare.",
    ),
    "compare": (
        "Every method on the same pages",
        "planish with a scan and with the photo alone, and others that flatten a photo. ![Their pages](comparison.jpg)",
        "--picture docs/comparison.jpg",
    ),
    "photo": (
        "A page from one photo",
        "Sheets of the gallery, photographed virtually; with a folder of real photos the script makes the tables of "
        "[A page from one photo](photo.md).",
    ),
    "photos": (
        "A page from several photos",
        "Sheets of the gallery on a wooden table, a card of 40 mm beside them, from ten virtual photos of a phone with "
        "7 megapixels; one sheet from more and fewer, and with useless ones among them; and what one photo gives.",
    ),
    "shading": (
        "Shade removed",
        "How far the grey of blank paper runs (10 % to 90 % quantile, in percent of the median) over the page and "
        "within 10 mm of creases; how far a printed picture's mean grey and a stamp's colour are from the true ones. "
        "Each cell: by geometry / from the background alone / not removed.",
    ),
    "colours": (
        "Colours kept",
        "A chart of 24 patches and a grey picture, printed on bent sheets: CIEDE2000 to the colour in print, median / "
        "95 %, of the patches, then of the picture. The default of `restore` is geometry, that of `photo` background. "
        "White is the paper, black the ink: pages of planish as they are, the photo and pages of others scaled.",
    ),
    "acquire": (
        "From light to scan",
        "Virtual devices before the page of a bound book: how true the surface is, and the page restored from it. The "
        "depth camera has 640 x 480 pixels and a photo of 3 megapixels, the Gray code a camera of 1280 x 1024 and a "
        "projector of 1280 x 800 pixels; its photo is that of the same camera. The range image has 640 x 480 points "
        "and a colour for each; the photogrammetry cloud 300,000 points on the sheet in random places, with errors in "
        "all directions, strays, and the table around, and its photo 12 megapixels.",
    ),
    "laser": (
        "Laser lines",
        "A virtual laser over the book page: swept, with and without the print divided out, and two fixed lines.",
    ),
    "expected_error": (
        "The error that the report expects",
        "`flatten.expected_error_mm` beside the true error. Noise that is alike over several points of the scan can "
        "hardly be told from the surface: where it is not noticed at all, it is underestimated.",
    ),
    "page_sense": (
        "The page's sides, its way up, its spine, its files",
        "Archives ask for text level to 0.1 degree and for a page of true size. Stray points are those that a scanner "
        "sets beside an edge.",
    ),
    "binarized": (
        "Black and white",
        "F1 of ink by method, on pages whose lower half is printed fainter, as the photo shows them (shaded) and after "
        "their shade was removed (even). nick is the default since it keeps faint print beside black print.",
    ),
    "sharpness": (
        "Sharpness of the page",
        "A slanted edge drawn through a random mesh: how much of the photo's MTF50 is left (at most a tenth may be "
        "lost at equal resolution); and a photo of one grey, which must not show the mesh.",
    ),
    "curled_map": (
        "A real map, from one photo and from six",
        "A printed map curled into two waves (Perriollat and Bartoli 2007), 720 x 576 pixels a photo; each misses "
        "the far sides of the waves. The border of the print is a rectangle in truth. What the blended page has of it "
        "is what the scanned surface has: its left side is 1.9 % shorter than its right one measured in space, so the "
        "reconstruction, not the flattening, keeps it from the 0.7 % hoped for. A photo's pixel is 0.6 to 1.4 mm of "
        "paper; cameras and surface agree to about a third of that.",
    ),
    "batch": (
        "A batch of 200 scans",
        "`planish batch` with ten bad scans among them: 5,000 points, 1 megapixel and 50 dpi, so that it is quick. "
        "Every run but the first is compared with it, byte for byte apart from times; CPU and memory are of one page.",
    ),
    "batch_of_ten_thousand": (
        "A batch of ten thousand",
        "Work of the coordinating process, without the restorations.",
    ),
    "noise": (
        "Noise of every kind",
        "Virtual scans of 200,000 points with the errors of real scanners, from bare points and faces; other ways to "
        "flatten on the same, smaller scans; and real captures, where `../shared` is beside the checkout. White noise "
        "is every point's own; shared noise is blurred by a Gaussian over so many points.",
    ),
    "rest_lengths": (
        "Rest lengths in spite of noise",
        "The sticks' energy solved exactly, so that only the rest lengths are judged. Floor: lengths along the true "
        "surface between the noisy points, which nobody can better without moving points.",
    ),
    "flattening": (
        "Flattening, beside others",
        "Irregular meshes in random order. Seconds from points and faces to places: topology, memory order, rest "
        "lengths, sticks, hierarchy and solving. SLIM and ARAP take minutes at 300,000 points (by `--heavy`). With "
        "noise in all directions 0.071 mm is what the points themselves are off along the sheet.",
        "--points 100000 300000 --peers LSCM",
    ),
    "unwrapping": (
        "Unwrapping a mesh, from file to file",
        "A random mesh of a book page as OBJ, to an OBJ with texture coordinates, with the distortion of every "
        "triangle. Clock, processors and greatest memory of the whole process, Python's start included; kernels were "
        "compiled before. Where the machine is shared, the seconds of the processors say more than those of the "
        "clock. Noise is the same in all directions; on points so near to each other it strains edges by percents, so "
        "that planish calls these pages not good, though they are 0.075 mm off.",
        "--slim 100000 300000",
    ),
    "sensitivity": (
        "What hangs on each threshold",
        "Every constant that something is compared with, halved and doubled, one at a time. Those with which nothing "
        "changes are not tuned to these sheets. Where half or twice spoils a sheet, the value is tuned: the comment "
        "beside it must say what it rests on. Shown are some that decide whether noise is there, which way up a page "
        "is, where a book is split and what is paper; without names all are tried, with `--rooms` those of some rooms. "
        "None of the sheets has spikes, so that `FAR_OFF` is not put to the test here.",
        "BUCKLED STEEP SIZE_SETTLED FAR_OFF FARTHEST MIN_REGULAR SURE TEXT_LINES MIN_TURN_DEG MIN_AGREEMENT MAX_ASIDE "
        "MIN_CONTRAST --rooms surface geometry document",
    ),
    "verdicts": (
        "Verdicts",
        "What every page is called (see [the verdict](errors.md#the-verdict)), beside what is true: sheets of the "
        "gallery, alone and on tables, some with faults; and captures that nobody here made, where `../shared` is "
        "beside the checkout. Wrong is a page called good that is off by more than 2 %, one called not good that is "
        "within 0.5 %, and any other word than those that a person who saw the page would use. What the verdict cannot "
        "know: whether the scan itself has the whole sheet.",
    ),
    "random_sheets": (
        "Ten thousand random sheets",
        "White noise on some, and on every second sheet shared noise, ripple, steps and spikes mixed; holes, cuts, odd "
        "outlines, slivers, flipped and doubled faces, points that are no numbers. None ended without an answer, with "
        "a place that is not finite, or with a flipped face or an overlap that the report does not have. OUT_OF_STEPS "
        "were still moving by more than the tolerance after 100 steps.",
    ),
}


def main() -> None:
    asked = sys.argv[1:] or [name for name in SECTIONS if (HERE / f"{name}.py").exists()]
    for page, (title, names) in PAGES.items():
        path = DOCS / page
        kept = sections(path.read_text()) if path.exists() else {}
        for name in [name for name in asked if name in names.split()]:
            kept[name] = measured(name)
            path.write_text(page_text(title, names, kept))


def sections(page: str) -> dict[str, str]:
    """The sections of a page, by name."""
    return dict(re.findall(r"<!-- (\w+) -->\n(.*?)(?=<!-- |\Z)", page, re.S))


def measured(name: str) -> str:
    """A section of a page, from what its script prints now."""
    title, prose, *flags = SECTIONS[name]
    print(f"{name} ...", flush=True)
    command = [f"{HERE / name}.py", *" ".join(flags).split()]
    said = subprocess.run([sys.executable, *command], capture_output=True, text=True, check=True)
    shown = " ".join(["python", f"benchmarks/{name}.py", *flags])
    return f"## {title}\n\n{prose}\n\n    {shown}\n\n{said.stdout.strip()}\n\n"


def page_text(title: str, names: str, kept: dict[str, str]) -> str:
    """A page from those of its sections that there are."""
    parts = [f"\n<!-- {name} -->\n{kept[name].rstrip()}\n" for name in names.split() if name in kept]
    return HEAD.format(title=title) + "".join(parts)


if __name__ == "__main__":
    main()
