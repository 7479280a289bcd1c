"""What the graphs share: their colours, axes side by side or below each other, labels, and how they are saved.

Drawn by matplotlib without a display and without its global state, each whole or not at all.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from fem_biobot.errors import FileError
from fem_biobot.files import replacing

DPI = 160
INK, SOFT, GRID, BAND = "#1f2429", "#667079", "#e3e7ea", "#f3f5f6"
# Okabe and Ito's colours, told apart by every kind of colour vision
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


def side_by_side(count: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """A figure with its own canvas and `count` axes in a row."""
    figure = Figure(figsize=size, dpi=DPI, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    axes = [figure.add_subplot(1, count, number + 1) for number in range(count)]
    for each in axes:
        each.grid(color=GRID, linewidth=0.8)
        each.set_axisbelow(True)
        each.spines[["top", "right"]].set_visible(False)
        each.spines[["left", "bottom"]].set_color(SOFT)
        each.tick_params(labelsize=8.5, colors=INK, width=0.7)
    return figure, axes


def paired(path: str | os.PathLike[str], name: str, x: ArrayLike, y: ArrayLike) -> tuple[Any, Any]:
    """Two rows of finite numbers of one length, or a refusal that names them."""
    xs, ys = np.atleast_1d(np.asarray(x, dtype=float)), np.atleast_1d(np.asarray(y, dtype=float))
    if xs.shape != ys.shape or xs.ndim != 1:
        raise FileError(f"{path}: {name}: {ys.shape} values at {xs.shape} places, expected as many as places")
    if not (np.isfinite(xs).all() and np.isfinite(ys).all()):
        raise FileError(f"{path}: {name}: values that are not finite cannot be drawn")
    return xs, ys


def below_each_other(heights: Sequence[float], size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """A figure with its own canvas and axes one below the other that share their times."""
    figure = Figure(figsize=size, dpi=DPI, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=list(heights))
    found: list[Axes] = []
    for number in range(len(heights)):
        axes = figure.add_subplot(grid[number], sharex=found[0] if found else None)
        axes.grid(color=GRID, linewidth=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(SOFT)
        axes.tick_params(labelsize=8.5, colors=INK, width=0.7, labelbottom=number == len(heights) - 1)
        found.append(axes)
    return figure, found


def shade_strokes(axes: Axes, ends: NDArray[Any], discarded: int) -> None:
    """Every second stroke shaded, the end of the transient as a line."""
    for begin, end in zip(ends[::2], ends[1::2], strict=False):
        axes.axvspan(begin, end, color=BAND, linewidth=0.0, zorder=0)
    if 0 < discarded < len(ends):
        axes.axvline(ends[discarded], color=SOFT, linewidth=0.9, linestyle=":")


def name_axes(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x, fontsize=9.5, color=INK)
    axes.set_ylabel(y, fontsize=9.5, color=INK)


def legend(axes: Axes) -> None:
    """Names of what is drawn, where there are any; `save` moves them beside the axes if they lie over a curve."""
    if axes.get_legend_handles_labels()[0]:
        # the place asked for by name: left out, Matplotlib warns of the time that the same search takes
        axes.legend(loc="best", frameon=False, fontsize=8.5, labelcolor=INK)


def save(figure: Figure, path: str | os.PathLike[str], title: str) -> None:
    """Write a figure with its title; no legend of it lies over a curve."""
    figure.suptitle(title, fontsize=11.5, color=INK, x=0.02, ha="left")
    _clear_curves(figure)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=DPI, format="png", metadata={"Software": None})


def covers(axes: Axes) -> bool:
    """Whether the legend of axes lies over a curve or a point of theirs, as the figure was last laid out."""
    names = axes.get_legend()
    if names is None:
        return False
    box = names.get_window_extent()
    if any(
        line.get_transform().transform_path(line.get_path()).intersects_bbox(box, filled=False) for line in _drawn(axes)
    ):
        return True
    for points in axes.collections:
        places = points.get_offset_transform().transform(np.ma.getdata(points.get_offsets()))
        if isinstance(points, PathCollection) and any(box.contains(x, y) for x, y in places):
            return True
    return False


def _drawn(axes: Axes) -> list[Line2D]:
    """Curves that are seen and follow the axes' numbers; those of a legend alone have no points."""
    return [line for line in axes.lines if line.get_visible() and len(np.atleast_1d(np.asarray(line.get_xdata())))]


def _clear_curves(figure: Figure) -> None:
    """Legends that lie over curves go above their axes, in as many columns as fit over them."""
    figure.draw_without_rendering()
    for axes in [axes for axes in figure.axes if covers(axes)]:
        names = axes.get_legend()
        assert names is not None
        handles, words = [each for each in names.legend_handles if each is not None], names.get_texts()
        for columns in range(len(words), 0, -1):
            names = axes.legend(
                handles, [word.get_text() for word in words], frameon=False, fontsize=8.5, labelcolor=INK,
                ncols=columns, loc="lower right", bbox_to_anchor=(1.0, 1.0),
            )  # fmt: skip
            # too wide a one would leave no room for the axes
            names.set_in_layout(False)
            figure.draw_without_rendering()
            if names.get_window_extent().width <= axes.get_window_extent().width:
                break
        names.set_in_layout(True)
