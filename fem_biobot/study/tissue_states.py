"""Passive and stimulated state of one tissue on the solid, in the numbers that an experimenter would have."""

from __future__ import annotations

from typing import Any

from fem_biobot.design import Design
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.study.plan import Solver, Wanted
from fem_biobot.study.reporter import Silent

_STEPS = 3  # up to the passive state


def passive_and_active(design: Design, mesh: BodyMesh) -> dict[str, float]:
    """Forces of a bot's muscle as moulded: standing, and what stimulation adds to them.

    Parameters
    ----------
    design
        A bot with a muscle.
    mesh
        Of it.

    Returns
    -------
    dict
        ``passive_mN`` and ``active_mN`` through the muscle's section; ``passive_eq3_mN`` and ``active_eq3_mN`` as Eq. 3
        infers them from the sagitta; tip closing and stroke [mm], fibre stretch in the passive state.

    Raises
    ------
    SolveError
        A state that was not found.
    """
    solver = Solver(design, mesh, Silent())
    standing, whole = design.tension(0.0), design.tension(design.drive.amplitude)
    for k in range(1, _STEPS):
        tension = k / _STEPS * standing
        solver.solve(Wanted(f"passive_{k}", f"{tension:.3g} kPa", tension=tension))
    passive = solver.solve(Wanted("passive", f"{standing:.3g} kPa", tension=standing))
    rest: dict[str, Any] = solver.measurer.measures(passive.state)
    peak = solver.solve(Wanted("peak", f"{whole:.3g} kPa", tension=whole))
    driven: dict[str, Any] = solver.measurer.measures(peak.state)
    return {
        "passive_mN": rest["muscle_force_mN"],
        "active_mN": driven["muscle_force_mN"] - rest["muscle_force_mN"],
        "passive_eq3_mN": rest["eq3_force_mN"],
        "active_eq3_mN": driven["eq3_force_mN"] - rest["eq3_force_mN"],
        "closing_mm": rest["tip_closing_mm"],
        "stroke_mm": driven["tip_closing_mm"] - rest["tip_closing_mm"],
        "passive_stretch_1": rest["fibre_stretch_1"],
    }
