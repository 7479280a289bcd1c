"""Compile the kernels before they are needed, and say so: the first run on a machine must not look stuck."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np

from fem_biobot.material import kernels as material_kernels
from fem_biobot.material.active import ActiveStress
from fem_biobot.material.natural_state import NaturalState
from fem_biobot.material.neo_hooke import NeoHooke
from fem_biobot.material.tension import kernels as tension_kernels
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid import kernels
from fem_biobot.solid.mixed import kernels as mixed_kernels
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import Fix
from fem_biobot.solid.space import Element
from fem_biobot.solid.vectors import kernels as vector_kernels


class Listener(Protocol):
    """Told that compilation begins and ends."""

    def stage(self, name: str, total: int | None = None) -> None: ...

    def advance(self, done: str = "") -> None: ...


def cached(element: Element | str = Element.P2) -> bool:
    """Whether compiled kernels newer than their sources lie on disk, those of an element included."""
    modules = (
        kernels,
        material_kernels,
        tension_kernels,
        vector_kernels,
        *((mixed_kernels,) if element == Element.P2P1 else ()),
    )
    for module in modules:
        source = Path(str(module.__file__))
        for kernel in vars(module).values():
            stats: Any = getattr(kernel, "stats", None)
            if stats is None:
                continue
            index = list(Path(stats.cache_path).glob(f"{source.stem}.{kernel.__name__}-*.nbi"))
            if not any(file.stat().st_mtime >= source.stat().st_mtime for file in index):
                return False
    return True


def compile_kernels(listener: Listener, element: Element | str = Element.P2) -> None:
    """Load the kernels from numba's cache, or compile them there, by solving one small contracting cube."""
    fresh = not cached(element)
    if fresh:
        listener.stage("compiling the kernels (once on this machine, about 20 s)", 1)
    points = np.array([[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=float)
    cells = np.array([[0], [1], [2], [3]])
    mesh = BodyMesh(points, cells, {"muscle": np.array([0])})
    F0 = np.eye(3)[:, :, None]
    law = NaturalState(NeoHooke(10.0, 0.3), F0)
    supports = [Fix((0.0, 0.0, 0.0)), Fix((1.0, 0.0, 0.0), "yz"), Fix((0.0, 1.0, 0.0), "z")]
    active = {"muscle": ActiveStress(0.1, np.array([1.0, 0.0, 0.0]))}
    # the displacement element's kernels are the mixed one's too
    for kind in dict.fromkeys((Element.P2, Element(element))):
        solve(SolidModel(mesh, {"muscle": law}, active, supports, element=kind), [1.0])
    if fresh:
        listener.advance("kernels compiled")
