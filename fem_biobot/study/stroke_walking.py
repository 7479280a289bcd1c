"""The rods' walk with the stroke of the solid beside the walk with their own: one folder with both and what parts them.

Each walk is a result of its own below the folder, made and resumed as `walk_design` does; here they are compared.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.config import digest
from fem_biobot.design import Design
from fem_biobot.design_checks import refuse_unbonded
from fem_biobot.errors import DesignError
from fem_biobot.link.expected import expect
from fem_biobot.link.stroke import MEASURES, StrokeLaw, stroke_law
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.mesh.files import read_mesh, shape_notes
from fem_biobot.rod.anatomy import anatomy
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.compiling import compile_kernels
from fem_biobot.study.folder import ResultFolder, mesh_identity, write_design
from fem_biobot.study.outputs import figures_folder, tables_folder, write_table
from fem_biobot.study.provenance import appendix
from fem_biobot.study.reporter import Reporter, Silent
from fem_biobot.study.versions import versions
from fem_biobot.study.walk_files import table
from fem_biobot.study.walking import WalkPlan, walk_design
from fem_biobot.view.crosscheck import both_over
from fem_biobot.view.report import write_report
from fem_biobot.view.together import Way, phase_portrait, together

OWN, TAKEN = "own_stroke", "stroke_of_solid"
_WORDS = {OWN: "own stroke", TAKEN: "stroke of the solid"}
_PANELS = {
    "tip_closing_mm": "tip closing [mm]",
    "pillar_rotation_deg": "rotation of a pillar [deg]",
    "muscle_force_mN": "muscle force [mN]",
}
_SHOWN = ("stroke_from", "frequency_Hz", "step_mm", "step_spread_mm", "speed_mm_per_s", "stroke_mm",
          "passive_closing_mm", "slip_fraction_1", "work_pillar_uJ", "efficiency_1")  # fmt: skip


def walk_with_stroke(
    design: Design,
    out: Path,
    plan: WalkPlan,
    *,
    mesh_file: Path | None = None,
    names: Mapping[str, str] | None = None,
    size: float | None = None,
    force: bool = False,
    resume: bool = False,
    reporter: Reporter | None = None,
) -> dict[str, Any]:
    """Walk a design's rods with their own stroke and with that of the solid, and write the result's folder.

    Parameters
    ----------
    design, plan
        What walks, and how; with an amplitude that is a number.
    out
        Folder of the result.
    mesh_file, names, size, force, resume
        As in `study.run.run`.

    Returns
    -------
    dict
        The summary: both walks at each frequency, and the law of the stroke.

    Raises
    ------
    BiobotError
        Wrong input before anything is written; a model that finds no state, a walk that fails.
    """
    reporter, began = reporter or Silent(), time.perf_counter()
    design = design if size is None else design.with_values({"mesh.size": size})
    if plan.amplitude is None:
        raise DesignError("--amplitude: found paper together with the stroke of the solid, expected a number")
    design = design.with_values({"drive.amplitude": plan.amplitude})
    refuse_unbonded(design, "give its rods its stroke")
    expect(design)  # refuses other machines
    identity = {"kind": "walk", "design_digest": digest(design), "mesh": mesh_identity(mesh_file)}
    folder = ResultFolder(out, {**identity, "walk": f"{plan.text}, with the stroke of the solid"})
    done = folder.done(reporter, force=force, resume=resume)
    if done is not None:
        return done
    mesh, notes = mesh_for(design) if mesh_file is None else (read_mesh(mesh_file, names, design=design), [])
    notes += shape_notes(design, mesh)
    compile_kernels(reporter, design.mesh.element)
    folder.open()
    write_design(folder.path, design)
    law = stroke_law(design, mesh, reporter)
    walks: list[dict[str, Any]] = []
    for key, each in ((OWN, design), (TAKEN, law.design)):
        found = walk_design(each, folder.path / key, plan, force=force, pictures=False, reporter=reporter)
        walks += [{"stroke_from": _WORDS[key], **walk} for walk in found["walks"]]
        notes += [note for note in found["notes"] if note not in notes]
    notes.append(
        f"with tensions of {law.rods_tension[0]:.3g} to {law.rods_tension[-1]:.3g} kPa instead of {law.tension[0]:.3g} "
        f"to {law.tension[-1]:.3g} kPa the rods close as the solid does, in between within {law.departure:.1%} of the "
        "stroke"
    )
    summary = _summary(folder, design, mesh, law, walks, notes, time.perf_counter() - began)
    _write(folder.path, design, plan, law, walks, summary)
    folder.close(summary)
    return summary


def _summary(
    folder: ResultFolder,
    design: Design,
    mesh: BodyMesh,
    law: StrokeLaw,
    walks: list[dict[str, Any]],
    notes: list[str],
    seconds: float,
) -> dict[str, Any]:
    return {
        "complete": True,
        "job": folder.job,
        "design_digest": folder.job["design_digest"],
        "design": design.name,
        "versions": versions(),
        "timings_s": {"total": round(seconds, 3)},
        "mesh": {"elements_1": mesh.n_elements, "unknowns_1": mesh.n_unknowns},
        "solid": {"states": []},
        "walks": walks,
        "stroke": {"rows": law.rows(), "departure_1": law.departure},
        "crosscheck": None,
        "notes": notes,
    }


def _write(
    folder: Path,
    design: Design,
    plan: WalkPlan,
    law: StrokeLaw,
    walks: Sequence[Mapping[str, Any]],
    summary: Mapping[str, Any],
) -> None:
    """Tables, pictures and the page."""
    plain = [{k: v for k, v in walk.items() if not isinstance(v, dict | list)} for walk in walks]
    write_table(tables_folder(folder) / "walks.csv", plain)
    write_table(tables_folder(folder) / "stroke.csv", law.rows())
    figures = figures_folder(folder)
    models = {"solid": law.solid, "rods": law.rods, "rods with its tensions": law.adapted}
    drawn = [
        (figures / "stroke.png", "Solid, its rods, and rods with tensions that make them close as the solid does.")
    ]
    panels = {_PANELS[name]: {model: found[name] for model, found in models.items()} for name in MEASURES}
    both_over(drawn[0][0], law.drive, panels, x="drive [1]", title=f"{design.name}: stroke of the solid")
    for frequency in plan.frequencies:
        name = f"{frequency:g}Hz".replace(".", "p")
        ways = {
            _WORDS[key]: _way(folder / key / "tables" / f"walk_{name}_{design.ground.immersion}.csv", design)
            for key in (OWN, TAKEN)
        }
        drawn.append((figures / f"together_{name}.png", f"Both walks under one drive at {frequency:g} Hz."))
        together(drawn[-1][0], ways, title=f"Rods with their own stroke and the solid's at {frequency:g} Hz")
        drawn.append((figures / f"phase_{name}.png", f"Phase portrait of both at {frequency:g} Hz, second half."))
        phase_portrait(drawn[-1][0], ways, since=0.5 * plan.time(frequency), title=f"At {frequency:g} Hz")
    rows = [{name: walk.get(name) for name in _SHOWN} for walk in walks]
    tables = [table("Walks", rows), table("Stroke by drive, floating and at rest", law.rows())]
    title = f"{design.name}: walking with the stroke of the solid"
    write_report(
        folder / "report.html", summary, drawn, tables, summary["notes"], appendix=appendix(design), title=title
    )


def _way(path: Path, design: Design) -> Way:
    """A walk as its table has it."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))

    def column(name: str) -> np.ndarray:
        return np.array([float(row[name]) for row in rows])

    x = column("position_x_mm")
    feet = {
        name: np.stack([column(f"{name}_normal_mN"), column(f"{name}_forward_mN")], axis=1)
        for name in anatomy(reduce(design)).feet
    }
    return Way(column("time_s"), x - x[0], column("tip_closing_mm"), feet)
