"""What is asked with an upload. Imports nothing of the web framework."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from planish.settings import PhotoSettings, RestoreSettings
from planish.web.outline import Cut, Outline

Format = Literal["tif", "png", "jpg", "pdf"]


@dataclass(frozen=True, kw_only=True)
class UploadRequest:
    """Parameters of the restoration of an upload.

    Attributes
    ----------
    scan : str
        File name in the upload's folder; "." for a tifxyz, which is the folder itself; "" where there are photos only.
    photo, camera : tuple of str
        Needed if the scan file does not reference them, or if there is none.
    size : PhotoSettings
        What tells the size of a sheet that only photos show.
    settings : RestoreSettings
    units : str
    view : bool
        Whether to write an HTML page.
    formats : tuple of Format
        Formats of the page.
    outline : Outline or None
        Of the sheet on its photo.
    cut : Cut or None
        Outline of the sheet on a view of its scan.
    points_only : bool
        Whether points of the scan to look at are all that is asked for.
    """

    scan: str
    photo: tuple[str, ...]
    camera: tuple[str, ...]
    size: PhotoSettings
    settings: RestoreSettings
    units: str
    view: bool
    formats: tuple[Format, ...]
    outline: Outline | None = None
    cut: Cut | None = None
    points_only: bool = False
