"""The thresholds of planish's decisions: found in its source, changed in the running program, and put back."""

from __future__ import annotations

import ast
import importlib
import math
import pkgutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, ModuleType

from numba.core.caching import NullCache
from numba.core.dispatcher import Dispatcher

Value = float | tuple[float, ...]


@dataclass(frozen=True)
class Threshold:
    """A module's constant that something is compared with.

    `angle` tells that its expression takes a cosine, so that the angle is what is halved and doubled.
    """

    module: str
    name: str
    value: Value
    angle: bool = False

    @property
    def place(self) -> str:
        return f"{self.module.removeprefix('planish.')}.{self.name}"

    def times(self, factor: float) -> Value:
        """Half or twice the threshold.

        Of a share above one half the distance from one is taken, of a cosine the angle, of two limits how far they are
        apart.
        """
        if isinstance(self.value, tuple):
            middle, half = sum(self.value) / 2, (self.value[1] - self.value[0]) / 2
            return middle - factor * half, middle + factor * half
        if self.angle:
            return math.cos(min(factor * math.acos(self.value), math.pi))
        if 0.5 < self.value < 1:
            return 1 - factor * (1 - self.value)
        return max(1, round(factor * self.value)) if isinstance(self.value, int) else factor * self.value


def thresholds(room: str) -> Iterator[Threshold]:
    """Every constant of a room (a package or module of planish) that occurs in a comparison there.

    Whole numbers that are also sizes of arrays, bounds of loops or places in arrays are left out: kernels would read
    and write beyond their arrays.
    """
    for module in modules(f"planish.{room}"):
        tree = _tree(module)
        compared = {
            name.id
            for comparison in ast.walk(tree)
            if isinstance(comparison, ast.Compare)
            for name in ast.walk(comparison)
            if isinstance(name, ast.Name)
        }
        sizes = _sizes(tree)
        for name, expression in _assigned(tree).items():
            value = vars(module).get(name)
            if isinstance(value, int) and name in sizes:
                continue
            pair = isinstance(value, tuple) and len(value) == 2 and all(isinstance(v, float) for v in value)
            number = isinstance(value, int | float) and not isinstance(value, bool) and value > 0
            if name in compared and name.strip("_").isupper() and (number or (pair and value[0] < value[1])):
                angle = number and abs(value) <= 1 and "cos(" in ast.unparse(expression)
                yield Threshold(module.__name__, name, value if pair or isinstance(value, int) else float(value), angle)


def modules(name: str) -> list[ModuleType]:
    """A module, and those below it."""
    top = importlib.import_module(name)
    below = pkgutil.walk_packages(getattr(top, "__path__", ()), f"{name}.")
    return [top, *(importlib.import_module(found.name) for found in below)]


@contextmanager
def changed(threshold: Threshold, value: Value) -> Iterator[None]:
    """Let the program decide by another value for as long as the `with` lasts.

    Modules that imported the constant change along. Kernels that read it, and those that call them, are compiled anew,
    as a kernel keeps the value it was compiled with; nothing of it gets into Numba's cache. What was computed from a
    constant when its module was loaded stays as it was.
    """
    bound = [module for module in _loaded() if _is_bound(module, threshold)]
    old = vars(sys.modules[threshold.module])[threshold.name]
    kernels = _kernels_that_read(threshold.name, {id(vars(module)) for module in bound})
    caches = [kernel._cache for kernel in kernels]
    try:
        for module in bound:
            setattr(module, threshold.name, value)
        for kernel in kernels:
            _forget(kernel, NullCache())
        yield
    finally:
        for module in bound:
            setattr(module, threshold.name, old)
        for kernel, cache in zip(kernels, caches, strict=True):
            _forget(kernel, cache)


def _loaded() -> list[ModuleType]:
    return [module for name, module in list(sys.modules.items()) if name.startswith("planish.") and module is not None]


def _is_bound(module: ModuleType, threshold: Threshold) -> bool:
    """Whether the module has this constant, its own or imported, and not another of the same name."""
    if module.__name__ == threshold.module:
        return True
    return threshold.name in vars(module) and any(
        threshold.module.startswith(node.module or "?") and threshold.name in [alias.name for alias in node.names]
        for node in ast.walk(_tree(module))
        if isinstance(node, ast.ImportFrom)
    )


def _kernels_that_read(name: str, spaces: set[int]) -> list[Dispatcher]:
    """Compiled functions whose code has that global of these modules, and those that call them."""
    kernels = {id(v): v for module in _loaded() for v in vars(module).values() if isinstance(v, Dispatcher)}
    reads = {key: _names(kernel.py_func.__code__) for key, kernel in kernels.items()}
    found = {k for k, kernel in kernels.items() if name in reads[k] and id(kernel.py_func.__globals__) in spaces}
    grown = -1
    while grown != len(found):
        grown = len(found)
        for key, kernel in kernels.items():
            called = (kernel.py_func.__globals__.get(word) for word in reads[key])
            if any(id(other) in found for other in called):
                found.add(key)
    return [kernels[key] for key in found]


def _names(code: CodeType) -> set[str]:
    inner = (const for const in code.co_consts if isinstance(const, CodeType))
    return set(code.co_names).union(*map(_names, inner))


def _forget(kernel: Dispatcher, cache: object) -> None:
    kernel._make_finalizer()()
    kernel._reset_overloads()
    kernel.overloads.clear()
    kernel._cache = cache
    kernel._can_compile = True


def _tree(module: ModuleType) -> ast.Module:
    return ast.parse(Path(module.__file__).read_text())


def _sizes(tree: ast.Module) -> set[str]:
    """Names within arguments of functions that make arrays or count, and within indices."""
    makers = ("arange", "empty", "full", "ones", "range", "zeros")
    inner = [n.slice for n in ast.walk(tree) if isinstance(n, ast.Subscript)]
    for call in (n for n in ast.walk(tree) if isinstance(n, ast.Call)):
        if getattr(call.func, "attr", getattr(call.func, "id", "")) in makers:
            inner += call.args
    return {name.id for part in inner for name in ast.walk(part) if isinstance(name, ast.Name)}


def _assigned(tree: ast.Module) -> dict[str, ast.expr]:
    found = {}
    for statement in tree.body:
        targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
        for target in targets:
            if isinstance(target, ast.Name) and isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value:
                found[target.id] = statement.value
    return found
