"""Compile the kernels of the pipeline: on the first run on a machine, or ahead of it.

Numba compiles one kernel at a time in a process, whatever the cores, and keeps it in a cache on disk. So a second
process works from the pipeline's other end: it draws a page first, and lays a sheet flat after that. Where the two
meet, each finds in the cache what the other has compiled.
"""

from __future__ import annotations

import functools
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from numba import get_num_threads
from numba.core.caching import IndexDataCacheFile
from numba.core.event import Event, Listener, install_listener

from planish.system import OPEN_FILES_CAN_BE_LOCKED, lock_open_file

if TYPE_CHECKING:
    from planish.types import Scan


def lock_kernel_cache() -> None:
    """Let processes take turns at numba's cache.

    Two that save different signatures of one kernel at the same moment take the same file name for both, and the index
    then gives one signature the code of the other. Every process that may compile beside another has to call this.
    """
    for name in ("load", "save"):
        method = getattr(IndexDataCacheFile, name)
        if not hasattr(method, "__wrapped__"):
            setattr(IndexDataCacheFile, name, _with_lock(method))


def _with_lock(method: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(method)
    def locked(self: IndexDataCacheFile, *arguments: Any) -> Any:
        try:
            folder = os.open(self._cache_path, os.O_RDONLY)
        except OSError:  # nothing was compiled yet, or the system opens no folders
            return method(self, *arguments)
        try:
            lock_open_file(folder, wait=True)
            return method(self, *arguments)
        finally:
            os.close(folder)

    return locked


class _StartAtFirstKernel(Listener):
    """Starts the second process when numba first has to compile something."""

    def __init__(self, stages: list[str]):
        self.stages = stages
        self.process: subprocess.Popen[bytes] | None = None

    def on_start(self, event: Event) -> None:
        if self.process is None:
            command = [sys.executable, "-m", "planish.job.warm_up", *self.stages]
            quiet = subprocess.DEVNULL
            self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=quiet, stderr=quiet)

    def on_end(self, event: Event) -> None:
        pass


@contextmanager
def compile_from_both_ends(*, draw: bool = True) -> Iterator[None]:
    """While this is open, the first kernel that is not in numba's cache starts a second process that compiles, too.

    The process ends with its work, with this context, or with this process. On one core none is started, nor where the
    two cannot take turns at the cache.

    Parameters
    ----------
    draw : bool
        Whether a page will be drawn, too.
    """
    lock_kernel_cache()
    if get_num_threads() == 1 or not OPEN_FILES_CAN_BE_LOCKED:
        yield
        return
    starter = _StartAtFirstKernel(["draw"] if draw else [])
    try:
        with install_listener("numba:compile", starter):
            yield
    finally:
        if starter.process is not None:
            starter.process.kill()
            starter.process.communicate()


def load_kernels() -> None:
    """Restore and show a small sheet, which loads the kernels of that (the first time: compiles them)."""
    from planish.job import runner
    from planish.view import view_page

    scan, _ = _small_scan()
    with compile_from_both_ends():
        view_page(runner.restore(scan))


def load_all_kernels() -> None:
    """The same, and those of other sheets, kinds of scans and settings, and the measures of distortion.

    Which kernels a sheet needs depends on its folds and its noise, so several are scanned, as `planish demo` does it.
    """
    from dataclasses import replace

    from planish.gallery import sheet, virtual_scan
    from planish.photo import find_shapes
    from planish.pipeline import flatten, restore
    from planish.report import distortion
    from planish.settings import (
        FlattenSettings,
        PhotoSettings,
        RenderSettings,
        RestoreSettings,
        ShadingSettings,
        VerletSettings,
    )

    load_kernels()
    scan, _ = _small_scan()
    as_photo = RestoreSettings(
        render=RenderSettings(sharpen=1.0, dpi=72), shading=ShadingSettings(shading="background")
    )
    for kind in _kinds(scan):
        restore(kind, as_photo)
    card = sheet("letter", width_mm=74, height_mm=105)
    for shape, noise_mm in ((card, 0.05), (sheet("crumpled"), 0.2), (sheet("curl"), 0.0), (sheet("spread"), 0.05)):
        seen = virtual_scan(shape, points=4000, photo_px=(600, 450), noise_mm=noise_mm).scan
        restore(seen, RestoreSettings(render=RenderSettings(dpi=72), pages="auto"))
        if shape is card and seen.photo is not None:
            restore(find_shapes(seen.photo, PhotoSettings(width_mm=card.width_mm))[0].scan, as_photo)
    distortion(scan.mesh, flatten(scan.mesh))
    few_steps = VerletSettings(max_steps=2, self_collision=True)
    for settings in (
        FlattenSettings(lengths="straight"),
        FlattenSettings(lengths="unfolded"),
        FlattenSettings(method="verlet", verlet=few_steps),
        FlattenSettings(method="verlet", verlet=replace(few_steps, self_collision=False)),
        FlattenSettings(method="mass-spring"),
    ):
        flatten(scan.mesh, settings=settings)


def _kinds(scan: Scan) -> Iterator[Scan]:
    """The same scan with a photo of 16 bits, with texture coordinates per corner, with several images, with colours."""
    import numpy as np

    from planish.types import Scan, Texture

    photo, xy, mesh = scan.photo, scan.photo_xy, scan.mesh
    assert photo is not None
    assert xy is not None
    corners = xy[mesh.faces]
    halves = (mesh.faces[:, 0] % 2).astype(np.int32)
    yield Scan(mesh, photo=photo.astype(np.uint16) * 257, photo_xy=xy)
    yield Scan(mesh, photo=photo, photo_xy=corners)
    images = tuple(Texture((photo.shape[0], photo.shape[1]), 8, lambda: photo) for _ in range(2))
    yield Scan(mesh, photo_xy=corners, textures=images, texture_of_face=halves)
    yield Scan(mesh, colours=np.full((len(mesh.points), 3), 200, np.uint8))


def _draw() -> None:
    """Draw the page of a sheet whose flat shape is known."""
    import numpy as np

    from planish.pipeline.restore import draw_page
    from planish.pipeline.stages import StageTimer, no_progress
    from planish.settings import RestoreSettings
    from planish.types import Flattening, Outcome, PreparedScan, Topology

    scan, flat_xy = _small_scan()
    points, none = len(flat_xy), np.zeros((0, 2), np.int32)
    flat = Flattening(
        page_xy=flat_xy - flat_xy.min(axis=0),
        size_mm=tuple(np.ptp(flat_xy, axis=0).tolist()),
        outcome=Outcome.SETTLED,
        method="multigrid",
        lengths="smooth",
        solved_points=points,
        iterations=0,
        residuals=np.zeros(0),
        heights=np.zeros(0),
        strain=(0.0, 0.0),
        error_mm=np.zeros(points),
        local_strain=np.zeros(points),
        seconds=0.0,
        normals=np.tile(np.array([0, 0, 1], np.float32), (points, 1)),
    )
    nothing = Topology(none, none, none[:, 0], none)
    prepared = PreparedScan(scan, scan, nothing, np.arange(points, dtype=np.int32), pieces=1, holes=0)
    draw_page(prepared, flat, RestoreSettings(), StageTimer(no_progress), None)


def _flatten() -> None:
    """Flatten without looking for noise first."""
    from planish import flatten
    from planish.settings import FlattenSettings

    flatten(_small_scan()[0].mesh, settings=FlattenSettings(lengths="unfolded"))


def _small_scan():  # type: ignore[no-untyped-def]
    """A scan of a small bent sheet with a photo, and its points on the flat sheet."""
    import numpy as np

    from planish.gallery import sheet, sheet_mesh
    from planish.gallery.scanner import overhead_camera
    from planish.geometry import project
    from planish.types import Scan

    card = sheet("book", width_mm=74, height_mm=105)
    mesh, flat_xy = sheet_mesh(card, points=4000, layout="range", noise_mm=0.05)
    camera = overhead_camera(card, (480, 360))
    photo = np.full((*camera.shape_rc, 3), 220, np.uint8)
    photo[::8] = photo[1::8] = 60  # stripes that resemble lines of text
    return Scan(mesh, photo=photo, photo_xy=project(camera, mesh.points)), flat_xy


def _end_with_parent() -> None:
    os.read(sys.stdin.fileno(), 1)  # nothing is ever written: it returns when the parent is gone
    os._exit(1)


if __name__ == "__main__":
    lock_kernel_cache()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if "draw" in sys.argv:
        _draw()
    _flatten()
