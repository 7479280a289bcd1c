"""Material frames along a rod as drawn: tangents of the circle through three nodes, normals carried without twist."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]


def node_frames(points: Array, normal: Array | None, name: str = "rod") -> Array:
    """Directors at the nodes of a drawn rod, rows, (n, 3, 3); the third is the tangent.

    Parameters
    ----------
    points
        Node positions, (n, 3) [mm].
    normal
        Wanted direction of the first director, (3,); None for some perpendicular of the first chord.
    name
        Of the rod, for messages.

    Notes
    -----
    The tangent at a node is that of the circle through it and its two neighbours, at an end that of the circle's next
    arc, so that frames are exact on circular arcs. The normal is carried from node to node by reflections (Wang,
    Juettler, Zheng and Liu 2008, double reflection), which adds no twist.
    """
    t = tangents(points)
    first = _perpendicular(t[0]) if normal is None else np.asarray(normal, dtype=float)
    d1 = first - t[0] * (first @ t[0])
    if np.linalg.norm(d1) < 1e-9 * np.linalg.norm(first):
        raise ModelError(f"rod {name}: normal: found a direction along the rod, expected one across it")
    d1 /= np.linalg.norm(d1)
    frames = np.empty((len(points), 3, 3))
    for i in range(len(points)):
        if i:
            d1 = _carry(points[i] - points[i - 1], t[i - 1], t[i], d1)
        frames[i] = np.array([d1, np.cross(t[i], d1), t[i]])
    return frames


def tangents(points: Array) -> Array:
    """Unit tangents at the nodes, (n, 3): of the circle through three neighbouring nodes."""
    chords = np.diff(points, axis=0)
    lengths = np.linalg.norm(chords, axis=1)
    c = chords / lengths[:, None]
    inner = c[:-1] * lengths[1:, None] + c[1:] * lengths[:-1, None]
    sizes = np.linalg.norm(inner, axis=1)
    # a chain that turns back on itself has no tangent there; any perpendicular of it will do as little
    inner = np.where(sizes[:, None] > 1e-12 * (lengths[1:] + lengths[:-1])[:, None], inner, c[1:])
    inner /= np.linalg.norm(inner, axis=1)[:, None]
    if len(c) == 1:
        return np.array([c[0], c[0]])
    start = 2.0 * c[0] * (c[0] @ inner[0]) - inner[0]
    end = 2.0 * c[-1] * (c[-1] @ inner[-1]) - inner[-1]
    return np.vstack([start, inner, end])


def _perpendicular(t: Array) -> Array:
    """The coordinate direction that is most across `t`."""
    return np.eye(3)[int(np.abs(t).argmin())]


def _carry(step: Array, before: Array, after: Array, d1: Array) -> Array:
    """Carry a normal from one node to the next by two reflections."""
    reflected = d1 - 2.0 / (step @ step) * (step @ d1) * step
    turned = before - 2.0 / (step @ step) * (step @ before) * step
    across = after - turned
    size = across @ across
    found = reflected - (2.0 / size * (across @ reflected) * across if size > 1e-30 else 0.0)
    found -= after * (after @ found)
    return found / np.linalg.norm(found)
