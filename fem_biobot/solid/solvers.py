"""Which linear solver serves a model: one that factors, or for large displacement models conjugate gradients."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fem_biobot.errors import ModelError
from fem_biobot.solid.direct import LinearSolver
from fem_biobot.solid.multigrid.solver import TwoLevelSolver
from fem_biobot.solid.multigrid.two_level import TwoLevel
from fem_biobot.solid.newton import MANY, NewtonSettings, StepSolver

if TYPE_CHECKING:
    from fem_biobot.solid.model import SolidModel

# unknowns up to which a factor in double precision takes no time worth saving
FEW = 10_000


def linear_solver(model: SolidModel, settings: NewtonSettings | None = None) -> StepSolver:
    """A linear solver that several calls of `solve` can share; `NewtonSettings.linear` says which."""
    settings, system = settings or NewtonSettings(), model.system
    able = system.mixed is None and system.space.quadratic and system.symmetric
    if settings.linear == "iterative" and not able:
        what = f"element {model.element}" if system.symmetric else "loads or laws without a potential"
        raise ModelError(f"linear: found 'iterative' with {what}, expected element P2 and a symmetric tangent")
    if able and (settings.linear == "iterative" or (settings.linear == "auto" and model.n_dofs > MANY)):
        own = system.held
        return TwoLevelSolver(TwoLevel(system.pattern, system.space.nodes, own.turned, own.axes, own.dofs))
    return direct_solver(model, settings, single=model.n_dofs > FEW)


def direct_solver(model: SolidModel, settings: NewtonSettings | None = None, *, single: bool = False) -> LinearSolver:
    """A linear solver that factors, however large the model; in single precision if wished and the matrix allows."""
    system = model.system
    steadying = (system.mixed.compliance_places, system.mixed.steadying) if system.mixed else None
    settings = settings or NewtonSettings()
    return LinearSolver(system.pattern, settings, steadying=steadying, symmetric=system.symmetric, single=single)
