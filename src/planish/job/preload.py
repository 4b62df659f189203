"""Preload module of the fork server: imports planish and loads its compiled kernels before the first fork.

A forked process must not inherit running threads, so OpenCV gets none here. The threads of BLAS and numba are idle at
the fork and are recreated in the child when needed.
"""

from __future__ import annotations

import os


def load_kernels() -> None:
    """Restore a small sheet, which loads the kernels of the default pipeline (the first time: compiles them)."""
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
    photo[::8] = photo[1::8] = 60  # stripes that resemble lines of text
    runner.restore(Scan(mesh, photo=photo, photo_xy=project(camera, mesh.points)))


if os.environ.get("PLANISH_PRELOAD"):  # set by planish.job.worker for its fork server only
    load_kernels()
