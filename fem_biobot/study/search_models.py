"""What a search asks of one design: passive state and full drive, by the rods' statics or by the solid."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum

from fem_biobot.design import Design
from fem_biobot.errors import BiobotError, DesignError, DiskError, SolveError
from fem_biobot.study.reporter import Silent

# what may be aimed at: unit, and what it is
QUANTITIES: Mapping[str, tuple[str, str]] = {
    "stroke": ("mm", "tip closing from the passive state to full drive"),
    "closing": ("mm", "tip closing at full drive"),
    "sagitta": ("mm", "rise of the beam over its chord at full drive"),
    "force": ("mN", "force through the muscle at full drive"),
    "passive_force": ("mN", "force through the muscle in the passive state"),
    "stroke_force": ("mN", "force through the muscle from the passive state to full drive"),
}


class Model(StrEnum):
    """Which model answers.

    rod
        Statics of the rods that the design reduces to, afloat and without weight; a part of a second each.
    solid
        Finite elements on the design's own mesh; a changed shape is meshed anew, so that numbers scatter by what the
        mesh does to them.
    """

    rod = "rod"
    solid = "solid"


@dataclass(frozen=True)
class Answer:
    """Numbers of one design by quantity, or why there are none."""

    numbers: Mapping[str, float]
    reason: str = ""


def answer(design: Design, model: Model) -> Answer:
    """Passive state and full drive of a design; a design that fails is an answer too.

    Raises
    ------
    DiskError
        A full disk says nothing about the design.
    """
    try:
        passive, full = _STATES[model](design)
    except DiskError:
        raise
    except BiobotError as error:
        return Answer({}, str(error))
    found = {
        "stroke": full["tip_closing_mm"] - passive["tip_closing_mm"],
        "closing": full["tip_closing_mm"],
        "sagitta": full["sagitta_mm"],
        "force": full["muscle_force_mN"],
        "passive_force": passive["muscle_force_mN"],
        "stroke_force": full["muscle_force_mN"] - passive["muscle_force_mN"],
    }
    return Answer(found)


def refuse_without_stroke(design: Design) -> None:
    """Refuse a machine that has no stroke to aim at."""
    if design.kind != "bot":
        raise DesignError(f"kind: found {design.kind}, expected a bot, a skeleton that its muscle bends, to search")
    if not design.tension(design.drive.amplitude) > 0.0:
        raise DesignError("muscle: found no tension at full drive, expected one to search with")


Numbers = Mapping[str, float]
_NOTHING = {"tip_closing_mm": 0.0, "sagitta_mm": 0.0, "muscle_force_mN": 0.0}


def _rods(design: Design) -> tuple[Numbers, Numbers]:
    from fem_biobot.link.rod_side import RodSide
    from fem_biobot.rod.reduce import reduce

    tensions = [design.tension(0.0), design.tension(design.drive.amplitude)]
    wanted = sorted({T for T in tensions if T > 0.0})
    observed, _ = RodSide(design, reduce(design)).states(wanted, Silent())
    if len(observed) < len(wanted):
        raise SolveError(f"rods: no equilibrium at {wanted[len(observed)]:.4g} kPa")
    found = {T: state.numbers for T, state in zip(wanted, observed, strict=True)}
    passive, full = (found.get(T, _NOTHING) for T in tensions)
    return passive, full


def _solid(design: Design) -> tuple[Numbers, Numbers]:
    from fem_biobot.mesh.committed import mesh_for
    from fem_biobot.study.plan import Solver, Wanted

    mesh, _ = mesh_for(design)
    solver = Solver(design, mesh, Silent())
    own = str(design.value("muscle.reference"))
    passive, full = design.tension(0.0), design.tension(design.drive.amplitude)
    states = []
    if own == "remodelled":
        # tissue remodels from its moulded passive state
        solver.solve(Wanted("moulded", "moulded", tension=passive))
    for key, tension in (("passive", passive), ("peak", full)):
        state = solver.solve(Wanted(key, key, own, tension)).state
        measured = solver.measurer.measures(state)
        states.append({name: float(measured[name] or 0.0) for name in _NOTHING})
    return states[0], states[1]


_STATES: Mapping[Model, Callable[[Design], tuple[Numbers, Numbers]]] = {Model.rod: _rods, Model.solid: _solid}
