"""Compile the rods' kernels before they are needed, and say so: the first run on a machine must not look stuck."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np

from fem_biobot.friction import kernels as contact_kernels
from fem_biobot.rod.dynamics import kernels as implicit_kernels
from fem_biobot.rod.dynamics.book import kernels as book_kernels
from fem_biobot.rod.dynamics.integrate import Integrator, Settings, dynamics
from fem_biobot.rod.dynamics.run import kernels as run_kernels
from fem_biobot.rod.explicit import kernels as explicit_kernels
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Rod
from fem_biobot.rod.section import RodMaterial, Section

# those that a run calls itself, and what compiling them takes on one processor, with all that they call [s]
_CALLED = {
    Integrator.implicit: (
        (run_kernels, "implicit_run"),
        (implicit_kernels, "try_step"),
        (implicit_kernels, "factorise"),
        (book_kernels, "accept"),
        (contact_kernels, "solve_friction"),
    ),
    Integrator.explicit: ((explicit_kernels, "explicit_run"), (explicit_kernels, "joint_masses")),
}
_SECONDS = {Integrator.implicit: 60, Integrator.explicit: 10}


class Listener(Protocol):
    """Told that compilation begins and ends."""

    def stage(self, name: str, total: int | None = None) -> None: ...

    def advance(self, done: str = "") -> None: ...


def cached(integrator: Integrator = Integrator.implicit) -> bool:
    """Whether compiled kernels of these sources lie on disk: their folder is named by them (`kernel_cache`)."""
    for module, name in _CALLED[integrator]:
        source = Path(str(module.__file__))
        stats: Any = getattr(getattr(module, name), "stats", None)
        if stats is None:
            continue
        if not any(Path(stats.cache_path).glob(f"{source.stem}.{name}-*.nbi")):
            return False
    return True


def compile_kernels(listener: Listener, integrator: Integrator = Integrator.implicit) -> None:
    """Load an integrator's kernels from numba's cache, or compile them there, by one step of one short rod."""
    fresh = not cached(integrator)
    if fresh:
        what = (
            f"compiling the kernels of {integrator} time steps (once on this machine, about {_SECONDS[integrator]} s)"
        )
        listener.stage(what, 1)
    material = RodMaterial(young=100.0, poisson=0.3, density=1e-6)
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    touching = ContactPoints(("rod", 0), [(0.0, 0.0, 0.0)])
    model = RodModel([Rod(points, Section.circle(0.1), material)], contacts=[touching])
    dynamics(model, 1e-7, 1e-7, ground=Ground(), settings=Settings(integrator=integrator))
    if fresh:
        listener.advance("kernels compiled")
