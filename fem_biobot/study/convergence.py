"""Mesh to stress: one state of a design on several meshes and elements, and what each of its numbers does."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fem_biobot.design import Design
from fem_biobot.design_tissue import at_rest
from fem_biobot.errors import DesignError, SolveError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.mesh.geometry import GmshMissing, build_mesh
from fem_biobot.mesh.layout import Point, layout
from fem_biobot.mesh.sizes import CORNER_SHARE
from fem_biobot.muscle.blocks import in_junction
from fem_biobot.solid.from_design import tension_step
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.stress import ball, probe, von_mises
from fem_biobot.study.adaptive import refined_finding
from fem_biobot.study.convergence_told import (
    QUANTITIES,
    draw,
    energy_told,
    limit_rows,
    limits_table,
    told,
    values_table,
)
from fem_biobot.study.finding import Finding
from fem_biobot.study.reporter import Reporter
from fem_biobot.study.richardson import Limit, limit
from fem_biobot.study.views import state_view

ELEMENTS = ("P1", "P2", "P2-P1")
# radius of the fillets that stand in for sharp corners, over the beam's thickness
_FILLET = 0.3
# sizes of a study by default, and how much coarser each is than the next
_SIZES, _COARSER = 5, math.sqrt(1.6)
# of all that depends on the whole solution, once elements at a re-entrant right angle are small: twice the exponent of
# its displacements (Williams 1952)
CORNER_ORDER = 2 * 0.5445
# places along a fillet's arc, and points across a ball about each
_ALONG, _ACROSS = 9, 10


@dataclass(frozen=True)
class ConvergencePlan:
    """What to solve.

    Attributes
    ----------
    sizes
        Of the meshes, falling [mm]; None: five, the design's own and four times 1.26 (the root of 1.6) as coarse.
    elements
        Out of P1, P2 and P2-P1.
    wanted
        Relative error asked for [1].
    fillet
        Radius of fillets in which the peak stress is looked for [mm], 0 for none; None: the design's own, or for a bot
        with sharp corners 0.3 of the beam's thickness.
    rounds
        Meshes refined for what the tip does, besides those that are refined everywhere.
    """

    sizes: tuple[float, ...] | None = None
    elements: tuple[str, ...] = ("P2",)
    wanted: float = 0.01
    fillet: float | None = None
    rounds: int = 0

    def __post_init__(self) -> None:
        for element in self.elements:
            if element not in ELEMENTS:
                raise DesignError(f"--element: found {element}, expected one of: {', '.join(ELEMENTS)}")
        if not self.elements:
            raise DesignError("--element: found none, expected at least one")
        if self.sizes is not None and (len(self.sizes) < 3 or any(not s > 0.0 for s in self.sizes)):
            raise DesignError(f"--sizes: found {len(self.sizes)}, expected three sizes above 0 mm or more")
        if not 0.0 < self.wanted < 1.0:
            raise DesignError(f"--error: found {self.wanted:g}, expected above 0 and below 1")
        if self.fillet is not None and not self.fillet >= 0.0:
            raise DesignError(f"--fillet: found {self.fillet:g} mm, expected 0 mm or more")
        if self.rounds < 0 or self.rounds == 1:
            raise DesignError(f"--refine: found {self.rounds}, expected 2 rounds or more, or 0 for none")
        if self.rounds and "P2" not in self.elements:
            raise DesignError(f"--refine: found the elements {', '.join(self.elements)}, expected P2 among them")

    def falling(self, design: Design) -> tuple[float, ...]:
        """Sizes from the coarsest."""
        own = design.mesh.size
        return tuple(sorted(self.sizes or (own * _COARSER**k for k in range(_SIZES)), reverse=True))

    def rounded(self, design: Design) -> Design | None:
        """The design with the fillets in which the peak is looked for; None for none."""
        if design.kind != "bot" or design.skeleton is None or self.fillet == 0.0:
            return None
        radius = self.fillet or design.skeleton.fillet_radius or _FILLET * design.skeleton.beam_thickness
        return design.with_values({"skeleton.fillet_radius": radius})


def convergence_finding(design: Design, plan: ConvergencePlan, figures: Path, reporter: Reporter) -> Finding:
    """One state of a design, at full drive or under its whole load, on every mesh and with every element.

    Raises
    ------
    MeshError, SolveError
        A mesh that cannot be made; a state that is not found on any of three meshes.
    """
    still = at_rest(design.muscle)
    notes = [still] if still else []
    sizes = plan.falling(design)
    rows: list[dict[str, object]] = []
    finest: tuple[SolidState, str] | None = None
    reporter.stage("meshes and elements", len(sizes) * len(plan.elements))
    rounded = plan.rounded(design)
    for size in sizes:
        mesh, more = mesh_for(design.with_values({"mesh.size": size}))
        notes += [note for note in more if note not in notes]
        for element in plan.elements:
            try:
                row, state = measured_row(design, mesh, element, size)
                if rounded is not None:
                    try:
                        row["fillet_von_mises_kPa"] = fillet_peak(rounded, size, sizes[0], element)
                    except GmshMissing as missing:
                        notes.append(f"the peak in a fillet: left out: {missing}")
                        rounded = None
                rows.append(row)
                finest = state, f"{element} at {size:g} mm"
            except SolveError as failure:
                notes.append(f"{element} at {size:g} mm: left out: {failure}")
            reporter.advance(f"{element} at {size:g} mm")
    # edges at which gel and tissue turn inwards, or meet, are in every bot, with fillets, too; in a graded mesh the
    # elements at these have the ratio of the sizes asked for, of which the mean size knows little
    theory, graded = CORNER_ORDER if design.kind == "bot" else math.inf, layout(design).grading != "even"
    limits = _limits(rows, plan, theory, graded)
    if not limits:
        raise SolveError("convergence: found no element with a state on three meshes, expected one")
    refined = refined_finding(design, plan.rounds, sizes[0], rows, figures, reporter) if plan.rounds else None
    if rounded is not None:
        radius = rounded.value("skeleton.fillet_radius")
        notes.append(f"the peak in a fillet is that of the design with fillets of {radius:.3g} mm at its corners")
    remarks = [f"{element}, {QUANTITIES[name]}: {told(name, found)}" for (element, name), found in limits.items()]
    remarks += [line for element in plan.elements for line in energy_told(rows, limits, element)]
    numbers = limit_rows(limits)
    return Finding(
        {
            "wanted_error_1": plan.wanted,
            "refined": dict(refined.numbers) if refined else None,
            "rows": rows,
            "limits": numbers,
        },
        [values_table(rows), limits_table(limits), *(refined.tables if refined else ())],
        {"convergence": rows, "limits": numbers, **(refined.series if refined else {})},
        [*draw(design, rows, limits, figures), *(refined.figures if refined else ())],
        notes,
        [*remarks, *(refined.remarks if refined else ())],
        list(refined.views)
        if refined
        else []
        if finest is None
        else [state_view(design, finest[0], title="The finest mesh", label=finest[1])],
    )


def fillet_peak(rounded: Design, size: float, coarsest: float, element: str) -> float:
    """Peak of the von Mises stress along the fillets of a design at full drive, mid-width [kPa].

    The highest of means over balls of a quarter of the radius along the arcs: elements have straight sides, and at the
    kinks between them a single point's stress would depend on the mesh for ever. The mesh has two elements along an
    arc at the coarsest size, and more in proportion at finer ones.
    """
    radius = float(rounded.value("skeleton.fillet_radius"))
    mesh = build_mesh(rounded, size, corner_share=min(CORNER_SHARE, 0.25 * math.pi * radius / coarsest))
    _, state = measured_row(rounded, mesh, element, size)
    return max(
        float(np.mean(von_mises(probe(state.model.system, ball(at, 0.25 * radius, _ACROSS)).cauchy_stress(state))))
        for line in layout(rounded).corner_lines
        for at in along_arc(line, radius)
    )


def along_arc(line: tuple[Point, Point, float], radius: float) -> list[np.ndarray]:
    """Positions from the beam's end of a fillet to the pillar's, mid-width, (3,) each [mm]."""
    (x, y0, z), (_, y1, _), sign = line
    angles = np.linspace(0.0, 0.5 * math.pi, _ALONG)
    return [
        np.array([x + sign * radius * (1.0 - math.sin(a)), 0.5 * (y0 + y1), z - radius * (1.0 - math.cos(a))])
        for a in angles
    ]


def energy_parts(design: Design, state: SolidState) -> dict[str, float]:
    """Passive strain energy of a bot's skeleton, of its junctions or strands, and of what holds these [uJ].

    The rings are squeezed onto the edges of their pillars, about which their fibres turn: where a mesh is too coarse
    for that, their energy goes up and down with it, and that of the whole machine with theirs.
    """
    mesh, energy = state.model.mesh, state.element_energy
    muscle = mesh.regions["muscle"]
    inside = in_junction(design, mesh.points[:, mesh.cells[:, muscle]].mean(axis=1))
    return {
        "skeleton_energy_uJ": float(energy[mesh.regions["skeleton"]].sum()),
        "junction_energy_uJ": float(energy[muscle[inside]].sum()),
        "ring_energy_uJ": float(energy[muscle[~inside]].sum()),
    }


def measured_row(design: Design, mesh: BodyMesh, element: str, size: float) -> tuple[dict[str, object], SolidState]:
    """Measures of a design's state at full drive, or under its whole load, on one mesh with one element; the state."""
    whole = SolidModel.from_design(design, mesh)
    model = SolidModel(mesh, whole.materials, whole.active, whole.supports, whole.loads, element=element)
    tension = design.tension(design.drive.amplitude) if design.muscle is not None else 0.0
    state = solve(model, [tension_step(design, tension)]).last
    found = Measurer(design, model).measures(state) | (energy_parts(design, state) if design.kind == "bot" else {})
    mean = float((mesh.volumes.sum() / mesh.n_elements) ** (1.0 / 3.0))
    row: dict[str, object] = {
        "element": element,
        "asked_size_mm": size,
        "size_mm": mean,
        "elements_1": mesh.n_elements,
        "unknowns_1": model.n_dofs,
    }
    return row | {name: found[name] for name in QUANTITIES if found.get(name) is not None}, state


def _limits(
    rows: Sequence[Mapping[str, object]], plan: ConvergencePlan, theory: float, graded: bool
) -> dict[tuple[str, str], Limit]:
    """The limit of every quantity that has values on three meshes, by element and name."""
    limits = {}
    for element in plan.elements:
        own = sorted((row for row in rows if row["element"] == element), key=lambda row: -float(str(row["size_mm"])))
        for name in QUANTITIES:
            having = [row for row in own if name in row]
            # two sizes asked for may give one mesh
            kept = [r for i, r in enumerate(having) if not i or r["size_mm"] != having[i - 1]["size_mm"]]
            if len(kept) >= 3:
                sizes, values = ([float(str(row[key])) for row in kept] for key in ("size_mm", name))
                asked = [float(str(row["asked_size_mm"])) for row in (kept[0], kept[-1])]
                limits[element, name] = limit(
                    sizes, values, plan.wanted, theory, asked[0] / asked[1] if graded else None
                )
    return limits
