"""Names, progress and running time of the stages of a restoration."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter

Progress = Callable[[str, float], None]
"""Called with the name of the stage and the share of it that is done, 0 to 1."""


def no_progress(stage: str, share: float) -> None:
    """Report progress to nobody."""


@dataclass
class StageTimer:
    """Reports each stage to `progress` and adds up its running time.

    Attributes
    ----------
    progress : callable
        See `Progress`.
    seconds : dict
        Wall time of each stage so far; a stage that is entered again goes on where it was.
    """

    progress: Progress = no_progress
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, name: str) -> Iterator[Callable[[float], None]]:
        """Time a stage; yields the function that takes its share done."""
        self.progress(name, 0.0)
        start = perf_counter()
        yield lambda share: self.progress(name, share)
        self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start
        self.progress(name, 1.0)
