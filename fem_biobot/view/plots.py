"""Graphs of a run, drawn by matplotlib without a display and without its global state, each whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from fem_biobot.errors import FileError
from fem_biobot.view.graph import COLOURS, INK, SOFT, legend, name_axes, paired, save, side_by_side

# muscle force [mN] and tip closing [mm] of the paper's own simulation, as its text says
PAPER_FORCE, PAPER_CLOSING = (0.5, 1.0, 1.4), (0.3, 0.5, 1.0)
PAPER_LABEL = "paper, simulated (text, approx.)"


def force_stroke(
    path: str | os.PathLike[str],
    curves: Mapping[str, tuple[ArrayLike, ArrayLike]],
    *,
    marks: Mapping[str, tuple[float, float]] | None = None,
    paper: bool = True,
    linear: float | None = None,
    title: str = "Muscle force and tip closing",
) -> None:
    """Muscle force against tip closing.

    Parameters
    ----------
    path
        PNG file.
    curves
        Name to tip closing [mm] and muscle force [mN] along a path, (t,) each.
    marks
        Name to one such pair, such as the passive and the stimulated state.
    paper
        Whether to draw the paper's three points, for the reference machine.
    linear
        Closing per force of linear theory [mm/mN], drawn as a dashed line; none to leave it out.

    Raises
    ------
    FileError
        A curve's two rows differ in length or hold something not finite; the file cannot be written.
    """
    figure, (axes,) = side_by_side(1, (6.6, 4.4))
    closings, forces = [0.0], [0.0]
    for number, (name, (closing, force)) in enumerate(curves.items()):
        x, y = paired(path, name, closing, force)
        _line(axes, x, y, COLOURS[number % len(COLOURS)], name)
        closings.append(float(x.max(initial=0.0)))
        forces.append(float(y.max(initial=0.0)))
    if paper:
        axes.plot(PAPER_CLOSING, PAPER_FORCE, "D", color=INK, markersize=6, markerfacecolor="white", label=PAPER_LABEL)
        closings.append(max(PAPER_CLOSING))
        forces.append(max(PAPER_FORCE))
    if linear is not None:
        end = min(max(forces), max(closings) / linear) if linear > 0.0 else max(forces)
        axes.plot([0.0, linear * end], [0.0, end], "--", color=SOFT, linewidth=1.2, label="linear theory")
    for name, (x, y) in (marks or {}).items():
        axes.plot([x], [y], "o", color=INK, markersize=5, zorder=4)
        axes.annotate(name, (x, y), (7, -9), textcoords="offset points", fontsize=8.5, color=INK)
    name_axes(axes, "tip closing [mm]", "muscle force [mN]")
    legend(axes)
    save(figure, path, title)


def tension_path(
    path: str | os.PathLike[str],
    tension: ArrayLike,
    *,
    fibre_stretch: ArrayLike | None = None,
    muscle_force: ArrayLike | None = None,
    tip_closing: ArrayLike | None = None,
    sagitta: ArrayLike | None = None,
    marks: Mapping[str, float] | None = None,
    title: str = "Along the tension path",
) -> None:
    """Fibre stretch, muscle force, tip closing and sagitta against tension, one small graph each.

    Parameters
    ----------
    path
        PNG file.
    tension
        Nominal tension in the muscle, (t,) [kPa].
    fibre_stretch, muscle_force, tip_closing, sagitta
        What was measured, (t,) [1, mN, mm, mm]; what is left out is not drawn.
    marks
        Name to a tension shown as a vertical line, such as the passive and the stimulated tension [kPa].

    Raises
    ------
    FileError
        Nothing to draw, rows of different length or not finite; the file cannot be written.
    """
    rows = {
        "fibre stretch [1]": fibre_stretch,
        "muscle force [mN]": muscle_force,
        "tip closing [mm]": tip_closing,
        "sagitta [mm]": sagitta,
    }
    given = {name: values for name, values in rows.items() if values is not None}
    if not given:
        raise FileError(f"{path}: a tension path needs at least one measure to draw")
    figure, all_axes = side_by_side(len(given), (3.1 * len(given) + 0.4, 3.2))
    for number, (axes, (name, values)) in enumerate(zip(all_axes, given.items(), strict=True)):
        x, y = paired(path, name, tension, values)
        _line(axes, x, y, COLOURS[0], "")
        name_axes(axes, "tension [kPa]", name)
        _vertical(axes, marks, named=number == 0)
    save(figure, path, title)


def von_mises_path(
    path: str | os.PathLike[str],
    tension: ArrayLike,
    series: Mapping[str, ArrayLike],
    *,
    marks: Mapping[str, float] | None = None,
    title: str = "Von Mises stress along the tension path",
) -> None:
    """Von Mises Cauchy stresses against tension.

    Parameters
    ----------
    path
        PNG file.
    tension
        Nominal tension in the muscle, (t,) [kPa].
    series
        Name to stress along the path, (t,) [kPa], such as the ball average and the highest value of the mesh.
    marks
        Name to a tension shown as a vertical line [kPa].

    Raises
    ------
    FileError
        Rows of different length or not finite; the file cannot be written.
    """
    figure, (axes,) = side_by_side(1, (6.2, 4.0))
    for number, (name, values) in enumerate(series.items()):
        x, y = paired(path, name, tension, values)
        _line(axes, x, y, COLOURS[number % len(COLOURS)], name)
    name_axes(axes, "tension [kPa]", "von Mises Cauchy stress [kPa]")
    axes.set_ylim(bottom=0.0)
    _vertical(axes, marks, named=True)
    legend(axes)
    save(figure, path, title)


def newton_history(
    path: str | os.PathLike[str],
    residuals: Mapping[str, ArrayLike] | Sequence[ArrayLike],
    *,
    tolerance: float | None = None,
    title: str = "Newton iterations",
) -> None:
    """Residual of each load step over its Newton iterations, on a logarithmic axis.

    Parameters
    ----------
    path
        PNG file.
    residuals
        Per load step the residual after each iteration, over the force scale [1]; named steps are told in a legend.
    tolerance
        Where the iterations stop [1].

    Raises
    ------
    FileError
        A residual is not finite; the file cannot be written.
    """
    named = isinstance(residuals, Mapping)
    steps = dict(residuals.items()) if isinstance(residuals, Mapping) else {str(i): r for i, r in enumerate(residuals)}
    figure, (axes,) = side_by_side(1, (6.2, 4.0))
    floor = 1e-17  # an exact zero has no logarithm
    for number, (name, values) in enumerate(steps.items()):
        count = np.arange(len(np.atleast_1d(np.asarray(values))))
        x, y = paired(path, name, count, values)
        share = number / max(len(steps) - 1, 1)
        colour = COLOURS[number % len(COLOURS)] if len(steps) <= len(COLOURS) else _fade(share)
        _line(axes, x, np.maximum(np.abs(y), floor), colour, name if named else "")
    axes.set_yscale("log")
    if tolerance is not None:
        axes.axhline(tolerance, color=SOFT, linewidth=1.0, linestyle="--", label="tolerance")
    name_axes(axes, "iteration", "residual / force scale [1]")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    legend(axes)
    save(figure, path, title)


def _fade(share: float) -> Any:
    """From light to dark blue, for many steps in order."""
    light, dark = np.array([0.68, 0.80, 0.90]), np.array([0.0, 0.20, 0.38])
    return tuple(light + share * (dark - light))


def _line(axes: Axes, x: Any, y: Any, colour: Any, name: str) -> None:
    axes.plot(x, y, "-o", color=colour, linewidth=1.6, markersize=3.6, label=name or None)


def _vertical(axes: Axes, marks: Mapping[str, float] | None, *, named: bool) -> None:
    """Thin vertical lines at marked tensions, named along the line."""
    for name, at in (marks or {}).items():
        axes.axvline(at, color=SOFT, linewidth=0.9, linestyle=":")
        if named:
            axes.annotate(
                name, (at, 0.02), (-3, 0), xycoords=("data", "axes fraction"), textcoords="offset points",
                rotation=90, fontsize=7.5, color=SOFT, ha="right", va="bottom",
            )  # fmt: skip
