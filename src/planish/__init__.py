"""planish: a 3D scan of a warped document goes in; the page comes out flat, at its true size in millimetres.

>>> import planish
>>> made = planish.gallery.virtual_scan(planish.gallery.sheet("book"), points=3000, photo_px=(1000, 750))
>>> done = planish.restore(made.scan)
>>> done.report.outcome
'The sheet lies flat on the plane and its sticks have come to rest.'
>>> round(done.report.page.width_mm), round(done.report.page.height_mm), done.rendered.dpi
(216, 279, 300.0)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from planish.kernel_cache import use_writable_kernel_cache
from planish.version import __version__ as __version__

if TYPE_CHECKING:
    from planish import gallery, photo
    from planish.display.progress import progress_bar
    from planish.document import split_pages
    from planish.errors import InputError, OutputError, PlanishError, UsageError
    from planish.io import (
        read_camera,
        read_photo,
        read_scan,
        scale_bar,
        write_flat,
        write_json,
        write_page,
        write_pages,
        write_scan,
    )
    from planish.pipeline import flatten, restore
    from planish.report import distortion
    from planish.settings import FlattenSettings, RenderSettings, RestoreSettings
    from planish.types import Camera, Flattening, Mesh, Outcome, Page, Report, Restoration, Scan

use_writable_kernel_cache()  # before numba is imported

_WHERE = {
    "gallery": "planish.gallery",
    "photo": "planish.photo",
    **dict.fromkeys(("InputError", "OutputError", "PlanishError", "UsageError"), "planish.errors"),
    **dict.fromkeys(
        (
            *("read_camera", "read_photo", "read_scan", "scale_bar"),
            *("write_flat", "write_json", "write_page", "write_pages", "write_scan"),
        ),
        "planish.io",
    ),
    **dict.fromkeys(("flatten", "restore"), "planish.pipeline"),
    "split_pages": "planish.document",
    "distortion": "planish.report",
    "progress_bar": "planish.display.progress",
    **dict.fromkeys(("FlattenSettings", "RenderSettings", "RestoreSettings"), "planish.settings"),
    **dict.fromkeys(
        ("Camera", "Flattening", "Mesh", "Outcome", "Page", "Report", "Restoration", "Scan"), "planish.types"
    ),
}

__all__ = [
    "Camera",
    "FlattenSettings",
    "Flattening",
    "InputError",
    "Mesh",
    "Outcome",
    "OutputError",
    "Page",
    "PlanishError",
    "RenderSettings",
    "Report",
    "Restoration",
    "RestoreSettings",
    "Scan",
    "UsageError",
    "distortion",
    "flatten",
    "gallery",
    "photo",
    "progress_bar",
    "read_camera",
    "read_photo",
    "read_scan",
    "restore",
    "scale_bar",
    "split_pages",
    "write_flat",
    "write_json",
    "write_page",
    "write_pages",
    "write_scan",
]


def __getattr__(name: str) -> object:
    """Load what is asked for and no more: `planish --help` should not wait for compilers and image codecs."""
    if name not in _WHERE:
        raise AttributeError(f"module 'planish' has no attribute {name!r}")
    module = import_module(_WHERE[name])
    found = module if name in ("gallery", "photo") else getattr(module, name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
