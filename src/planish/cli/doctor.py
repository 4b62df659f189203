"""`planish doctor`: what a report of a fault needs to know of an installation."""

from __future__ import annotations

from collections.abc import Iterator


def doctor() -> None:
    """Print versions, extras, compiled kernels, cores and memory: what a report of a fault should have with it."""
    for what, found in _findings():
        print(f"{what:<14}{found}")


def _findings() -> Iterator[tuple[str, str]]:
    import platform
    import shutil
    from pathlib import Path

    import planish
    from planish.kernel_cache import kernel_folder
    from planish.memory import free_bytes
    from planish.system import MEMORY_CAN_BE_LIMITED, usable_cores

    package = Path(planish.__file__).parent
    yield "planish", f"{planish.__version__} in {package}"
    yield "Python", f"{platform.python_version()} ({platform.python_implementation()})"
    yield "system", platform.platform()
    yield "cores", str(usable_cores())
    yield "memory", f"{free_bytes() / 1e9:.1f} GB free" + ("" if MEMORY_CAN_BE_LIMITED else ", without limits")
    folder = kernel_folder(package)
    yield "compiled", f"{sum(1 for _ in folder.rglob('*.nbc'))} kernels in {folder}"
    yield "tesseract", shutil.which("tesseract") or "not found; --ocr needs it"
    yield from _libraries()


def _libraries() -> Iterator[tuple[str, str]]:
    """The libraries that planish needs, and those of each extra, with their versions."""
    import re
    from importlib.metadata import PackageNotFoundError, requires

    try:
        requirements = requires("planish") or []
    except PackageNotFoundError:
        yield "libraries", "not known: planish runs from its sources, without being installed"
        return
    groups: dict[str, list[str]] = {}
    for requirement in requirements:
        name = re.match(r"[\w.-]+", requirement)
        extra = re.search(r"extra == ['\"]([\w-]+)", requirement)
        if name is not None:
            groups.setdefault(f"[{extra[1]}]" if extra else "libraries", []).append(_with_version(name[0]))
    yield from ((group, ", ".join(sorted(names))) for group, names in sorted(groups.items(), key=_needed_first))


def _needed_first(group: tuple[str, list[str]]) -> tuple[bool, str]:
    return group[0] != "libraries", group[0]


def _with_version(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return f"{name} {version(name)}"
    except PackageNotFoundError:
        return f"{name} missing"
