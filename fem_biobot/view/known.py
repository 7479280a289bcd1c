"""Graphs of known answers beside what was computed.

Drawn as those of `plots`. Takes plain arrays; knows nothing of cases.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Protocol

from numpy.typing import ArrayLike

from fem_biobot.errors import FileError
from fem_biobot.view.graph import COLOURS, INK, legend, name_axes, paired, save, side_by_side

# curves beyond which their names stand beside the graph
_MANY = 6


class Line(Protocol):
    """One curve: its name, (k,) places and values, whether it is known, and whether a line goes through its points."""

    @property
    def name(self) -> str: ...
    @property
    def x(self) -> ArrayLike: ...
    @property
    def y(self) -> ArrayLike: ...
    @property
    def known(self) -> bool: ...
    @property
    def joined(self) -> bool | None: ...


def known_and_ours(
    path: str | os.PathLike[str],
    curves: Sequence[Line],
    *,
    x: str,
    y: str,
    title: str,
    logarithmic: str = "",
    equal: bool = False,
) -> None:
    """Known answers as lines (hollow diamonds where no line goes through them), ours as points.

    The first known curve has the colour of the first of ours, and so on.

    Parameters
    ----------
    path
        PNG file.
    curves
        In order of drawing.
    x, y
        Labels of the axes, with units.
    logarithmic
        Letters of the axes that are.
    equal
        Whether a unit is as long along both axes.

    Raises
    ------
    FileError
        Nothing to draw; a curve's two rows differ in length or hold something not finite, or something not above zero
        on logarithmic axes; the file cannot be written.
    """
    if not curves:
        raise FileError(f"{path}: found no curves, expected at least one to draw")
    figure, (axes,) = side_by_side(1, (7.2, 4.8))
    counts = {True: 0, False: 0}
    for curve in curves:
        xs, ys = paired(path, curve.name, curve.x, curve.y)
        for letter, values in (("x", xs), ("y", ys)):
            if letter in logarithmic and not (values > 0.0).all():
                raise FileError(
                    f"{path}: {curve.name}: {letter} that is not above 0 cannot be drawn on a logarithmic axis"
                )
        colour = COLOURS[counts[curve.known] % len(COLOURS)]
        joined = curve.known if curve.joined is None else curve.joined
        # hollow marks belong to no one colour
        counts[curve.known] += joined or not curve.known
        if joined:
            axes.plot(xs, ys, "-", color=colour, linewidth=1.4, label=curve.name, zorder=2)
        elif curve.known:
            axes.plot(xs, ys, "D", color=INK, markersize=6.5, markerfacecolor="none", label=curve.name, zorder=4)
        else:
            axes.plot(xs, ys, "o", color=colour, markersize=4.2, label=curve.name, zorder=3)
    if "x" in logarithmic:
        axes.set_xscale("log")
    if "y" in logarithmic:
        axes.set_yscale("log")
    if equal:
        axes.set_aspect("equal", adjustable="datalim")
    name_axes(axes, x, y)
    if len(curves) <= _MANY:
        legend(axes)
    else:
        figure.legend(loc="outside right center", frameon=False, fontsize=8.0, labelcolor=INK)
    save(figure, path, title)
