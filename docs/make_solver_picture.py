"""Make docs/solver.png, what goes on inside the default method: python docs/make_solver_picture.py."""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from planish.flattening import to_page_frame
from planish.flattening.clusters import lay_out_clusters
from planish.flattening.initial_layout import apply_face_flips, initial_layout
from planish.flattening.stick_solver import solve_sticks
from planish.gallery import sheet, sheet_mesh
from planish.mesh import topology
from planish.parallel import thread_pool
from planish.report.drawing import Sheet
from planish.report.heat import coloured, over_page
from planish.sticks import make_sticks

POINTS, ROWS, WIDE = 100_000, 480, 400
SEEN = np.array([[0.94, -0.12, 0.0], [0.14, 0.62, 0.70]])
"""From which side the bent sheet is shown: rows give x and y of the picture."""


def main() -> None:
    """A Miura fold with noise that grows from corner to corner, from its clusters to its flat page."""
    mesh, _ = sheet_mesh(sheet("miura"), POINTS, noise_mm=(0.02, 0.15))
    found = topology(mesh.faces, len(mesh.points))
    sticks = make_sticks(mesh, found, "smooth")
    rest = sticks.rest[: sticks.edges]
    with thread_pool() as parallel_for:
        faces, lie = apply_face_flips(mesh.faces, found, sticks.turned)
        clusters = lay_out_clusters(faces, lie, rest, len(mesh.points), parallel_for)
        start, *_ = initial_layout(faces, lie, rest, len(mesh.points), parallel_for)
    done = solve_sticks(mesh, found, sticks)
    page_xy, size = to_page_frame(done.xy * [1, -1], np.array([0.0, -1.0]))
    start = _laid_over(start * [1, -1], page_xy)

    picture = Sheet(4 * WIDE + 100, ROWS + 90)
    colour = np.random.default_rng(3).uniform(90, 235, (clusters.total, 3))[clusters.cluster[clusters.start[:-1]]]
    bent = mesh.points @ SEEN.T * [1, -1]
    bent, bent_size = bent - bent.min(axis=0), tuple(np.ptp(bent, axis=0))
    shown = np.nan_to_num(over_page(bent, mesh.faces, colour, bent_size, ROWS), nan=255).astype(np.uint8)
    off, noise = np.linalg.norm(start - page_xy, axis=1), sticks.noise_mm
    panels = [
        (shown, f"{clusters.total} clusters, each laid flat by itself"),
        (_map(page_xy, mesh.faces, off, size), f"joined: {_rms(off):.3f} mm (rms) from where it will rest"),
        (_history(done.residuals), f"{done.iterations} steps: strain of the sticks (rms)"),
        (_map(page_xy, mesh.faces, noise, size), f"noise found: {noise.min():.3f} to {noise.max():.3f} mm"),
    ]
    for k, (pixels, words) in enumerate(panels):
        left = 20 + k * (WIDE + 20)
        picture.picture(pixels, (left, 20, WIDE, ROWS), framed=False)
        picture.lines((left, ROWS + 60), f"{k + 1}.  {words}", 18, WIDE)
    picture.image.quantize(200).save(Path(__file__).parent / "solver.png", optimize=True)


def _map(page_xy, faces, values, size):
    return coloured(over_page(page_xy, faces, values, size, ROWS), 0, float(np.quantile(values, 0.995)))


def _rms(values):
    return float(np.sqrt((values**2).mean()))


def _laid_over(xy, page_xy):
    """A layout turned and shifted onto another by least squares."""
    a, b = xy - xy.mean(axis=0), page_xy - page_xy.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    return a @ (u @ np.diag([1, np.sign(np.linalg.det(u @ vt))]) @ vt) + page_xy.mean(axis=0)


def _history(residuals):
    """A line through the errors of the sticks after each step, on a scale of powers of ten."""
    image = Image.new("RGB", (WIDE, ROWS), "white")
    draw = ImageDraw.Draw(image)
    low, high = np.floor(np.log10(residuals.min())), np.ceil(np.log10(residuals.max()))
    for power in np.arange(low, high + 1):
        y = 20 + (ROWS - 50) * (high - power) / (high - low)
        draw.line((60, y, WIDE - 10, y), "#d5dadd")
        draw.text((52, y), f"1e{power:.0f}", "#5f6b73", anchor="rm", font_size=16)
    x = np.linspace(60, WIDE - 10, len(residuals))
    y = 20 + (ROWS - 50) * (high - np.log10(residuals)) / (high - low)
    draw.line(list(zip(x, y, strict=True)), "#355f8d", 3)
    draw.text((60, ROWS - 4), "0", "#5f6b73", anchor="ls", font_size=16)
    draw.text((WIDE - 10, ROWS - 4), f"{len(residuals) - 1}", "#5f6b73", anchor="rs", font_size=16)
    return np.asarray(image)


if __name__ == "__main__":
    main()
