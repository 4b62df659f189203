"""Imported by the server of forks before it forks: all of planish in memory, and its kernels loaded.

A process that is forked must not inherit threads at work, so OpenCV gets none here; those of BLAS and numba are idle,
and made anew in the forked process where it needs them.
"""

from __future__ import annotations

import os


def load_kernels() -> None:
    """Restore a small sheet, so that the kernels of the usual walk are loaded (the first time: compiled)."""
    import cv2
    import numpy as np

    from planish.gallery import sheet, sheet_mesh
    from planish.gallery.scanner import overhead_camera
    from planish.geometry import project
    from planish.job import runner
    from planish.types import Scan

    cv2.setNumThreads(1)
    card = sheet("book", width_mm=74, height_mm=105)
    mesh, _ = sheet_mesh(card, points=1000, layout="grid")
    camera = overhead_camera(card, (480, 360))
    photo = np.full((*camera.shape_rc, 3), 220, np.uint8)
    photo[::8] = photo[1::8] = 60  # something like lines of text
    runner.restore(Scan(mesh, photo=photo, photo_xy=project(camera, mesh.points)))


if os.environ.get("PLANISH_WARM"):  # set by planish.job.worker for its server of forks alone
    load_kernels()
