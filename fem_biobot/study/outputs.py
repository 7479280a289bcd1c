"""Files of a run: one `.vtu` a state, the series, tables, pictures, plots and the report."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.files import file_error, write_text
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.measures import eq3_stiffness
from fem_biobot.solid.model import SolidState
from fem_biobot.solid.stress import cauchy_stress, element_mean, fibre_stress, first_piola_stress, node_probe, von_mises
from fem_biobot.study.plan import Found
from fem_biobot.study.provenance import appendix
from fem_biobot.view.interactive import Moving
from fem_biobot.view.machine import Machine, Shape, machine_pictures
from fem_biobot.view.pictures import draw_pictures
from fem_biobot.view.plots import force_stroke, tension_path, von_mises_path
from fem_biobot.view.report import Table, write_report
from fem_biobot.vtk import nodal_mean_of_nodes, split_by_region, write_pvd, write_vtu

Array = np.ndarray

# what the report shows of each state
_STATE_COLUMNS = (
    "label", "tension_kPa", "muscle_force_mN", "eq3_force_mN", "tip_closing_mm", "tip_deflection_mm", "sagitta_mm",
    "fibre_stretch_1", "max_von_mises_kPa", "ball_von_mises_kPa", "strain_energy_uJ", "muscle_work_uJ",
    "newton_iterations_1", "factorisations_1", "touching",
)  # fmt: skip


def element_fields(state: SolidState) -> dict[str, Array]:
    """Element means of a state for pictures and VTK; fibre fields are zero where there are no fibres."""
    system = state.model.system
    sigma = cauchy_stress(state.points)

    def mean(values: Array) -> Array:
        return np.nan_to_num(element_mean(system, values), nan=0.0)

    fields = {
        "cauchy_stress_kPa": mean(sigma),
        "first_piola_stress_kPa": mean(first_piola_stress(state.points)),
        "von_mises_kPa": mean(von_mises(sigma)),
        "volume_ratio_1": mean(np.linalg.det(np.moveaxis(state.F, (0, 1), (-2, -1)))),
    }
    if system.contractions:
        fibres = sum(c.a0[:, :, 0] for c in system.contractions)
        fields |= {
            "fibre_stretch_1": mean(state.stretch),
            "fibre_stress_kPa": mean(fibre_stress(state, sigma)),
            "fibre_direction_1": np.asarray(fibres),
        }
    return fields


def nodal_fields(state: SolidState) -> dict[str, Array]:
    """What each element says at its own nodes, (b, e), for pictures: von Mises stress and the fibre fields."""
    system = state.model.system
    where = node_probe(system)
    shape = (len(system.space.nodes), -1)

    def by_element(values: Array) -> Array:
        return values.reshape(-1, len(system.space.nodes)).T.reshape(shape)

    fields = {"von_mises_kPa": by_element(von_mises(where.cauchy_stress(state)))}
    if system.contractions:
        stretch, stress = where.fibre_fields(state)
        fields |= {"fibre_stretch_1": by_element(stretch), "fibre_stress_kPa": by_element(stress)}
    return fields


def write_state(path: Path, state: SolidState) -> None:
    """One state as quadratic cells; nodes are doubled between regions, so that stresses jump where materials do.

    Cell fields are means over the elements; point fields of stress are means of what the elements say at the node.
    """
    space = state.model.system.space
    mesh = state.model.mesh
    node_map, cells = split_by_region(space.nodes, mesh.region_of(), n_points=space.n_nodes)
    at_nodes = {
        f"nodal_{name}": nodal_mean_of_nodes(cells, values, weights=mesh.volumes, n_points=node_map.size)
        for name, values in nodal_fields(state).items()
    }
    write_vtu(
        path,
        space.points[:, node_map],
        cells,
        point_data={"displacement_mm": state.u[:, node_map], **at_nodes},
        cell_data={name: _packed(values) for name, values in element_fields(state).items()},
        region=mesh.region_of(),
    )


def _packed(values: Array) -> Array:
    """Symmetric tensors in VTK's six components; everything else as it is."""
    if values.ndim == 3 and np.allclose(
        values, values.swapaxes(0, 1), rtol=0.0, atol=1e-12 * max(1.0, np.abs(values).max())
    ):
        return np.stack([values[0, 0], values[1, 1], values[2, 2], values[0, 1], values[1, 2], values[0, 2]])
    return values


def write_series(folder: Path, files: Sequence[str]) -> None:
    """`solid.pvd` over the states written so far; the time is the number of the state."""
    write_pvd(folder / "solid.pvd", [(float(k), name) for k, name in enumerate(files)])


def write_table(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Rows of equal keys as CSV, empty cells for None."""
    text = io.StringIO()
    header = list(dict.fromkeys(key for row in rows for key in row))
    writer = csv.DictWriter(text, header, lineterminator="\n")
    writer.writeheader()
    writer.writerows([{k: "" if v is None else v for k, v in row.items()} for row in rows])
    path.parent.mkdir(exist_ok=True)
    write_text(path, text.getvalue())


def draw(folder: Path, design: Design, shown: Sequence[Found]) -> tuple[list[Path], str]:
    """Pictures of the states shown; returns their files and a note if a lesser renderer drew them."""
    machine = machine_of(design, shown[0].state)
    shapes = [shape_of(design, found.state, found.wanted.key, found.wanted.label) for found in shown]
    drawn = draw_pictures(machine_pictures(machine, shapes), figures_folder(folder))
    return list(drawn.files), drawn.note


def machine_of(design: Design, state: SolidState) -> Machine:
    """The undeformed body of a state, to draw."""
    space = state.model.system.space
    focus = design.landmarks().get("corner_short")
    regions = dict(state.model.mesh.regions)
    return Machine(space.points, space.nodes, regions, design.name, design.kind == "bot", focus)


def shape_of(design: Design, state: SolidState, key: str, label: str, *, stands: bool = True) -> Shape:
    """A state as it is drawn: a machine with feet stands on them, unless it shall be where it was solved."""
    points, u, fields = state.model.system.space.points, state.u, nodal_fields(state)
    if design.kind == "bot" and stands:
        u = standing(points + u) - points
    return Shape(key, label, u, fields["von_mises_kPa"], fields.get("fibre_stretch_1"), fields.get("fibre_stress_kPa"))


def standing(x: Array) -> Array:
    """Positions (3, n) turned about y and lifted so that the lowest points of both halves touch the ground z = 0.

    For pictures: the solver's own supports hold the body in the air. The middle of the body stays at x = 0.
    """
    x = x.copy()
    for _ in range(20):
        middle = 0.5 * (x[0].min() + x[0].max())
        left, right = x[0] < middle, x[0] >= middle
        a, b = (x[:, half][:, np.argmin(x[2, half])] for half in (left, right))
        angle = np.arctan2(b[2] - a[2], b[0] - a[0])
        if abs(angle) < 1e-9:
            break
        c, s = np.cos(angle), np.sin(angle)
        x[0], x[2] = c * x[0] + s * x[2], -s * x[0] + c * x[2]
    x[0] -= 0.5 * (x[0].min() + x[0].max())
    x[2] -= x[2].min()
    return x


def tables_folder(folder: Path) -> Path:
    """The folder of the tables, made if it is not there."""
    tables = folder / "tables"
    try:
        tables.mkdir(exist_ok=True)
    except OSError as error:
        raise file_error(error, tables) from None
    return tables


def figures_folder(folder: Path) -> Path:
    """The folder of the figures, made if it is not there."""
    figures = folder / "figures"
    try:
        figures.mkdir(exist_ok=True)
    except OSError as error:
        raise file_error(error, figures) from None
    return figures


def plot(folder: Path, design: Design, states: Sequence[Mapping[str, Any]]) -> list[tuple[Path, str]]:
    """Graphs of a machine with muscle: force against stroke, and what the tension does; with captions."""
    figures = figures_folder(folder)
    moulded = sorted((s for s in states if s["reference"] == "as_moulded"), key=lambda s: s["tension_kPa"] or 0.0)
    if design.muscle is None or len(moulded) < 2:
        return []

    def column(name: str) -> list[float]:
        return [s[name] for s in moulded]

    out: list[tuple[Path, str]] = []
    marks = {s["key"]: s["tension_kPa"] for s in moulded if s["key"] in ("passive", "peak")}
    if design.kind == "bot":
        curves = {"as moulded": (column("tip_closing_mm"), column("muscle_force_mN"))}
        other = [s for s in states if s["reference"] == "remodelled"]
        if other:
            curves["remodelled"] = ([s["tip_closing_mm"] for s in other], [s["muscle_force_mN"] for s in other])
        heights = sum(height for _, height in (design.pillars[0], design.pillars[-1]))
        skeleton = design.skeleton
        assert skeleton is not None
        linear = design.moment_arm * design.span * heights / (2.0 * skeleton.material.young * design.second_moment)
        force_stroke(
            figures / "force_stroke.png", curves, linear=linear, title=f"{design.name}: muscle force and tip closing"
        )
        out.append(
            (
                figures / "force_stroke.png",
                f"Muscle force against tip closing; Eq. 3 stiffness {eq3_stiffness(design):.3g} mN/mm.",
            )
        )
    tension_path(
        figures / "tension_path.png", column("tension_kPa"), fibre_stretch=column("fibre_stretch_1"),
        muscle_force=column("muscle_force_mN"), tip_closing=column("tip_closing_mm"),
        sagitta=column("sagitta_mm") if design.kind == "bot" else None, marks=marks,
    )  # fmt: skip
    out.append(
        (figures / "tension_path.png", "Fibre stretch, force and shape along the tension path, tissue as moulded.")
    )
    series = {"highest in the mesh": column("max_von_mises_kPa")}
    if design.kind == "bot":
        series["mean in 0.3 mm about the corner"] = column("ball_von_mises_kPa")
    von_mises_path(figures / "von_mises.png", column("tension_kPa"), series, marks=marks)
    out.append(
        (figures / "von_mises.png", "Von Mises stress; the highest value at a sharp corner grows with refinement.")
    )
    return out


def write_run_report(
    folder: Path,
    summary: Mapping[str, Any],
    figures: Sequence[tuple[Path, str]],
    design: Design,
    more: Sequence[Table] = (),
    views: Sequence[Moving] = (),
) -> None:
    """`report.html` of a run, with `more` tables after those of the states, and interactive views."""
    solid = summary["solid"]
    tables: list[Table] = []
    if solid.get("comparison"):
        tables.append(_table("Beside the paper", solid["comparison"]))
    if solid.get("stroke"):
        rows = [{"tissue": name, **values} for name, values in solid["stroke"].items()]
        tables.append(_table("Passive state and stroke", rows))
    if solid.get("error_estimate"):
        tables.append(_table("Error of the mesh, from two sizes", solid["error_estimate"]))
    kept = [name for name in _STATE_COLUMNS if any(s.get(name) not in (None, "") for s in solid["states"])]
    tables.append(_table("States", [{name: s.get(name) for name in kept} for s in solid["states"]]))
    tables += more
    write_report(
        folder / "report.html", summary, figures, tables, summary["notes"], views=views, appendix=appendix(design),
        title=f"{design.name}: stress and stroke",
    )  # fmt: skip


def _table(title: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    header = list(dict.fromkeys(key for row in rows for key in row))
    return title, header, [[row.get(name) for name in header] for row in rows]


def mesh_summary(mesh: BodyMesh, n_unknowns: int, element: str) -> dict[str, Any]:
    """Counts, volumes and quality of a mesh, for the summary."""
    quality = mesh.quality()
    return {
        "source": {k: v for k, v in mesh.source.items() if isinstance(v, str | int | float)},
        "vertices_1": mesh.n_vertices,
        "elements_1": mesh.n_elements,
        "unknowns_1": n_unknowns,
        "element": element,
        **{f"volume_{name}_mm3": volume for name, volume in mesh.region_volumes().items()},
        "mean_edge_mm": mesh.h_mean,
        "worst_radius_ratio_1": quality.minimum,
        "mean_radius_ratio_1": quality.mean,
    }
