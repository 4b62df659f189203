"""Virtual scans for benchmarks/batch.py, some of them bad, each in its own way."""

import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from planish.gallery import sheet, virtual_scan
from planish.io import write_scan
from planish.types import Mesh, Scan

SHEETS = ("book", "letter", "wave", "curl", "miura", "crumpled", "spread")


def make_scans(folder: Path, scans: int, bad: int, points: int, photo_px: tuple[int, int]) -> None:
    """Write scans in folders of twenty, each with its own rotation and noise; the last ones are bad."""
    names = SHEETS[:scans]
    bases = [virtual_scan(sheet(name), points=points, photo_px=photo_px, noise_mm=0.05).scan for name in names]
    for k in range(scans):
        base = bases[k % len(bases)]
        at = folder / f"box-{k // 20 + 1:02d}" / f"scan-{k + 1:03d}"
        at.mkdir(parents=True)
        rng = np.random.default_rng(k)
        turned = base.mesh.points @ _turn(rng).T + 0.01 * rng.standard_normal(base.mesh.points.shape)
        write_scan(at / "scan.obj", Scan(Mesh(turned, base.mesh.faces), photo=base.photo, photo_xy=base.photo_xy))
        if k >= scans - bad:
            FAULTS[(k - scans) % len(FAULTS)](at / "scan.obj")


def _turn(rng: np.random.Generator) -> np.ndarray:
    """Any rotation in space."""
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return turn * np.sign(np.linalg.det(turn))


def _truncated(scan: Path) -> None:
    scan.write_bytes(scan.read_bytes()[: scan.stat().st_size // 2])


def _nan(scan: Path) -> None:
    lines = [b"v nan nan nan" if line.startswith(b"v ") else line for line in scan.read_bytes().splitlines()]
    scan.write_bytes(b"\n".join(lines) + b"\n")


def _no_photo(scan: Path) -> None:
    for photo in scan.parent.glob("scan.[jp]*g"):
        photo.unlink()


def _empty(scan: Path) -> None:
    scan.write_bytes(b"")


def _no_sheet(scan: Path) -> None:
    """A closed cube."""
    corners = [(x, y, z) for x in (0, 100) for y in (0, 100) for z in (0, 100)]
    sides = ["1 3 7 5", "2 6 8 4", "1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7"]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["vt 0 0"]
    lines += ["f " + " ".join(f"{corner}/1" for corner in side.split()) for side in sides]
    scan.write_text("mtllib scan.mtl\nusemtl scan\n" + "\n".join(lines) + "\n")


def _huge_photo(scan: Path) -> None:
    """A PNG of a few bytes whose header says 60,000 x 60,000 pixels."""
    chunks = b"IHDR" + (60_000).to_bytes(4, "big") * 2 + bytes([8, 2, 0, 0, 0]), b"IDAT"
    parts = [(len(chunk) - 4).to_bytes(4, "big") + chunk + zlib.crc32(chunk).to_bytes(4, "big") for chunk in chunks]
    next(scan.parent.glob("scan.[jp]*g")).write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))


def _no_mesh(scan: Path) -> None:
    scan.write_bytes(bytes(range(256)) * 100)


def _index_beyond(scan: Path) -> None:
    scan.write_bytes(scan.read_bytes() + b"f 1/1 2/2 9999999/3\n")


def _no_faces(scan: Path) -> None:
    lines = [line for line in scan.read_bytes().splitlines() if not line.startswith(b"f ")]
    scan.write_bytes(b"\n".join(lines) + b"\n")


def _dangling(scan: Path) -> None:
    scan.unlink()
    scan.symlink_to("moved-away.obj")


FAULTS: tuple[Callable[[Path], None], ...] = (
    _truncated,
    _nan,
    _no_photo,
    _empty,
    _no_sheet,
    _huge_photo,
    _no_mesh,
    _index_beyond,
    _no_faces,
    _dangling,
)
