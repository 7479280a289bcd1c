"""What several tests share: generic deformations, Taylor slopes, watched inputs, and bodies of the cases.

No expected number is made here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.material.law import PAIRS
from fem_biobot.verification.blocks import (
    FACES,
    TIGHT,
    box_mesh,
    committed_bot,
    generator,
    hold_everywhere,
    on_three_corners,
    rotation,
    turned_about,
    unit,
)
from fem_biobot.verification.records import order as slope

__all__ = [
    "FACES",
    "TIGHT",
    "box_mesh",
    "committed_bot",
    "generator",
    "generic_gradients",
    "hold_everywhere",
    "on_three_corners",
    "plain_python",
    "rotation",
    "slope",
    "taylor_slope",
    "turned_about",
    "unchanged",
    "unit",
    "unpack",
    "unpack_tangent",
]

Array = NDArray[np.float64]


def generic_gradients(n: int = 10, size: float = 0.35, seed: int = 2718) -> Array:
    """Generic deformation gradients with ``0.4 < det F < 2.5``, far from symmetric, (3, 3, n)."""
    draw = generator(seed)
    found: list[Array] = []
    while len(found) < n:
        F = np.eye(3) + size * draw.normal(size=(3, 3))
        if 0.4 < np.linalg.det(F) < 2.5:
            found.append(F)
    return np.stack(found, axis=-1)


def taylor_slope(value: Callable[[float], Array], derivative: Array) -> Array:
    """Rate at which ``value(eps) - value(0) - eps derivative`` falls with eps, for every trailing entry.

    2 for a right derivative, 1 for a wrong one. `value` returns (..., n); norms are taken over the leading axes.
    """
    eps = 2.0 ** -np.arange(6, 13)
    at0 = value(0.0)
    rest = np.stack([_norms(value(e) - at0 - e * derivative) for e in eps])  # (steps, n)
    x = np.log(eps) - np.log(eps).mean()
    return (x @ (np.log(rest) - np.log(rest).mean(axis=0))) / (x @ x)


def _norms(a: Array) -> Array:
    return np.sqrt(np.sum(a.reshape(-1, a.shape[-1]) ** 2, axis=0))


@contextmanager
def unchanged(*arrays: Array) -> Iterator[None]:
    """The arrays hold the same bytes afterwards."""
    before = [a.tobytes() for a in arrays]
    yield
    assert [a.tobytes() for a in arrays] == before, "an input was changed"


def unpack(packed: Array) -> Array:
    """Symmetric tensor (3, 3, ...) from its six components (6, ...) in the order of `PAIRS`."""
    full = np.empty((3, 3, *packed.shape[1:]))
    for a, (i, j) in enumerate(PAIRS):
        full[i, j] = full[j, i] = packed[a]
    return full


def unpack_tangent(packed: Array) -> Array:
    """Fourth-order tensor (3, 3, 3, 3, ...) with both minor symmetries from its packed upper triangle (21, ...)."""
    full = np.empty((3, 3, 3, 3, *packed.shape[1:]))
    place = 0
    for a, (i, j) in enumerate(PAIRS):
        for k, m in PAIRS[a:]:
            for p, q in ((i, j), (j, i)):
                for r, s in ((k, m), (m, k)):
                    full[p, q, r, s] = full[r, s, p, q] = packed[place]
            place += 1
    return full


@contextmanager
def plain_python(module: object, *names: str) -> Iterator[None]:
    """Compiled kernels of `module` replaced by the Python they were compiled from."""
    with pytest.MonkeyPatch.context() as patch:
        for name in names:
            kernel = getattr(module, name)
            patch.setattr(module, name, getattr(kernel, "py_func", kernel))
        yield
