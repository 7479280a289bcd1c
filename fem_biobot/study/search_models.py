"""What a search asks of one design: passive state and full drive, by the rods or by the solid, and how they look."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import BiobotError, DesignError, DiskError, SolveError
from fem_biobot.study.reporter import Silent
from fem_biobot.view.interactive import Moving

if TYPE_CHECKING:
    from fem_biobot.rod.model import RodState
    from fem_biobot.study.plan import Found, Solver

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


def seen(design: Design, model: Model) -> Moving:
    """A design's passive state and full drive, to turn; solved once more.

    Raises
    ------
    BiobotError
        A design without these states.
    """
    return _VIEWS[model](design)


Numbers = Mapping[str, float]
_NOTHING = {"tip_closing_mm": 0.0, "sagitta_mm": 0.0, "muscle_force_mN": 0.0}


def _tensions(design: Design) -> list[float]:
    return [design.tension(0.0), design.tension(design.drive.amplitude)]


def _rod_states(design: Design) -> dict[float, tuple[Numbers, RodState]]:
    from fem_biobot.link.rod_side import RodSide
    from fem_biobot.rod.reduce import reduce

    wanted = sorted({T for T in _tensions(design) if T > 0.0})
    observed, states = RodSide(design, reduce(design)).states(wanted, Silent())
    if len(observed) < len(wanted):
        raise SolveError(f"rods: no equilibrium at {wanted[len(observed)]:.4g} kPa")
    return {T: (o.numbers, s) for T, o, s in zip(wanted, observed, states, strict=True)}


def _rods(design: Design) -> tuple[Numbers, Numbers]:
    found = {T: numbers for T, (numbers, _) in _rod_states(design).items()}
    passive, full = (found.get(T, _NOTHING) for T in _tensions(design))
    return passive, full


def _solid_states(design: Design) -> tuple[Solver, list[Found]]:
    from fem_biobot.mesh.committed import mesh_for
    from fem_biobot.study.plan import Solver, Wanted

    mesh, _ = mesh_for(design)
    solver = Solver(design, mesh, Silent())
    own = str(design.value("muscle.reference"))
    passive, full = _tensions(design)
    if own == "remodelled":
        # tissue remodels from its moulded passive state
        solver.solve(Wanted("moulded", "moulded", tension=passive))
    named = (("passive", f"passive, {passive:.3g} kPa", passive), ("peak", f"full drive, {full:.3g} kPa", full))
    return solver, [solver.solve(Wanted(key, label, own, tension)) for key, label, tension in named]


def _solid(design: Design) -> tuple[Numbers, Numbers]:
    solver, found = _solid_states(design)
    states = []
    for each in found:
        measured = solver.measurer.measures(each.state)
        states.append({name: float(measured[name] or 0.0) for name in _NOTHING})
    return states[0], states[1]


def _rods_seen(design: Design) -> Moving:
    from fem_biobot.study.outputs import standing
    from fem_biobot.study.views import rod_view

    found = _rod_states(design)
    states = [state for _, state in found.values()]
    labels = ["at rest", *(f"{T:.3g} kPa" for T in found)]
    view = rod_view([states[0].model.drawn(), *states], title=f"{design.name}: rods", labels=labels)
    return replace(view, points=np.array([standing(x) for x in view.points]))


def _solid_seen(design: Design) -> Moving:
    from fem_biobot.study.outputs import machine_of, shape_of
    from fem_biobot.view.moving import machine_view

    _, found = _solid_states(design)
    shapes = [shape_of(design, f.state, f.wanted.key, f.wanted.label) for f in found]
    machine = machine_of(design, found[0].state)
    return machine_view(machine, shapes, title=f"{design.name}: solid", from_rest=False)


_STATES: Mapping[Model, Callable[[Design], tuple[Numbers, Numbers]]] = {Model.rod: _rods, Model.solid: _solid}
_VIEWS: Mapping[Model, Callable[[Design], Moving]] = {Model.rod: _rods_seen, Model.solid: _solid_seen}
