"""Meshes refined for one number: where an element matters for it, elements get smaller, elsewhere larger.

Each round solves, asks every element for its share in the number's error, and has Gmsh mesh the body anew with sizes
that make the shares equal. What that saves beside meshes refined everywhere is part of what is found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.errors import DesignError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.geometry import build_mesh, remeshed
from fem_biobot.mesh.sizes import GROWTH, SizeField
from fem_biobot.solid.adjoint import error_shares, influence
from fem_biobot.solid.from_design import tension_step
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.study.finding import Finding
from fem_biobot.study.outputs import machine_of
from fem_biobot.study.reporter import Reporter
from fem_biobot.study.views import state_view
from fem_biobot.tables import Table
from fem_biobot.view.interactive import Coloured, Moving
from fem_biobot.view.tissue import lines

Array = NDArray[np.float64]

# order of the shares with the size of an element: h^(2 p + 3) for quadratic displacements, p = 2
_ORDER = 7.0
# of a size in one round; more would trust the shares of a coarse mesh too much
_SMALLER, _LARGER = 0.3, 2.0
# of the design's general size: what no element exceeds, so that thin parts keep their shape
_LARGEST = 2.5


@dataclass(frozen=True, eq=False)
class Round:
    """One mesh on the way.

    Attributes
    ----------
    mesh, state
        Of the round.
    unknowns
        Displacement components.
    value
        Of the number [mm].
    estimate
        What an infinitely fine mesh would add to it, estimated [mm].
    shares
        Of the elements in that, (e,) [mm].
    """

    mesh: BodyMesh
    state: SolidState
    unknowns: int
    value: float
    estimate: float
    shares: Array


def goal_of(design: Design) -> str:
    """The number that meshes are refined for: tip closing, or the deflection of a cantilever."""
    return "tip_deflection_mm" if design.kind == "cantilever" else "tip_closing_mm"


def refine(
    design: Design,
    rounds: int,
    *,
    growth: float = 2.0,
    size: float | None = None,
    told: Callable[[Round], None] | None = None,
) -> list[Round]:
    """Solve a design at full drive, or under its whole load, on meshes refined for what its tip does.

    Parameters
    ----------
    design
        With quadratic displacements (`mesh.element` P2) and laws that have a potential.
    rounds
        Meshes after the first.
    growth
        Elements of a round over those of the one before, about.
    size
        Of the first mesh [mm]; by default the design's.
    told
        Given each round as it is done.

    Raises
    ------
    DesignError
        Another element.
    MeshError, ModelError, SolveError
        A mesh that cannot be made, a law without a potential, a state that is not found.
    """
    if design.mesh.element != "P2":
        raise DesignError(f"mesh.element: found {design.mesh.element}, expected P2 for meshes refined for one number")
    mesh, found = build_mesh(design, size), []
    for number in range(rounds + 1):
        found.append(_solved(design, mesh))
        if told is not None:
            told(found[-1])
        if number < rounds:
            mesh = remeshed(design, next_sizes(mesh, found[-1].shares, growth, _LARGEST * design.mesh.size))
    return found


def refined_finding(
    design: Design, rounds: int, size: float, rows: Sequence[Mapping[str, object]], figures: Path, reporter: Reporter
) -> Finding:
    """Meshes refined for what the tip does, beside those refined everywhere, and what that saves.

    Parameters
    ----------
    design, rounds, size
        As of `refine`.
    rows
        Of the meshes refined everywhere: `element`, `unknowns_1` and the number.
    figures
        Folder of the figure.
    reporter
        Told of each round.
    """
    goal = goal_of(design)
    name = goal.rpartition("_")[0].replace("_", " ")
    reporter.stage(f"meshes refined for {name}", rounds + 1)
    found = refine(
        design, rounds, size=size, told=lambda r: reporter.advance(f"{r.unknowns} unknowns, {name} {r.value:.5g} mm")
    )
    best = extrapolated([r.value for r in found], [r.estimate for r in found])
    own = [row for row in rows if row["element"] == "P2"]
    even = [(float(str(row["unknowns_1"])), abs(float(str(row[goal])) - best)) for row in own]
    lines_of = []
    for number, r in enumerate(found):
        error = abs(r.value - best)
        times = saving([n for n, _ in even], [e for _, e in even], r.unknowns, error)
        lines_of.append(
            {
                "round_1": number,
                "unknowns_1": r.unknowns,
                goal: r.value,
                "estimated_error_1": r.estimate / best,
                "error_1": error / abs(best),
                "even_unknowns_over_these_1": None if math.isnan(times) else times,
            }
        )
    last = lines_of[-1]
    times = last["even_unknowns_over_these_1"]
    saved = f"; meshes refined everywhere need about {times:.2g} times as many" if times is not None else ""
    file = figures / "refined.png"
    curves = {
        "refined everywhere": ([n for n, _ in even], [e / abs(best) for _, e in even]),
        f"refined for {name}": ([r.unknowns for r in found], [line["error_1"] for line in lines_of]),
    }
    lines(
        file,
        curves,
        x="unknowns [1]",
        y=f"error of {name} [1]",
        title=f"{design.name}: what refinement costs",
        log="xy",
    )
    header = tuple(lines_of[0])
    return Finding(
        {"goal": goal, "limit_mm": best, "rounds": lines_of},
        [Table(f"Meshes refined for {name}", header, tuple(tuple(line.values()) for line in lines_of))],
        {"refined": lines_of},
        [(file, f"Error of {name} beside its limit {best:.5g} mm, extrapolated from the refined meshes.")],
        remarks=[
            f"refined for {name}: limit {best:.5g} mm; {last['unknowns_1']} unknowns are within "
            f"{100.0 * float(str(last['error_1'])):.2g} % of it{saved}"
        ],
        views=[_view(design, found[-1], name)],
    )


def extrapolated(values: Sequence[float], estimates: Sequence[float]) -> float:
    """Value at no estimated error: on the line through the last three rounds, or two.

    An estimate that sees a fixed share of the error, whichever it is, gives the limit; where the values do not follow
    the estimates, the last value and its estimate stand.
    """
    v, e = np.asarray(values[-3:], dtype=float), np.asarray(estimates[-3:], dtype=float)
    if len(v) < 2 or np.ptp(e) == 0.0:
        return float(v[-1] + e[-1])
    slope, at_zero = np.polyfit(e, v, 1)
    return float(at_zero) if slope < 0.0 else float(v[-1] + e[-1])


def _view(design: Design, found: Round, name: str) -> Moving:
    """The last mesh with its sizes and shares."""
    view = state_view(design, found.state, title=f"The mesh refined for {name}", label=f"{found.unknowns} unknowns")
    machine = machine_of(design, found.state)
    size = machine.nodal((6.0 * math.sqrt(2.0) * found.mesh.volumes) ** (1.0 / 3.0))
    share = machine.nodal(np.log10(np.maximum(np.abs(found.shares), 1e-12 * np.abs(found.shares).max())))
    fields = [
        Coloured("size of the elements [mm]", size, (float(size.min()), float(size.max())), "viridis"),
        Coloured("share in the error, power of ten [mm]", share, (float(share.min()), float(share.max())), "plasma"),
    ]
    return replace(view, fields=[*view.fields, *fields])


def _solved(design: Design, mesh: BodyMesh) -> Round:
    model = SolidModel.from_design(design, mesh)
    measurer = Measurer(design, model)
    tension = design.tension(design.drive.amplitude) if design.muscle is not None else 0.0
    state = solve(model, [tension_step(design, tension)]).last
    bends = design.kind == "cantilever"
    gradient = measurer.deflection_gradient() if bends else measurer.closing_gradient(state)
    value = measurer.measures(state)[goal_of(design)]
    assert value is not None
    shares = error_shares(state, influence(state, gradient))
    return Round(mesh, state, model.n_dofs, value, float(shares.sum()), shares)


def next_sizes(mesh: BodyMesh, shares: Array, growth: float, largest: float) -> SizeField:
    """Sizes at which all elements would have the same share, for `growth` times as many elements.

    A share falls with the seventh power of an element's size; sizes change by a factor of 0.3 to 2 at most, and grow
    from vertex to vertex no faster than everywhere.
    """
    size = (6.0 * math.sqrt(2.0) * mesh.volumes) ** (1.0 / 3.0)
    weight = np.maximum(np.abs(shares), 1e-12 * np.abs(shares).max()) ** (3.0 / _ORDER)
    # elements of one share: the sum of (size / new size)^3 is the number asked for
    level, wanted = weight.sum() / (growth * mesh.n_elements), growth * mesh.n_elements
    ratio = np.ones(mesh.n_elements)
    for _ in range(30):
        ratio = np.clip((level / weight) ** (1.0 / 3.0), _SMALLER, _LARGER)
        level *= (np.sum(ratio**-3.0) / wanted) ** 0.9
    new = np.log(np.minimum(size * ratio, largest))
    total = np.zeros(mesh.n_vertices)
    count = np.zeros(mesh.n_vertices)
    for row in mesh.cells:
        np.add.at(total, row, new)
        np.add.at(count, row, 1.0)
    values = np.exp(total / count)
    a, b = mesh.edges
    step = GROWTH * np.linalg.norm(mesh.points[:, b] - mesh.points[:, a], axis=0)
    for _ in range(20):
        np.minimum.at(values, a, values[b] + step)
        np.minimum.at(values, b, values[a] + step)
    return SizeField(np.asarray(mesh.points), np.asarray(mesh.cells), values)


def saving(unknowns: Sequence[float], errors: Sequence[float], adapted: float, error: float) -> float:
    """Unknowns of evenly refined meshes for an error over those of an adapted mesh that has it [1].

    Between the even meshes, and beyond the finest, errors follow a power of the unknowns; not a number where they do
    not fall.
    """
    x, y = np.log(np.asarray(unknowns, dtype=float)), np.log(np.abs(errors))
    slope = float(np.polyfit(x, y, 1)[0])
    if not slope < 0.0 or not np.isfinite(y).all() or not error > 0.0:
        return math.nan
    return float(np.exp(x[-1] + (math.log(error) - y[-1]) / slope) / adapted)
