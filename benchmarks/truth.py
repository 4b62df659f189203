"""Comparing a flat sheet, or its text, with the true one."""

import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image


def rigid_rms(page_xy: np.ndarray, truth_xy: np.ndarray) -> float:
    """Root mean square distance [mm] after the best turn, shift and, if need be, mirroring; never a scaling."""
    a, b = page_xy - page_xy.mean(0), truth_xy - truth_xy.mean(0)
    best = np.inf
    for mirror in (1, -1):
        u, _, vt = np.linalg.svd((a * [1, mirror]).T @ b)
        turn = u @ np.diag([1, np.sign(np.linalg.det(u @ vt))]) @ vt
        best = min(best, float(np.sqrt((((a * [1, mirror]) @ turn - b) ** 2).sum(1).mean())))
    return best


def read_text(image: Path) -> str:
    """What Tesseract reads on a page, white space squeezed."""
    with Image.open(image) as page, tempfile.NamedTemporaryFile(suffix=".png") as grey:
        page.convert("L").save(grey.name, dpi=page.info.get("dpi", (300, 300)))
        command = ["tesseract", grey.name, "-", "--psm", "3", "-l", "eng"]
        said = subprocess.run(
            command, capture_output=True, text=True, check=True, env={**os.environ, "OMP_THREAD_LIMIT": "1"}
        )
    return " ".join(said.stdout.split())


def character_error(text: str, true: str) -> float:
    """Edits (Levenshtein) that turn one text into the other, per character of the true one."""
    a, b = (np.frombuffer(t.encode("utf-32-le"), np.uint32) for t in (text, true))
    at = np.arange(len(b) + 1)
    row = at.copy()
    for i, letter in enumerate(a, 1):
        best = np.concatenate([[i], np.minimum(row[:-1] + (b != letter), row[1:] + 1)])
        row = np.minimum.accumulate(best - at) + at  # insertions: a running least
    return float(row[-1]) / max(len(b), 1)
