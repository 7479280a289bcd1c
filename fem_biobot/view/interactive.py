"""Interactive views of a page: surfaces that move through states or times, coloured by fields, turned by the reader.

A `Moving` holds plain arrays of surfaces alone; `figure` makes it a piece of a page that works from a file, without a
network. What runs in the browser is `viewer.js`, our own WebGL 2: a page of vtk.js brings 1.0 MB of script without
states or times, k3d 2.6 MB and a notebook stack. Positions and values are whole numbers of sixteen bits, a
65 000th of the extent, finer than any screen.
"""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from fem_biobot.errors import FileError
from fem_biobot.view.scene import colour_map

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_HERE = Path(__file__).parent
_MOST_PARTS = 31  # one bit each
_NONE = 65535  # of a value that is not there
# data hold no "<"
_PIECE = re.compile(r'<figure class="view3d"><h2>(.*?)</h2>\n(.*?)</figure>', re.DOTALL)
FALLBACK = "This view needs a browser with scripts and WebGL 2; the pictures of this page show the same."


@dataclass(frozen=True, eq=False)
class Coloured:
    """A field that a view can show.

    Attributes
    ----------
    label
        What it is, with its unit in brackets.
    values
        At the points in every state, (k, n) or, if they stay, (n,); not a number where there is no such thing, which
        leaves the point in the colour of its part.
    limits
        Values at the ends of the colours.
    colours
        As of `scene.Bar`.
    note
        Said under the colour bar.
    """

    label: str
    values: Array
    limits: tuple[float, float]
    colours: str = "stress"
    note: str = ""


@dataclass(frozen=True, eq=False)
class Moving:
    """Surfaces in states or at times.

    Attributes
    ----------
    title, caption
        Above and below the view.
    points
        Positions in every state, (k, 3, n) [mm]; the first is what a deformation is exaggerated from.
    triangles, edges
        Of the points, (3, f) and (2, s).
    part
        Number of the part that each point belongs to, (n,); a triangle's points belong to one.
    parts
        Name to colour, in the order of their numbers.
    labels
        One for each state; times are labelled by themselves.
    times
        Of the states, rising (k,) [s]; None where they are no times.
    fields
        To colour by; the first is shown at first.
    shown
        Number of the state shown at first; -1 is the last.
    exaggerated
        Whether the reader may exaggerate the deformation.
    """

    title: str
    points: Array
    triangles: Ints
    part: Ints
    parts: Mapping[str, str]
    labels: Sequence[str] = ()
    times: Array | None = None
    edges: Ints = field(default_factory=lambda: np.zeros((2, 0), dtype=np.int64))
    fields: Sequence[Coloured] = ()
    caption: str = ""
    shown: int = -1
    exaggerated: bool = False


@dataclass(frozen=True)
class Piece:
    """A view of another page, as it stands there.

    Attributes
    ----------
    title
        Above the view, as HTML.
    body
        What follows it.
    """

    title: str
    body: str


def pieces_of(page: str) -> list[Piece]:
    """The views of a page that `figure` made."""
    return [Piece(*found.groups()) for found in _PIECE.finditer(page)]


def figure(moving: Moving | Piece) -> str:
    """A view as a piece of a page; the page needs `style` and, after all figures, `script` once.

    Raises
    ------
    FileError
        Arrays that do not fit each other or hold what is not a finite number.
    """
    if isinstance(moving, Piece):
        return _framed(moving.title, moving.body)
    data = json.dumps(_packed(moving), separators=(",", ":")).replace("<", "\\u003c")
    title, caption = html.escape(moving.title), html.escape(moving.caption)
    return _framed(
        title,
        f'<div class="fallback">{FALLBACK}</div>\n<script type="application/json">{data}</script>\n'
        f"<figcaption>{caption}</figcaption>",
    )


def _framed(title: str, body: str) -> str:
    return f'<figure class="view3d"><h2>{title}</h2>\n{body}</figure>'


def style() -> str:
    """The style sheet of all views of a page."""
    return (_HERE / "viewer.css").read_text(encoding="utf-8").strip()


def script() -> str:
    """The script of all views of a page."""
    return (_HERE / "viewer.js").read_text(encoding="utf-8").strip()


def _packed(moving: Moving) -> dict[str, Any]:
    """The arrays as the script reads them, points that no triangle and no edge uses left out."""
    _check(moving)
    used, numbers = np.unique(np.concatenate([moving.triangles.ravel(), moving.edges.ravel()]), return_inverse=True)
    n_faces = moving.triangles.size
    points = np.asarray(moving.points, dtype=float)[:, :, used]
    low, high = points.min(axis=(0, 2)), points.max(axis=(0, 2))
    extent = np.where(high > low, high - low, 1.0)
    whole = np.rint((points - low[:, None]) / extent[:, None] * 65535.0)
    frames = points.shape[0]
    return {
        "title": moving.title,
        "n": len(used),
        "frames": frames,
        "labels": list(moving.labels),
        "times": None if moving.times is None else [round(float(t), 6) for t in moving.times],
        "shown": moving.shown % frames,
        "gain": moving.exaggerated,
        "low": low.tolist(),
        "high": (low + extent).tolist(),
        "positions": _text(whole.swapaxes(1, 2), "<u2"),
        "n_triangles": moving.triangles.shape[1],
        "triangles": _text(numbers[:n_faces].reshape(3, -1).T, "<u4"),
        "n_edges": moving.edges.shape[1],
        "edges": _text(numbers[n_faces:].reshape(2, -1).T, "<u4"),
        "part": _text(np.asarray(moving.part)[used], "u1"),
        "parts": [
            {"name": name, "colour": [round(255 * c) for c in to_rgb(colour)]} for name, colour in moving.parts.items()
        ],
        "fields": [_packed_field(each, used, frames) for each in moving.fields],
    }


def _packed_field(coloured: Coloured, used: Ints, frames: int) -> dict[str, Any]:
    values = np.broadcast_to(coloured.values, (frames, np.shape(coloured.values)[-1]))[:, used]
    there = np.isfinite(values)
    low, high = float(values[there].min()), float(values[there].max())
    # limits may lie outside of what there is
    low, high = min(low, coloured.limits[0]), max(high, coloured.limits[1])
    high = high if high > low else low + 1.0
    whole = np.where(there, np.rint((np.where(there, values, low) - low) / (high - low) * (_NONE - 1)), _NONE)
    ramp = np.rint(255.0 * np.asarray(colour_map(coloured.colours)(np.arange(256)))[:, :3])
    return {
        "label": coloured.label,
        "note": coloured.note,
        "limits": list(coloured.limits),
        "range": [low, high],
        "values": _text(whole, "<u2"),
        "ramp": _text(ramp, "u1"),
    }


def _text(values: NDArray[Any], kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values).astype(kind).tobytes()).decode("ascii")


def _check(moving: Moving) -> None:
    """Refuse what the script would show wrongly."""
    name, shape = f"view {moving.title!r}", np.shape(moving.points)
    if len(shape) != 3 or shape[1] != 3 or not shape[0] or not np.isfinite(moving.points).all():
        raise FileError(f"{name}: points: found shape {shape}, expected finite ones of shape (k, 3, n)")
    frames, _, n = shape
    highest = max(int(each.max()) if each.size else 0 for each in (moving.triangles, moving.edges))
    if not moving.triangles.size or highest >= n:
        raise FileError(f"{name}: triangles: found point {highest}, expected some triangles of points below {n}")
    part, count = np.asarray(moving.part), len(moving.parts)
    if part.shape != (n,) or not 0 < count <= _MOST_PARTS or part.min() < 0 or part.max() >= count:
        raise FileError(
            f"{name}: part: found {count} parts and shape {part.shape}, expected 1 to {_MOST_PARTS} parts and a number "
            f"for each of {n} points"
        )
    if moving.times is None and len(moving.labels) != frames:
        raise FileError(f"{name}: labels: found {len(moving.labels)}, expected one for each of {frames} states")
    if moving.times is not None and (np.shape(moving.times) != (frames,) or np.any(np.diff(moving.times) <= 0.0)):
        raise FileError(f"{name}: times: found {np.shape(moving.times)}, expected {frames} that rise")
    for each in moving.fields:
        values = np.asarray(each.values)
        fits = values.shape in ((n,), (frames, n)) and np.isfinite(values).any()
        if not fits or not each.limits[1] > each.limits[0]:
            raise FileError(
                f"{name}: field {each.label}: found shape {values.shape} and limits {each.limits}, expected a value "
                f"for each of {n} points and limits that rise"
            )
