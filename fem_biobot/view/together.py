"""Walks of several models under one drive on one time base: position, stroke, forces on the feet, phase portrait.

Takes plain arrays; knows nothing of the models.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fem_biobot.errors import FileError
from fem_biobot.view.graph import COLOURS, INK, below_each_other, legend, name_axes, save, shade_strokes, side_by_side

_LINES = ("-", "--", ":", "-.")


@dataclass(frozen=True, eq=False)
class Way:
    """How one model walked.

    Attributes
    ----------
    times
        Of the samples, (t,) [s].
    advance, tip_closing
        Of the centre of mass, and of the soles, (t,) [mm].
    feet
        Name to normal and forward force of the ground, (t, 2) [mN].
    """

    times: ArrayLike
    advance: ArrayLike
    tip_closing: ArrayLike
    feet: Mapping[str, ArrayLike]


def together(
    path: str | os.PathLike[str], ways: Mapping[str, Way], *, strokes: ArrayLike = (), title: str = "Together"
) -> None:
    """Draw several walks into one figure: a colour for each model, a line for each foot.

    Parameters
    ----------
    path
        PNG file.
    ways
        Name of a model to how it walked.
    strokes
        Beginning of the first stroke and end of each, (k + 1,) [s].

    Raises
    ------
    FileError
        No model, rows of different length or not finite; the file cannot be written.
    """
    if not ways:
        raise FileError(f"{path}: found no walk, expected at least one")
    figure, axes = below_each_other([1.0, 1.0, 1.2, 1.2], (7.4, 8.8))
    for each in axes:
        shade_strokes(each, np.atleast_1d(np.asarray(strokes, dtype=float)), 0)
    for number, (name, way) in enumerate(ways.items()):
        colour, t = COLOURS[number % len(COLOURS)], np.asarray(way.times, dtype=float)
        for k, values in enumerate((way.advance, way.tip_closing)):
            axes[k].plot(t, _checked(path, name, t, values), color=colour, linewidth=1.4, label=name)
        for line, (foot, force) in zip(_LINES * len(way.feet), way.feet.items(), strict=False):
            both = np.asarray(force, dtype=float)
            for k in range(2):
                values = _checked(path, f"{name}, {foot}", t, both[:, k])
                axes[2 + k].plot(t, values, color=colour, linewidth=1.0, linestyle=line, label=f"{name}, {foot}")
    for each, words in zip(
        axes, ("centre of mass [mm]", "tip closing [mm]", "normal force [mN]", "friction, forward [mN]"), strict=True
    ):
        name_axes(each, "", words)
    legend(axes[0])
    legend(axes[2])
    axes[-1].set_xlabel("time [s]", fontsize=9.5, color=INK)
    axes[-1].margins(x=0.01)
    save(figure, path, title)


def phase_portrait(
    path: str | os.PathLike[str], ways: Mapping[str, Way], *, since: float = 0.0, title: str = "Phase portrait"
) -> None:
    """Draw what several walks do over their strokes as closed curves: rates over positions.

    Left the rate of the tip closing over it, right the rate of the centre of mass over the tip closing; rates are
    central differences of the samples.

    Parameters
    ----------
    path
        PNG file.
    ways
        Name of a model to how it walked.
    since
        Time from which on it is drawn [s]: the transient is left out.

    Raises
    ------
    FileError
        As `together`; fewer than three samples from `since` on.
    """
    if not ways:
        raise FileError(f"{path}: found no walk, expected at least one")
    figure, axes = side_by_side(2, (8.6, 3.8))
    for number, (name, way) in enumerate(ways.items()):
        t = np.asarray(way.times, dtype=float)
        closing, advance = (_checked(path, name, t, values) for values in (way.tip_closing, way.advance))
        kept = t >= since - 1e-9
        if kept.sum() < 3:
            raise FileError(f"{path}: {name}: found {kept.sum()} samples from {since:g} s on, expected at least three")
        rates = [np.gradient(values, t)[kept] for values in (closing, advance)]
        for each, rate in zip(axes, rates, strict=True):
            each.plot(closing[kept], rate, color=COLOURS[number % len(COLOURS)], linewidth=1.1, label=name)
    name_axes(axes[0], "tip closing [mm]", "rate of the tip closing [mm/s]")
    name_axes(axes[1], "tip closing [mm]", "speed of the centre of mass [mm/s]")
    legend(axes[0])
    save(figure, path, title)


def _checked(path: str | os.PathLike[str], what: str, times: np.ndarray, values: ArrayLike) -> np.ndarray:
    found = np.asarray(values, dtype=float)
    if found.shape != times.shape or not np.isfinite(found).all():
        raise FileError(f"{path}: {what}: found shape {found.shape}, expected {times.shape} finite numbers")
    return found
