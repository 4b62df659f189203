"""Preload module of the fork server: imports planish and loads its compiled kernels before the first fork.

A forked process must not inherit running threads, so OpenCV gets none here. The threads of BLAS and numba are idle at
the fork and are recreated in the child when needed.
"""

from __future__ import annotations

import os

if os.environ.get("PLANISH_PRELOAD"):  # set by planish.job.worker for its fork server only
    import cv2

    from planish.job.warm_up import load_kernels

    cv2.setNumThreads(1)
    load_kernels()
