"""Pages and flattenings as figures of matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from planish.color import to_uint8
from planish.errors import MissingExtraError, UsageError, install_command

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PlotValues = Literal["error", "strain"]

POINTS_PER_CELL = 6.0
"""Of a map, on average: values change over centimetres, and fewer would leave holes where points lie unevenly."""
MOST_CELLS = 400
"""Along the longer side of a map: more would show nothing more on a screen."""
TOP = 0.995
"""Quantile of the values at which the colours end: the last few points would leave the rest in one colour."""

_MAPS = {"error": ("expected error [mm]", 1.0), "strain": ("strain [%]", 100.0)}


def plot_flattening(flat: Any, values: PlotValues = "error", ax: Axes | None = None) -> Axes:
    """Draw a value of every point over the page; see `Flattening.plot`."""
    if values not in _MAPS:
        raise UsageError(f"there is no map of {values!r}; there are {' and '.join(_MAPS)}")
    ax = ax or _new_axes(1)[0]
    label, factor = _MAPS[values]
    at_points = flat.error_mm if values == "error" else flat.local_strain
    cells = mean_of_cells(flat.page_xy, factor * at_points, flat.size_mm)
    return _draw_map(ax, cells, flat.size_mm, label)


def plot_page(page: Any, ax: Axes | None = None) -> Axes:
    """Draw a page over its millimetres; see `Page.plot`."""
    ax = ax or _new_axes(1)[0]
    width, height = page.size_mm
    step = max(1, max(page.known.shape) // 1500)  # more than a screen has
    pixels = to_uint8(page.pixels[::step, ::step])
    ax.imshow(pixels, cmap="gray", vmin=0, vmax=255, extent=(0, width, height, 0))
    ax.set(xlabel="mm", ylabel="mm")
    return ax


def plot_restoration(done: Any) -> Figure:
    """Draw the page beside the maps of its report; see `Restoration.plot`."""
    axes = _new_axes((done.page is not None) + 2 + (done.ppi is not None))
    rest = iter(axes)
    if done.page is not None:
        plot_page(done.page, next(rest)).set_title("page")
    for values in ("error", "strain"):
        plot_flattening(done.flattening, values, next(rest)).set_title(_MAPS[values][0])
    if done.ppi is not None:
        _draw_map(next(rest), done.ppi, done.flattening.size_mm, "ppi").set_title("photo pixels per inch of page")
    figure: Any = axes[0].figure
    figure.suptitle(f"{done.report.verdict.word}: {done.report.outcome}")
    return figure


def mean_of_cells(
    page_xy: NDArray[np.float64], values: NDArray[np.float64], size_mm: tuple[float, float]
) -> NDArray[np.float64]:
    """Mean value of the points in every cell of a grid over the page, NaN where there is none.

    Parameters
    ----------
    page_xy : (n, 2) float64 [mm]
    values : (n,) float64
    size_mm : (float, float)
        Width and height of the page.

    Examples
    --------
    >>> mean_of_cells(np.array([[1.0, 1.0], [9.0, 1.0]]), np.array([2.0, 4.0]), (10.0, 10.0))
    array([[3.]])
    """
    size = np.maximum(np.array(size_mm), 1e-9)
    side = max(np.sqrt(size.prod() * POINTS_PER_CELL / max(1, len(values))), size.max() / MOST_CELLS)
    cols, rows = np.maximum(1, np.round(size / side)).astype(int)
    col, row = np.clip((page_xy / size * [cols, rows]).astype(int), 0, [cols - 1, rows - 1]).T
    cell = row * cols + col
    count = np.bincount(cell, minlength=rows * cols)
    with np.errstate(invalid="ignore"):
        return (np.bincount(cell, values, rows * cols) / count).reshape(rows, cols)


def _draw_map(ax: Axes, cells: NDArray, size_mm: tuple[float, float], label: str) -> Axes:
    width, height = size_mm
    known = cells[np.isfinite(cells)]
    top = float(np.quantile(known, TOP)) if known.size else 1.0
    image = ax.imshow(cells, vmin=0, vmax=top or None, extent=(0, width, height, 0))
    ax.figure.colorbar(image, ax=ax, label=label)
    ax.set(xlabel="mm", ylabel="mm")
    return ax


def _new_axes(count: int) -> list[Axes]:
    try:
        from matplotlib import pyplot
    except ImportError:
        raise MissingExtraError(f"a plot needs the extra: {install_command('plot')}") from None
    _, axes = pyplot.subplots(1, count, figsize=(4.5 * count, 5), layout="constrained", squeeze=False)
    return list(axes[0])
