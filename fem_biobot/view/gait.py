"""Graphs of a walk: the way it goes, what its feet bear, where its energy goes, how steps depend on frequency.

Drawn as those of `plots`: by matplotlib without a display and without its global state, each whole or not at all. Takes
plain arrays; knows nothing of rods.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from fem_biobot.errors import FileError
from fem_biobot.view.graph import COLOURS, INK, SOFT, below_each_other, legend, name_axes, paired, save, shade_strokes

Path = str | os.PathLike[str]

# of a foot: 0, 1, 2
STATES = ("lifted", "stick", "slip")
STATE_COLOURS = ("#ffffff", "#8fa3b3", "#e69f00")


@dataclass(frozen=True, eq=False)
class Foot:
    """What a foot bears over time.

    Attributes
    ----------
    normal, friction
        Force of the ground on it at the samples, along the ground's normal and forward, (t,) each [mN]; means over the
        time since the sample before.
    state
        A number of `STATES` at the samples, (t,).
    """

    normal: ArrayLike
    friction: ArrayLike
    state: ArrayLike


def position(
    path: Path,
    times: ArrayLike,
    advance: ArrayLike,
    *,
    tip_closing: ArrayLike | None = None,
    strokes: ArrayLike = (),
    discarded: int = 0,
    camera: tuple[ArrayLike, ArrayLike] | None = None,
    title: str = "Position",
) -> None:
    """Advance of the centre of mass against time, and the tip closing below it, strokes marked.

    Parameters
    ----------
    path
        PNG file.
    times, advance, tip_closing
        Of the samples, (t,) [s, mm, mm]; no second graph without a closing.
    strokes
        Beginning of the first stroke and end of each, (k + 1,) [s].
    discarded
        Strokes at the beginning that means leave out; the mean advance of the others is drawn and named.
    camera
        Times [s] and tip closing [mm] of a camera's frames.

    Raises
    ------
    FileError
        Rows of different length or not finite; the file cannot be written.
    """
    rows: dict[str, Any] = {"centre of mass [mm]": paired(path, "advance", times, advance)}
    if tip_closing is not None:
        rows["tip closing [mm]"] = paired(path, "tip closing", times, tip_closing)
    ends = np.atleast_1d(np.asarray(strokes, dtype=float))
    figure, all_axes = below_each_other([1.0] * len(rows), (7.4, 2.0 + 1.9 * len(rows)))
    for axes, (name, (x, y)) in zip(all_axes, rows.items(), strict=True):
        shade_strokes(axes, ends, discarded)
        axes.plot(x, y, color=COLOURS[0], linewidth=1.5)
        name_axes(axes, "", name)
    kept = ends[min(discarded, max(len(ends) - 2, 0)) :]
    if len(kept) > 1:
        x, y = rows["centre of mass [mm]"]
        first, last = np.interp(kept[[0, -1]], x, y)
        step = (last - first) / (len(kept) - 1)
        label = f"mean of strokes {len(ends) - len(kept) + 1} to {len(ends) - 1}: {step:.3g} mm a stroke"
        all_axes[0].plot(kept[[0, -1]], [first, last], "--", color=COLOURS[1], linewidth=1.3, label=label)
        legend(all_axes[0])
    if camera is not None and tip_closing is not None:
        x, y = paired(path, "camera", *camera)
        all_axes[1].plot(x, y, "o-", color=COLOURS[1], linewidth=0.8, markersize=3.6, label="as the camera sees it")
        legend(all_axes[1])
    all_axes[-1].set_xlabel("time [s]", fontsize=9.5, color=INK)
    all_axes[-1].margins(x=0.01)
    save(figure, path, title)


def foot_forces(
    path: Path,
    times: ArrayLike,
    feet: Mapping[str, Foot],
    *,
    period: tuple[float, float] | None = None,
    friction: Sequence[float] = (),
    drive: ArrayLike | None = None,
    title: str = "Forces on the feet over a stroke",
) -> None:
    """Normal force and friction of the feet against time, and when each sticks, slips or is lifted.

    Parameters
    ----------
    path
        PNG file.
    times
        Of the samples, (t,) [s].
    feet
        Name to what the foot bears.
    period
        Beginning and end of what is shown [s]; time is counted from the beginning. Everything by default.
    friction
        Kinetic coefficients of forces forward and back, [1]; times each foot's normal force they are thin lines.
    drive
        Of the muscle at the samples, (t,) [1].

    Raises
    ------
    FileError
        No foot, no sample in the period, rows of different length or not finite; the file cannot be written.
    """
    if not feet:
        raise FileError(f"{path}: found no foot, expected at least one")
    t = np.atleast_1d(np.asarray(times, dtype=float))
    begin, end = (float(t[0]), float(t[-1])) if period is None else period
    shown = (t >= begin - 1e-9) & (t <= end + 1e-9)
    if np.count_nonzero(shown) < 2:
        raise FileError(f"{path}: found {np.count_nonzero(shown)} samples from {begin:g} to {end:g} s, expected more")
    heights = [1.5, 1.5, 0.26 * len(feet), *([0.45] if drive is not None else [])]
    figure, all_axes = below_each_other(heights, (7.4, 1.6 + 1.5 * sum(heights)))
    state = []
    for number, (name, foot) in enumerate(feet.items()):
        colour = COLOURS[number % len(COLOURS)]
        _, normal = paired(path, f"{name}: normal", t, foot.normal)
        _, along = paired(path, f"{name}: friction", t, foot.friction)
        _, states = paired(path, f"{name}: state", t, foot.state)
        state.append(states[shown])
        x, normal, along = t[shown] - begin, normal[shown], along[shown]
        style: dict[str, Any] = {"color": colour, "linewidth": 1.5, "drawstyle": "steps-pre"}
        all_axes[0].plot(x, normal, label=name, **style)
        all_axes[1].plot(x, along, **style)
        for sign, mu in zip((1.0, -1.0), friction, strict=False):
            all_axes[1].plot(x, sign * mu * normal, color=colour, linewidth=0.8, linestyle=":", drawstyle="steps-pre")
    x = t[shown] - begin
    all_axes[0].set_ylim(bottom=min(0.0, all_axes[0].get_ylim()[0]))
    name_axes(all_axes[0], "", "normal force [mN]")
    name_axes(all_axes[1], "", "friction, forward [mN]")
    if friction:
        all_axes[1].plot([], [], color=SOFT, linewidth=0.8, linestyle=":", label="kinetic coefficient x normal force")
        all_axes[1].legend(
            frameon=False,
            fontsize=8.5,
            labelcolor=INK,
            loc="lower right",
            bbox_to_anchor=(1.0, 0.98),
            borderaxespad=0.0,
        )
    legend(all_axes[0])
    _states(all_axes[2], x, np.array(state), list(feet))
    if drive is not None:
        _, values = paired(path, "drive", t, drive)
        all_axes[3].fill_between(x, values[shown], color=COLOURS[3], alpha=0.45, linewidth=0.0)
        name_axes(all_axes[3], "", "drive [1]")
        all_axes[3].set_ylim(bottom=0.0)
    all_axes[-1].set_xlabel("time [s]" if period is None else f"time since {begin:.4g} s [s]", fontsize=9.5, color=INK)
    all_axes[-1].set_xlim(0.0, end - begin)
    save(figure, path, title)


def energy_book(
    path: Path,
    times: ArrayLike,
    stored: Mapping[str, ArrayLike],
    work: Mapping[str, ArrayLike],
    unexplained: ArrayLike,
    *,
    strokes: ArrayLike = (),
    title: str = "Energy",
) -> None:
    """Energies stored, work done on the machine, and what the two leave unexplained, against time.

    Parameters
    ----------
    path
        PNG file.
    times
        Of the samples, (t,) [s].
    stored, work
        Name to energy, and to work since the start, (t,) [uJ]; shown less their first values.
    unexplained
        Of the book, (t,) [uJ].
    strokes
        Beginning of the first stroke and end of each, (k + 1,) [s].

    Raises
    ------
    FileError
        Rows of different length or not finite; the file cannot be written.
    """
    figure, all_axes = below_each_other([1.2, 1.6, 0.6], (7.4, 7.0))
    for axes, group, name in zip(
        all_axes,
        (stored, work, {"": unexplained}),
        ("stored [uJ]", "work since the start [uJ]", "rest [uJ]"),
        strict=True,
    ):
        shade_strokes(axes, np.atleast_1d(np.asarray(strokes, dtype=float)), 0)
        for number, (label, values) in enumerate(group.items()):
            x, y = paired(path, label or "unexplained", times, values)
            shade = "-" if number < len(COLOURS) else "--"
            colour = COLOURS[number % len(COLOURS)] if label else INK
            axes.plot(x, y - (y[0] if label else 0.0), shade, color=colour, linewidth=1.3, label=label or None)
        name_axes(axes, "", name.replace("uJ", "µJ"))
        if axes.get_legend_handles_labels()[0]:
            axes.legend(
                frameon=False,
                fontsize=8.5,
                labelcolor=INK,
                loc="center left",
                bbox_to_anchor=(1.0, 0.5),
                borderaxespad=0.3,
            )
    all_axes[2].ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
    all_axes[-1].set_xlabel("time [s]", fontsize=9.5, color=INK)
    save(figure, path, title)


def step_against_frequency(
    path: Path,
    curves: Mapping[str, tuple[ArrayLike, ArrayLike] | tuple[ArrayLike, ArrayLike, ArrayLike]],
    *,
    marks: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    title: str = "Step and speed against frequency",
) -> None:
    """Step, and speed, against the strokes per second.

    Parameters
    ----------
    path
        PNG file.
    curves
        Name to frequency [Hz], step [mm] and, if known, its spread [mm], (k,) each.
    marks
        Name to frequency [Hz] and step [mm] from elsewhere, such as an experiment.

    Raises
    ------
    FileError
        Rows of different length or not finite; the file cannot be written.
    """
    figure, all_axes = below_each_other([1.0, 1.0], (6.6, 5.4))
    for number, (name, curve) in enumerate(curves.items()):
        f, step = paired(path, name, curve[0], curve[1])
        order = np.argsort(f)
        spread = paired(path, f"{name}: spread", f, curve[2])[1][order] if len(curve) == 3 else None
        f, step, colour = f[order], step[order], COLOURS[number % len(COLOURS)]
        for axes, factor in zip(all_axes, (np.ones_like(f), f), strict=True):
            bars = None if spread is None else factor * spread
            axes.errorbar(
                f, factor * step, yerr=bars, fmt="-o", color=colour, linewidth=1.5, markersize=4, capsize=3,
                elinewidth=1.0, label=name,
            )  # fmt: skip
    for name, pair in (marks or {}).items():
        f, step = paired(path, name, *pair)
        for axes, factor in zip(all_axes, (np.ones_like(f), f), strict=True):
            axes.plot(f, factor * step, "D", color=INK, markersize=6, markerfacecolor="white", label=name)
    for axes, label in zip(all_axes, ("step [mm a stroke]", "speed [mm/s]"), strict=True):
        axes.axhline(0.0, color=SOFT, linewidth=0.8)
        axes.set_ylabel(label, fontsize=9.5, color=INK)
    legend(all_axes[0])
    all_axes[-1].set_xlabel("strokes per second [Hz]", fontsize=9.5, color=INK)
    save(figure, path, title)


def _states(axes: Axes, x: NDArray[Any], state: NDArray[Any], names: Sequence[str]) -> None:
    """A strip a foot in the colour of its state; a sample's state fills the time since the sample before."""
    axes.pcolormesh(
        x, np.arange(len(names) + 1), state[:, 1:], cmap=ListedColormap(STATE_COLOURS), vmin=-0.5, vmax=2.5
    )  # fmt: skip
    axes.grid(visible=False)
    axes.set_yticks(np.arange(len(names)) + 0.5, names)
    axes.set_ylim(len(names), 0)
    axes.hlines(np.arange(1, len(names)), x[0], x[-1], color="white", linewidth=3.0)
    handles = [
        Patch(facecolor=c, edgecolor=SOFT, linewidth=0.6, label=s) for s, c in zip(STATES, STATE_COLOURS, strict=True)
    ]
    axes.legend(
        handles=handles, frameon=False, fontsize=8.5, labelcolor=INK, ncols=3, loc="lower right",
        bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2,
    )  # fmt: skip
