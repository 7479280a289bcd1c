"""Lines along a field of fibres, for pictures: from seeds both ways, as far as the tissue goes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# elements whose directions are averaged at a point of a line
_NEAR = 6


def streamlines(X: Array, a0: Array, sizes: Array, seeds: Ints, *, length: float, step: float) -> list[Array]:
    """Lines that follow a field of directions.

    Parameters
    ----------
    X, a0, sizes
        Middles (3, e) [mm], unit directions (3, e) [1] and lengths (e,) [mm] of the elements; the sense of a direction
        means nothing, a line keeps its own.
    seeds
        Elements from whose middles lines start, (s,).
    length, step
        How far a line goes to each side at most, and the length of its pieces [mm].

    Returns
    -------
    list
        Positions along each line, (3, k) [mm], k at least 2; they end where the tissue does.

    Notes
    -----
    Midpoint rule with the mean dyad of the nearest elements, weighted by nearness.
    """
    tree = KDTree(X.T)
    halves = []
    for sense in (1.0, -1.0):
        x, heading = X[:, seeds].copy(), sense * a0[:, seeds]
        going = np.ones(len(seeds), dtype=bool)
        path = [x.copy()]
        for _ in range(max(1, round(length / step))):
            first, _ = _direction(tree, a0, sizes, x, heading)
            ahead, inside = _direction(tree, a0, sizes, x + 0.5 * step * first, first)
            new = x + step * ahead
            _, there = _direction(tree, a0, sizes, new, ahead)
            going &= inside & there
            x, heading = np.where(going, new, x), np.where(going, ahead, heading)
            path.append(np.where(going, x, np.nan))
            if not going.any():
                break
        halves.append(np.stack(path))  # (t, 3, s)
    lines = []
    for s in range(len(seeds)):
        line = np.concatenate([halves[1][:0:-1, :, s], halves[0][:, :, s]]).T
        line = line[:, np.isfinite(line[0])]
        if line.shape[1] > 1:
            lines.append(line)
    return lines


def _direction(tree: KDTree, a0: Array, sizes: Array, x: Array, heading: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Mean direction at positions in the sense of a heading, (3, s), and whether there is tissue, (s,)."""
    distance, near = tree.query(x.T, k=min(_NEAR, a0.shape[1]))
    distance, near = distance.reshape(x.shape[1], -1), near.reshape(x.shape[1], -1)
    a = a0[:, near]
    weight = 1.0 / (distance + 0.1 * sizes[near])
    signed = np.where(np.einsum("is,isk->sk", heading, a) < 0.0, -1.0, 1.0)
    mean = np.einsum("isk,sk->is", a, weight * signed)
    length = np.linalg.norm(mean, axis=0)
    inside = (distance[:, 0] <= 0.75 * sizes[near[:, 0]]) & (length > 0.0)
    return mean / np.where(length > 0.0, length, 1.0), inside
