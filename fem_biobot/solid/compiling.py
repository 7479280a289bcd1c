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
from fem_biobot.solid.interface import kernels as contact_kernels
from fem_biobot.solid.interface.rays import kernels as ray_kernels
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.solid.mixed import kernels as mixed_kernels
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import Fix
from fem_biobot.solid.space import Element
from fem_biobot.solid.vectors import kernels as vector_kernels


class Listener(Protocol):
    """Told that compilation begins and ends."""

    def stage(self, name: str, total: int | None = None) -> None: ...

    def advance(self, done: str = "") -> None: ...


def cached(element: Element | str = Element.P2, *, sliding: bool = False) -> bool:
    """Whether kernels compiled from these sources lie on disk, those of an element (and of contact) included."""
    modules = (
        kernels,
        material_kernels,
        tension_kernels,
        vector_kernels,
        *((mixed_kernels,) if element == Element.P2P1 else ()),
        *((contact_kernels, ray_kernels) if sliding else ()),
    )
    for module in modules:
        source = Path(str(module.__file__))
        for kernel in vars(module).values():
            stats: Any = getattr(kernel, "stats", None)
            # kernels that a module takes from another are that one's
            home = getattr(getattr(kernel, "py_func", None), "__module__", module.__name__)
            if stats is None or home != module.__name__:
                continue
            # the folder is named after the sources, so that what lies there is of these
            if not any(Path(stats.cache_path).glob(f"{source.stem}.{kernel.__name__}-*.nbi")):
                return False
    return True


def compile_kernels(listener: Listener, element: Element | str = Element.P2, *, sliding: bool = False) -> None:
    """Load the kernels from numba's cache, or compile them there, by solving one small contracting cube.

    With `sliding` also those of parts that slide on each other, by pressing one tetrahedron on another.
    """
    fresh = not cached(element, sliding=sliding)
    if fresh:
        listener.stage(f"compiling the kernels (once on this machine, about {40 if sliding else 20} s)", 1)
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
    if sliding:
        _press(points)
    if fresh:
        listener.advance("kernels compiled")


def _press(points: np.ndarray) -> None:
    """Press one tetrahedron on another, on nodes of its own."""
    apart = BodyMesh(
        np.hstack([points, points * np.array([[1.0], [1.0], [-1.0]])]),
        np.array([[0, 4], [1, 6], [2, 5], [3, 7]]),
        {"muscle": np.array([0]), "skeleton": np.array([1])},
        {"body": np.array([[0], [2], [1]]), "bearing": np.array([[4], [5], [6]])},
    )
    laws = {"muscle": NeoHooke(10.0, 0.3), "skeleton": NeoHooke(50.0, 0.3)}
    held = [Fix((0.0, 0.0, -1.0)), Fix("bearing"), Fix((0.0, 0.0, 1.0), value=(0.0, 0.0, -0.01))]
    solve(SolidModel(apart, laws, {}, held, sliding=Sliding("bearing", "body", 0.3)), [1.0])
