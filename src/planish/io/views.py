"""Several photos of one sheet: which camera file belongs to which."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from planish.errors import InputError
from planish.io.cameras import holds_many

Files = str | Path | Sequence[str | Path] | None


def listed(files: Files) -> list[Path]:
    """One file, several or none as a list."""
    if files is None:
        return []
    return [Path(files)] if isinstance(files, str | Path) else [Path(file) for file in files]


def refuse_twice(photos: Sequence[Path]) -> None:
    """Refuse photos of which one was given twice.

    Raises
    ------
    InputError
        Naming it.
    """
    twice = {str(photo) for i, photo in enumerate(photos) if photo in photos[:i]}
    if twice:
        raise InputError(f"the photo {min(twice)} was given twice; give each once")


def matched(photos: Sequence[Path], cameras: Sequence[Path]) -> list[Path | None]:
    """The camera file of each photo (of none: of the texture).

    Parameters
    ----------
    photos : sequence of Path
    cameras : sequence of Path
        As many in the same order; or one, which must have all of them by their names if there are several; or none.

    Raises
    ------
    InputError
        If they do not match.
    """
    if len(photos) > 1 and not cameras:
        raise InputError(
            f"{len(photos)} photos were given and no camera; where the sheet lies on each must be told",
            "give {camera} for each photo, in the same order, or one file that has all of them by name",
        )
    refuse_twice(photos)
    if len(cameras) > 1 and len(cameras) != len(photos):
        raise InputError(
            f"{len(photos) or 'no'} photo{'' if len(photos) == 1 else 's'} and {len(cameras)} cameras were given; give "
            "one camera for each photo, in the same order, or one file that has all of them by name"
        )
    if len(cameras) == 1 and len(photos) > 1 and not holds_many(cameras[0]):
        raise InputError(
            f"{cameras[0]} holds one camera, but {len(photos)} photos were given",
            "give {camera} for each photo, in the same order, or one file that has all of them by name "
            "(docs/formats.md shows how)",
        )
    if len(cameras) == 1:
        return [cameras[0]] * max(1, len(photos))
    return list(cameras) or [None]
