"""MTL, the materials of an OBJ: which image each has, and how its texture coordinates are scaled and moved.

Only what tells the image is read. Keywords come in any case; a name is the rest of its line; options of a map stand
before the file name (Wavefront's "MTL material format", appendix B2 of the Advanced Visualizer manual).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from planish.types import Floats

_ROLES = ("map_kd", "map_ke", "map_ka")
"""Maps that may show the print, best first: diffuse, emissive, ambient. Never bump, specular, dissolve, roughness."""

_ONE_WORD = {"-blendu", "-blendv", "-clamp", "-cc", "-bm", "-boost", "-texres", "-imfchan", "-type", "-colorspace"}
_TWO_WORDS = {"-mm"}
_UP_TO_THREE_NUMBERS = {"-o", "-s", "-t"}
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\Z")


@dataclass(frozen=True, eq=False)
class Map:
    """The image of a material.

    Attributes
    ----------
    name : str
        File name as the MTL has it.
    scale, offset : (2,) float64
        The image lies at uv * scale + offset (-s and -o).
    clamp : bool
        The image is not repeated outside of 0 to 1.
    """

    name: str
    scale: Floats
    offset: Floats
    clamp: bool = False

    @property
    def moves(self) -> bool:
        """Whether scale or offset change anything."""
        return bool((self.scale != 1).any() or (self.offset != 0).any())


def read_mtl(text: str) -> dict[str, Map | None]:
    r"""The image of every material by the material's name; None where it has none.

    Examples
    --------
    >>> found = read_mtl("newmtl Page 1 (left)\nmap_kd -s 0.5 0.5 1 -clamp on my photo.jpg")
    >>> found["Page 1 (left)"].name, found["Page 1 (left)"].scale.tolist()
    ('my photo.jpg', [0.5, 0.5])
    """
    found: dict[str, Map | None] = {}
    best: dict[str, int] = {}
    name = None
    for line in text.replace("\\\n", " ").splitlines():
        keyword, _, rest = line.strip().partition(" ") if "\t" not in line else _at_blank(line)
        keyword, rest = keyword.lower(), rest.strip()
        if keyword == "newmtl":
            name = rest
            found.setdefault(name, None)
        elif keyword in _ROLES and name is not None and rest:
            rank = _ROLES.index(keyword)
            read = _map(rest)
            if read.name and rank < best.get(name, len(_ROLES)):
                found[name], best[name] = read, rank
    return found


def _at_blank(line: str) -> tuple[str, str, str]:
    words = line.split(None, 1)
    return (words[0] if words else ""), " ", (words[1] if len(words) > 1 else "")


def _map(rest: str) -> Map:
    """Options, then the file name, which may hold blanks."""
    scale, offset, clamp = np.ones(2), np.zeros(2), False
    while rest.startswith("-"):
        option, _, after = rest.partition(" ")
        option = option.lower()
        if option in _UP_TO_THREE_NUMBERS:
            numbers: list[float] = []
            while len(numbers) < 3 and after.strip():
                word, _, further = after.lstrip().partition(" ")
                if not _NUMBER.match(word) or not further.strip():
                    break
                numbers.append(float(word))
                after = further
            if option == "-s":
                scale[: len(numbers[:2])] = numbers[:2]
            elif option == "-o":
                offset[: len(numbers[:2])] = numbers[:2]
        elif option in _ONE_WORD | _TWO_WORDS:
            words = after.split(None, 2 if option in _TWO_WORDS else 1)
            if option == "-clamp":
                clamp = bool(words) and words[0].lower() == "on"
            after = words[-1] if len(words) == (3 if option in _TWO_WORDS else 2) else ""
        else:
            break  # a file name that begins with a minus
        rest = after.lstrip()
    return Map(rest.strip().strip('"'), scale, offset, clamp)
