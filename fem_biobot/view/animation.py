"""The gait as an animated picture: the machine's true outlines from the side, and the way of its feet below.

Drawn by matplotlib without a display, written as a GIF, whole or not at all. Takes plain arrays; knows nothing of rods.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from scipy.spatial import KDTree

from fem_biobot.errors import FileError
from fem_biobot.files import replacing
from fem_biobot.view.gait import STATE_COLOURS, STATES
from fem_biobot.view.graph import GRID, INK, SOFT

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_DPI = 100
_COLOURS = 128  # of the palette that all frames share
_SOIL = "#dfe4e7"
_WAYS = (INK, *STATE_COLOURS[1:])  # lifted feet leave a thin line in ink, since white does not show


@dataclass(frozen=True, eq=False)
class Silhouette:
    """A part as it is seen from the side.

    Attributes
    ----------
    points
        Forward and up at the samples, (t, 2, n) [mm].
    triangles
        That cover it, of either turn, (3, f).
    colour
        Of its face.
    glow
        How far the colour shows at the samples, (t,), 0 pale to 1 full; always full if left out.
    """

    points: Array
    triangles: Ints
    colour: str
    glow: ArrayLike | None = None


@dataclass(frozen=True, eq=False)
class Outline:
    """A line from the side, in front of all parts: another machine, laid over them.

    Attributes
    ----------
    points
        Forward and up at the samples, (t, 2, n) [mm].
    colour, label
        Of the line, and its words in the legend; of several outlines of one label one is named.
    """

    points: Array
    colour: str
    label: str = ""


@dataclass(frozen=True, eq=False)
class Trail:
    """A foot at the samples, forward and up.

    Attributes
    ----------
    points
        Middle of its sole, (t, 2) [mm].
    state
        A number of `gait.STATES`, (t,).
    force, base
        Force of the ground on it, mean over the time since the sample before, and where it acts, (t, 2) each [mN, mm];
        no arrow without a force, and at the sole's middle without a base.
    """

    points: Array
    state: NDArray[Any]
    force: Array | None = None
    base: Array | None = None


def write_gait(
    path: str | os.PathLike[str],
    times: ArrayLike,
    parts: Sequence[Silhouette],
    feet: Mapping[str, Trail],
    *,
    outlines: Sequence[Outline] = (),
    ground: float = 0.0,
    rate: float = 25.0,
    slow: float = 1.0,
    weight: float | None = None,
    width: int = 900,
    title: str = "Gait",
) -> int:
    """Animate a gait.

    Parameters
    ----------
    path
        GIF file.
    times
        Of the samples, (t,) [s].
    parts
        What is drawn, the last in front.
    feet
        Name to the way of each foot, shown below the machine over time in the colours of stick and slip.
    outlines
        Lines over them.
    ground
        Height of the ground [mm].
    rate
        Frames per second of the machine's time; positions between samples are interpolated. 6 for the paper's camera.
    slow
        Slower than life by this factor.
    weight
        Of the machine [mN]: forces on the feet are drawn as arrows, this one a third as long as the machine is high.
    width
        Of the picture [pixels].

    Returns
    -------
    int
        Frames written.

    Raises
    ------
    FileError
        Rows that do not fit the times or are not finite, a rate or factor that is not above zero, fewer than two
        frames; the file cannot be written.
    """
    t = _checked(path, times, parts, feet, outlines, (("rate", rate), ("slow", slow), ("width", width)))
    count = math.floor((t[-1] - t[0]) * rate + 1e-6) + 1
    if count < 2:
        raise FileError(
            f"{path}: found {count} frame in {t[-1] - t[0]:g} s at {rate:g} a second, expected at least two"
        )
    frames = t[0] + np.arange(count) / rate
    scene = _Scene(t, parts, feet, outlines, ground, weight, width, title)
    images = []
    for moment in frames:
        scene.show(float(moment))
        images.append(scene.image())
    # one palette for all frames, so that nothing flickers
    palette = _palette([images[i] for i in np.unique(np.linspace(0, count - 1, 8).astype(int))])
    # nearest colour of the palette for every colour of six bits a channel, white and black exact
    grid = np.stack(np.meshgrid(*[np.arange(64) * (255.0 / 63.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    nearest = np.asarray(KDTree(palette).query(grid)[1]).astype(np.uint8)
    drawn = []
    for image in images:
        r, g, b = (image[..., c].astype(np.int64) >> 2 for c in range(3))
        drawn.append(Image.fromarray(nearest[(r << 12) + (g << 6) + b]))
        drawn[-1].putpalette(palette.ravel().tolist())
    # whole hundredths of a second that keep in step with the time
    ticks = np.rint(100.0 * slow * np.arange(count + 1) / rate)
    durations = [int(10 * d) for d in np.maximum(np.diff(ticks), 2)]
    with replacing(path) as temporary:
        drawn[0].save(
            temporary, format="GIF", save_all=True, append_images=drawn[1:], duration=durations, loop=0, optimize=False
        )
    return count


def _palette(images: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Colours that stand for those of some images, (k, 3); white is one of them."""
    found = Image.fromarray(np.concatenate(images)).quantize(_COLOURS, method=Image.Quantize.MEDIANCUT)
    colours = np.array(found.getpalette(), dtype=np.uint8).reshape(-1, 3)
    colours[int(colours.sum(axis=1, dtype=np.int64).argmax())] = 255
    return colours


def _checked(
    path: str | os.PathLike[str],
    times: ArrayLike,
    parts: Sequence[Silhouette],
    feet: Mapping[str, Trail],
    outlines: Sequence[Outline],
    positive: Sequence[tuple[str, float]],
) -> Array:
    """The times as an array, once everything fits them."""
    t = np.atleast_1d(np.asarray(times, dtype=float))
    for name, value in positive:
        if not (math.isfinite(value) and value > 0.0):
            raise FileError(f"{path}: {name}: found {value!r}, expected a number above 0")
    if t.ndim != 1 or len(t) < 2 or not (np.diff(t) > 0.0).all():
        raise FileError(f"{path}: times: found shape {t.shape}, expected at least two that increase")
    if not parts:
        raise FileError(f"{path}: found no part to draw, expected at least one")
    rows: dict[str, tuple[Any, tuple[int | None, ...]]] = {}
    for k, part in enumerate(parts):
        rows[f"part {k}"] = (part.points, (2, None))
        if part.glow is not None:
            rows[f"glow of part {k}"] = (part.glow, ())
    for k, line in enumerate(outlines):
        rows[f"outline {k}"] = (line.points, (2, None))
    for name, foot in feet.items():
        rows |= {name: (foot.points, (2,)), f"{name}: state": (foot.state, ())}
        rows |= {f"{name}: {k}": (v, (2,)) for k, v in (("force", foot.force), ("base", foot.base)) if v is not None}
    for name, (values, shape) in rows.items():
        array = np.asarray(values, dtype=float)
        fits = array.ndim == 1 + len(shape) and array.shape[0] == len(t)
        if not fits or any(want not in (None, got) for want, got in zip(shape, array.shape[1:], strict=True)):
            raise FileError(f"{path}: {name}: found shape {array.shape}, expected one row for each of {len(t)} times")
        if not np.isfinite(array).all():
            raise FileError(f"{path}: {name}: values that are not finite cannot be drawn")
    return t


def _at(times: Array, values: ArrayLike, moment: float) -> Any:
    """Values (t, ...) at a moment, linear between samples."""
    rows = np.asarray(values, dtype=float)
    i = int(np.clip(np.searchsorted(times, moment, side="right") - 1, 0, len(times) - 2))
    share = float(np.clip((moment - times[i]) / (times[i + 1] - times[i]), 0.0, 1.0))
    return (1.0 - share) * rows[i] + share * rows[i + 1]


class _Scene:
    """The figure of one animation; `show` moves it to a moment."""

    def __init__(
        self,
        times: Array,
        parts: Sequence[Silhouette],
        feet: Mapping[str, Trail],
        outlines: Sequence[Outline],
        ground: float,
        weight: float | None,
        width: int,
        title: str,
    ) -> None:
        self.times, self.parts, self.feet, self.weight, self.outlines = times, parts, feet, weight, outlines
        low = np.min([each.points.min(axis=(0, 2)) for each in (*parts, *outlines)], axis=0)
        high = np.max([each.points.max(axis=(0, 2)) for each in (*parts, *outlines)], axis=0)
        span = high - np.array([low[0], min(low[1], ground)])
        pad = 0.06 * float(span.max())
        self.height = float(high[1] - ground)
        bottom, top = ground - 0.8 * pad, float(high[1]) + pad
        wide = float(span[0]) + 2.0 * pad
        # inches: margins, the machine to scale, the feet's ways
        left, right, head, gap, foot = 0.62, 0.15, 0.42, 0.08, 0.52
        across = width / _DPI - left - right
        view = across * (top - bottom) / wide
        ways = 0.32 * across if feet else 0.0
        tall = head + view + gap + ways + foot
        self.figure = Figure(figsize=(width / _DPI, tall), dpi=_DPI, facecolor="white")
        self.canvas = FigureCanvasAgg(self.figure)
        box = (left / (width / _DPI), (foot + ways + gap) / tall, across / (width / _DPI), view / tall)
        axes = self.figure.add_axes(box)
        axes.set_xlim(float(low[0]) - pad, float(high[0]) + pad)
        axes.set_ylim(bottom, top)
        axes.spines[["top", "right", "left", "bottom"]].set_visible(False)
        axes.set_yticks([])
        axes.tick_params(labelbottom=not feet, length=0, labelsize=8.5, colors=INK)
        axes.axhspan(bottom, ground, color=_SOIL, linewidth=0.0, zorder=0)
        axes.axhline(ground, color=SOFT, linewidth=1.0, zorder=1)
        self.faces: list[tuple[PolyCollection, PolyCollection]] = []
        for number in range(len(parts)):
            edge = PolyCollection([], facecolors="none", edgecolors=INK, linewidths=2.8, zorder=2 + 2 * number)
            face = PolyCollection([], linewidths=1.2, zorder=3 + 2 * number)
            edge.set_joinstyle("round")
            axes.add_collection(edge, autolim=False)
            axes.add_collection(face, autolim=False)
            self.faces.append((edge, face))
        self.over = [
            axes.plot([], [], color=line.colour, linewidth=1.8, zorder=3.5 + 2 * len(parts), label=line.label)[0]
            for line in outlines
        ]
        style = {"arrowstyle": "-|>", "color": INK, "lw": 1.8, "shrinkA": 0, "shrinkB": 0}
        self.forced = [foot for foot in feet.values() if weight is not None and foot.force is not None]
        self.arrows = [
            axes.annotate("", (0.0, 0.0), (0.0, 0.0), zorder=4 + 2 * len(parts), arrowprops=style) for _ in self.forced
        ]
        x0, x1, y = left / (width / _DPI), 1.0 - right / (width / _DPI), 1.0 - 0.12 / tall
        self.figure.text(x0, y, title, fontsize=11.5, color=INK, va="top")
        self.clock = self.figure.text(x1, y, "", fontsize=10.0, color=INK, va="top", ha="right")
        named = list({line.get_label(): line for line in self.over if line.get_label()}.values())
        if not feet:
            if named:
                axes.legend(handles=named, frameon=False, fontsize=8.5, labelcolor=INK, loc="upper right")
            axes.set_xlabel("forward [mm]", fontsize=9.5, color=INK)
            return
        self._ways(axes, (box[0], foot / tall, box[2], ways / tall))
        legend = [
            Line2D([], [], color=_WAYS[k], linewidth=3.0, label=f"foot {name}s") for k, name in enumerate(STATES) if k
        ]
        if self.forced:
            legend.append(Line2D([], [], color=INK, marker=r"$\uparrow$", linestyle="", label="force of the ground"))
        legend += named
        self.figure.legend(
            handles=legend, frameon=False, fontsize=8.5, labelcolor=INK, ncols=3 + len(named), loc="upper center",
            bbox_to_anchor=(0.5, 1.0 - 0.06 / tall), borderaxespad=0.0,
        )  # fmt: skip

    def _ways(self, above: Any, box: tuple[float, float, float, float]) -> None:
        """Below the machine: where each foot was, time downward."""
        axes = self.figure.add_axes(box)
        axes.set_xlim(*above.get_xlim())
        axes.set_ylim(float(self.times[-1]), float(self.times[0]))
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(SOFT)
        axes.grid(color=GRID, linewidth=0.8)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=8.5, colors=INK, width=0.7)
        axes.set_xlabel("forward [mm]", fontsize=9.5, color=INK)
        axes.set_ylabel("time [s]", fontsize=9.5, color=INK)
        self.lines: list[tuple[Array, LineCollection]] = []
        for name, foot in self.feet.items():
            way = np.stack([np.asarray(foot.points)[:, 0], self.times], axis=1)
            state = np.asarray(foot.state).astype(int)[1:]
            line = LineCollection(
                [], linewidths=np.where(state == 0, 1.0, 3.0).tolist(), colors=[_WAYS[k] for k in state]
            )
            axes.add_collection(line, autolim=False)
            self.lines.append((np.stack([way[:-1], way[1:]], axis=1), line))
            axes.annotate(
                name, way[0], (7.0, -4.0), textcoords="offset points", fontsize=8.5, color=SOFT, va="top"
            )  # fmt: skip

    def show(self, moment: float) -> None:
        """Move everything to a moment."""
        for part, (edge, face) in zip(self.parts, self.faces, strict=True):
            corners = _at(self.times, part.points, moment)[:, part.triangles].transpose(2, 1, 0)
            glow = 1.0 if part.glow is None else float(np.clip(_at(self.times, part.glow, moment), 0.0, 1.0))
            colour = 1.0 - (0.35 + 0.65 * glow) * (1.0 - np.array(to_rgb(part.colour)))
            edge.set_verts(corners)
            face.set_verts(corners)
            face.set_facecolor(tuple(colour))
            face.set_edgecolor(tuple(colour))
        for line, drawn in zip(self.outlines, self.over, strict=True):
            drawn.set_data(*_at(self.times, line.points, moment))
        self.clock.set_text(f"{moment:.2f} s")
        for arrow, foot in zip(self.arrows, self.forced, strict=True):
            assert self.weight is not None
            base = _at(self.times, foot.points if foot.base is None else foot.base, moment)
            # a mean since the sample before, so it is that of the next sample
            force = np.asarray(foot.force)[min(int(np.searchsorted(self.times, moment - 1e-9)), len(self.times) - 1)]
            tip = base + force * self.height / (3.0 * self.weight)
            arrow.set_visible(bool(np.linalg.norm(force) > 0.02 * self.weight))
            arrow.xy, arrow.xyann = tuple(tip), tuple(base)
        if self.feet:
            # pieces of the ways up to here, the last one cut off at the moment
            past = int(np.searchsorted(self.times, moment, side="right")) - 1
            for foot, (pieces, line) in zip(self.feet.values(), self.lines, strict=True):
                end = np.array([_at(self.times, foot.points, moment)[0], moment])
                last = np.array([[pieces[past][0], end]]) if past < len(pieces) else pieces[:0]
                line.set_segments(list(np.concatenate([pieces[:past], last])))

    def image(self) -> NDArray[np.uint8]:
        """What is shown, (height, width, 3)."""
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[..., :3].copy()
