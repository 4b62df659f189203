"""What the fuzzers share: Atheris set up, seeds laid down, and the rule that they hold every reader to.

A reader may give a value or raise a PlanishError of one line. Any other exception, more than 10 seconds or more than
1 GB for a small file, and any crash of a codec ends the fuzzer and leaves the input in fuzz/corpus/NAME/finds.
"""

from __future__ import annotations

import importlib
import resource
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType

import atheris

from planish.errors import PlanishError

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests"))  # for samples.py, the small scans of the tests

TIMEOUT_S = 10
MOST_MB = 1000
LONGEST = 20_000
"""Bytes of an input: a seed is a few kilobytes."""

_COMPILED = ["planish.io.plylists"]
"""Numba compiles their bytecode, which must stay as it is."""

SHELF = Path(tempfile.mkdtemp(prefix="planish-fuzz-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
"""A folder for readers that want files."""


def instrumented(module: str, *decoders: str) -> ModuleType:
    """Import a module with every branch of planish.io, and of these decoders, watched."""
    with atheris.instrument_imports(include=["planish.io", *decoders], exclude=_COMPILED):
        return importlib.import_module(module)


def fuzz(read: Callable[[bytes], object], seeds: Iterable[bytes], words: Iterable[bytes] = ()) -> None:
    """Feed a reader until the time is over (600 s, or -max_total_time as libFuzzer has it).

    Parameters
    ----------
    read : callable
        Takes the bytes of a file.
    seeds : iterable of bytes
        Good files, which must be read.
    words : iterable of bytes
        That the format knows, to be put in now and then.
    """
    name = Path(sys.argv[0]).stem
    corpus = HERE / "corpus" / name
    (corpus / "finds").mkdir(parents=True, exist_ok=True)
    for k, seed in enumerate(seeds):
        read(seed)
        (corpus / f"seed-{k}").write_bytes(seed)
    dictionary = SHELF / "words.dict"
    dictionary.write_text("".join(f'"{_escaped(word)}"\n' for word in words))

    def one(data: bytes) -> None:
        before = _peak_mb()
        try:
            read(data)
        except PlanishError as problem:
            if "\n" in str(problem) or not str(problem):
                raise AssertionError(f"not one sentence: {problem!r}") from problem
        if _peak_mb() > before + MOST_MB:
            raise AssertionError(f"{len(data)} bytes took {_peak_mb() - before} MB of memory")

    settings = {
        "max_total_time": 600,
        "timeout": TIMEOUT_S,
        "rss_limit_mb": 0,  # of all that was ever read; Atheris itself takes 2 KB for each input
        "max_len": LONGEST,
        "artifact_prefix": f"{corpus / 'finds'}/",
        "dict": dictionary,
        "print_final_stats": 1,
        "verbosity": 0,
    }
    given = [argument for argument in sys.argv[1:] if argument.startswith("-")]
    files = [argument for argument in sys.argv[1:] if not argument.startswith("-")]
    flags = [f"-{key}={value}" for key, value in settings.items()]
    atheris.Setup([sys.argv[0], *flags, *given, *(files or [str(corpus)])], one)
    try:
        atheris.Fuzz()
    finally:
        shutil.rmtree(SHELF, ignore_errors=True)


def _peak_mb() -> int:
    """The most memory that this process ever had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def _escaped(word: bytes) -> str:
    return "".join(f"\\x{byte:02x}" for byte in word)
