"""Files of walks of the solid: tables, series for ParaView, graphs, and those that show solid and rods together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.files import file_error
from fem_biobot.friction.kernels import LIFTED, SLIP
from fem_biobot.rod.gait import Walk
from fem_biobot.solid.gait import SolidWalk
from fem_biobot.study import walk_files
from fem_biobot.study.contact_outputs import contact_numbers, write_footprint
from fem_biobot.study.outputs import figures_folder, tables_folder, write_state, write_table
from fem_biobot.study.provenance import appendix
from fem_biobot.study.together_files import draw_together
from fem_biobot.view.gait import Foot, energy_book, foot_forces, position
from fem_biobot.view.report import write_report
from fem_biobot.vtk import write_pvd, write_vtp

Array = np.ndarray

MOST_STATES = 60  # of a series
# entries of the book that parts make which slide on each other
_RINGS = ("rubbing", "pressing")
_WORDS = {LIFTED: "lifted", SLIP: "slip"}
_SHOWN = (
    "model", "immersion", "frequency_Hz", "active_force_mN", "step_mm", "step_spread_mm", "speed_mm_per_s", "stroke_mm",
    "camera_stroke_mm", "slip_fraction_1", "work_pillar_uJ", "work_walk_uJ", "efficiency_1",
    "mechanical_efficiency_1", "energy_error_1", "unknowns_1",
)  # fmt: skip


def label(walk: SolidWalk) -> str:
    """Word for file names."""
    return f"{walk.frequency:g}Hz".replace(".", "p") + f"_{walk.design.ground.immersion}_solid"


def summary_of(walk: SolidWalk) -> dict[str, Any]:
    """`SolidWalk.summary` with where it walked."""
    rings = rings_of(walk)
    most = {f"largest_{key}": max(abs(ring[key]) for ring in rings) for key in (rings[0] if rings else ())}
    return {"immersion": walk.design.ground.immersion, **walk.summary(), **most}


def rings_of(walk: SolidWalk) -> list[dict[str, float]]:
    """What each pillar bears of a ring that is not bonded, at each sample; none where the tissue is bonded."""
    motion = walk.motion
    return [contact_numbers(walk.design, motion.state(i)) for i in range(len(motion.between))]


def write_walk(folder: Path, walk: SolidWalk, series: str) -> None:
    """The samples of one walk as a table, and as series of bodies and of contact points for ParaView."""
    columns: dict[str, Any] = {
        "time_s": walk.times,
        "drive_1": walk.drive,
        **{f"position_{c}_mm": walk.position[:, k] for k, c in enumerate("xyz")},
        "tip_closing_mm": walk.tip_closing,
        "sagitta_mm": walk.sagitta,
        "muscle_force_mN": walk.muscle_force,
    }
    for k, name in enumerate(walk.feet):
        for c, way in enumerate(("normal", "forward", "left")):
            columns[f"{name}_{way}_mN"] = walk.foot_force[:, k, c]
        columns[f"{name}_state"] = np.array([_WORDS.get(int(s), "stick") for s in walk.foot_state[:, k]])
    rings = rings_of(walk)
    for name in rings[0] if rings else ():
        columns[name] = np.array([ring[name] for ring in rings])
    stored = ("kinetic", "strain", "weight")
    for name in (*stored, "muscle", "viscous", "drag", "friction", "normal", "integrator", *(_RINGS if rings else ())):
        columns[f"{name}_uJ"] = walk.motion.energy(name)
    columns["unexplained_uJ"] = walk.motion.energy_error
    plain = ([f"{v:.9g}" if isinstance(v, float) else v for v in np.asarray(c).tolist()] for c in columns.values())
    rows = [dict(zip(columns, values, strict=True)) for values in zip(*plain, strict=True)]
    write_table(tables_folder(folder) / f"walk_{label(walk)}.csv", rows)
    _write_series(folder, walk, series)


def _write_series(folder: Path, walk: SolidWalk, name: str) -> None:
    """``solid.pvd`` has the body with stress and displacement, ``solid_contacts.pvd`` the ground's forces.

    ``solid_rings.pvd`` has the footprint of rings that are not bonded.
    """
    motion, feet = walk.motion, walk.motion.feet
    assert feet is not None
    contacts = folder / name
    try:
        contacts.mkdir(exist_ok=True)
    except OSError as error:
        raise file_error(error, contacts) from None
    every = -(-len(motion.times) // MOST_STATES)
    bodies, points, rings = [], [], []
    area = np.where(feet.area > 0.0, feet.area, np.inf)
    X = motion.body.system.space.points[:, feet.nodes]
    for number, i in enumerate(range(0, len(motion.times), every)):
        time = float(motion.times[i])
        write_state(folder / f"{name}_{number:04d}.vtu", motion.state(i))
        bodies.append((time, f"{name}_{number:04d}.vtu"))
        force = motion.contact_force[i]
        write_vtp(
            contacts / f"contacts_{number:04d}.vtp",
            X + motion.u[i][:, feet.nodes],
            vertices=np.arange(len(feet.nodes)),
            point_data={
                "force_mN": (force @ walk.ground.axes).T,
                "pressure_kPa": force[:, 0] / area,
                "friction_traction_kPa": np.linalg.norm(force[:, 1:], axis=1) / area,
                "touch": motion.touch[i],
                "foot": feet.owner,
            },
            names={"foot_names": list(feet.names), "touch_names": ["lifted", "stick", "slip"]},
        )
        points.append((time, f"{name}/contacts_{number:04d}.vtp"))
        if motion.between:
            rings.append((time, f"{name}/rings_{number:04d}.vtp"))
            write_footprint(folder / rings[-1][1], motion.state(i))
    if rings:
        write_pvd(folder / f"{name}_rings.pvd", rings)
    write_pvd(folder / f"{name}.pvd", bodies)
    write_pvd(folder / f"{name}_contacts.pvd", points)


def write_tables(folder: Path, walks: Sequence[SolidWalk], rods: Sequence[Walk]) -> None:
    """One line a walk, and one a stroke, of solids and rods."""
    summaries = [*map(summary_of, walks), *map(walk_files.walk_summary, rods)]
    tables = tables_folder(folder)
    write_table(
        tables / "walks.csv", [{k: v for k, v in s.items() if not isinstance(v, dict | list)} for s in summaries]
    )
    named = [*((label(w), w) for w in walks), *((walk_files.label(w), w) for w in rods)]
    strokes = [
        {"walk": name, "stroke_1": k, "advance_mm": float(a), "kept": w.kept.start <= k < w.kept.stop}
        for name, w in named
        for k, a in enumerate(w.advances)
    ]
    if strokes:
        write_table(tables / "walk_strokes.csv", strokes)


def draw(folder: Path, walks: Sequence[SolidWalk], rods: Sequence[Walk]) -> list[tuple[Path, str]]:
    """Graphs of the walks, solids and rods together where both walked, with captions."""
    figures = figures_folder(folder)
    out: list[tuple[Path, str]] = []
    for walk in walks:
        beside = next((r for r in rods if r.frequency == walk.frequency), None)
        if beside is not None:
            out += draw_together(figures, walk, beside)
        out += _draw_one(figures, walk)
    for rod in rods:
        out += walk_files.draw_walks(folder, [rod], [rod])
    return out


def _draw_one(figures: Path, walk: SolidWalk) -> list[tuple[Path, str]]:
    motion, name, word = walk.motion, f"{walk.frequency:g} Hz", label(walk)
    out = [(figures / f"walk_{word}.png", f"Position and tip closing of the solid at {name}.")]
    position(
        out[-1][0], walk.times, walk.advance, tip_closing=walk.tip_closing, strokes=walk.stroke_ends,
        discarded=walk.kept.start, title=f"Walk of the solid at {name}",
    )  # fmt: skip
    if walk.strokes:
        begin, end = (float(t) for t in walk.stroke_ends[-2:])
        feet = {
            foot: Foot(walk.foot_force[:, k, 0], walk.foot_force[:, k, 1], walk.foot_state[:, k])
            for k, foot in enumerate(walk.feet)
        }
        kinetic = walk.ground.kinetic_coefficients
        out.append((figures / f"feet_{word}.png", f"Forces on the solid's feet over the last stroke at {name}."))
        foot_forces(
            out[-1][0], walk.times, feet, period=(begin, end), friction=[float(kinetic[1]), float(kinetic[0])],
            drive=walk.drive, title=f"Forces on the solid's feet over a stroke at {name}",
        )  # fmt: skip
    stored = {key: motion.energy(key) for key in ("kinetic", "strain", "weight")}
    names = ("muscle", "viscous", "drag", "friction", "normal", "integrator", *_RINGS)
    work = {key: motion.energy(key) for key in names}
    out.append((figures / f"energy_{word}.png", f"Energy stored in the solid, work on it, and the rest, at {name}."))
    energy_book(
        out[-1][0], walk.times, stored, {key: values for key, values in work.items() if np.ptp(values) > 0.0},
        motion.energy_error, strokes=walk.stroke_ends, title=f"Energy of the solid at {name}",
    )  # fmt: skip
    return out


def write_solid_report(
    folder: Path, summary: Mapping[str, Any], figures: Sequence[tuple[Path, str]], design: Design
) -> None:
    """`report.html` of a walk of the solid."""
    rows = [{name: walk.get(name) for name in _SHOWN} for walk in summary["walks"]]
    tables = [walk_files.table("Walking", rows)]
    write_report(
        folder / "report.html",
        summary,
        figures,
        tables,
        summary["notes"],
        appendix=appendix(design),
        title=f"{design.name}: the solid walks",
    )
