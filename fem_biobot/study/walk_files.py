"""Files of walks: tables, rods over time for ParaView, plots and animation, the report of the command `walk`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.files import file_error
from fem_biobot.friction.kernels import LIFTED, SLIP
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.published.course import diagnostics
from fem_biobot.study import compare, rod_outputs
from fem_biobot.study.outputs import figures_folder, write_table
from fem_biobot.study.provenance import appendix
from fem_biobot.study.views import MOST_WALKS, walk_view
from fem_biobot.view.gait import step_against_frequency
from fem_biobot.view.report import write_report

_PLACES = {"air": "in air"}
_WORDS = {LIFTED: "lifted", SLIP: "slip"}
_SHOWN = (
    "immersion", "frequency_Hz", "active_force_mN", "step_mm", "step_spread_mm", "speed_mm_per_s", "stroke_mm",
    "camera_stroke_mm", "slip_fraction_1", "work_pillar_uJ", "work_walk_uJ", "efficiency_1",
    "mechanical_efficiency_1", "energy_error_1",
)  # fmt: skip


def label(walk: Walk) -> str:
    """Word for file names."""
    place = f"_{walk.design.ground.immersion}" if walk.design is not None else ""
    return f"{walk.frequency:g}Hz".replace(".", "p") + place


def walk_summary(walk: Walk) -> dict[str, Any]:
    """`Walk.summary` with where it walked."""
    place = {"immersion": walk.design.ground.immersion} if walk.design is not None else {}
    return {**place, **walk.summary()}


def write_walk(folder: Path, walk: Walk, series: str | None = None) -> None:
    """The samples of one walk as a table; with the name of a series also for ParaView."""
    if series is not None:
        rod_outputs.write_rod_series(folder, walk.motion, name=series)
    columns: dict[str, Any] = {
        "time_s": walk.times,
        "drive_1": walk.motion.drive,
        "position_x_mm": walk.position[:, 0],
        "position_y_mm": walk.position[:, 1],
        "position_z_mm": walk.position[:, 2],
        "tip_closing_mm": walk.tip_closing,
        "sagitta_mm": walk.sagitta,
        "muscle_force_mN": walk.muscle_force.sum(axis=1),
    }
    for k, name in enumerate(walk.anatomy.feet):
        columns[f"{name}_normal_mN"] = walk.foot_force[:, k, 0]
        columns[f"{name}_forward_mN"] = walk.foot_force[:, k, 1]
        columns[f"{name}_left_mN"] = walk.foot_force[:, k, 2]
        columns[f"{name}_state"] = np.array([_WORDS.get(int(s), "stick") for s in walk.foot_state[:, k]])
    for name in ("kinetic", "elastic", "weight", "muscle", "damping", "friction", "normal", "integrator"):
        columns[f"{name}_uJ"] = walk.motion.energy(name)
    columns["unexplained_uJ"] = walk.motion.energy_error
    rows = [
        dict(zip(columns, values, strict=True)) for values in zip(*(_plain(c) for c in columns.values()), strict=True)
    ]
    _tables(folder)
    write_table(folder / "tables" / f"walk_{label(walk)}.csv", rows)
    if walk.design is not None and walk.design.walker is not None:
        columns = diagnostics(walk.motion)
        rows = [
            dict(zip(columns, values, strict=True))
            for values in zip(*(_plain(c) for c in columns.values()), strict=True)
        ]
        write_table(folder / "tables" / f"diagnostics_{label(walk)}.csv", rows)


def _plain(column: Any) -> list[Any]:
    return [f"{v:.9g}" if isinstance(v, float) else v for v in np.asarray(column).tolist()]


def write_walk_tables(folder: Path, walks: Sequence[Walk]) -> None:
    """One line a walk, and one a stroke."""
    _tables(folder)
    rows = [{k: v for k, v in walk_summary(w).items() if not isinstance(v, dict | list)} for w in walks]
    write_table(folder / "tables" / "walks.csv", rows)
    strokes = [
        {"walk": label(w), "stroke_1": k, "advance_mm": float(a), "kept": w.kept.start <= k < w.kept.stop}
        for w in walks
        for k, a in enumerate(w.advances)
    ]
    if strokes:
        write_table(folder / "tables" / "walk_strokes.csv", strokes)


def _tables(folder: Path) -> None:
    try:
        (folder / "tables").mkdir(exist_ok=True)
    except OSError as error:
        raise file_error(error, folder / "tables") from None


def draw_walks(folder: Path, walks: Sequence[Walk], shown: Sequence[Walk]) -> list[tuple[Path, str]]:
    """Steps against frequency of all walks, and graphs and the animation of those shown, with captions."""
    figures = figures_folder(folder)
    out: list[tuple[Path, str]] = []
    places = dict.fromkeys("rod model" if w.design is None else w.design.ground.immersion for w in walks)
    if len({w.frequency for w in walks}) > 1:
        curves = {}
        for place in places:
            kept = [w for w in walks if w.strokes and (w.design is None or w.design.ground.immersion == place)]
            spread = [0.0 if math.isnan(w.step_spread_mm) else w.step_spread_mm for w in kept]
            curves[_PLACES.get(place, place)] = ([w.frequency for w in kept], [w.step_mm for w in kept], spread)
        out.append((figures / "steps.png", "Step and speed against strokes per second; bars: spread of the strokes."))
        step_against_frequency(out[-1][0], curves)
    for walk in shown:
        out += rod_outputs.draw_walk(figures, walk, label(walk))
    return out


def write_walk_report(
    folder: Path, summary: Mapping[str, Any], figures: Sequence[tuple[Path, str]], design: Design, walks: Sequence[Walk]
) -> None:
    """`report.html` of the command `walk`; of more walks than a browser shows, the first ones are interactive."""
    rows = [{name: walk.get(name) for name in _SHOWN} for walk in summary["walks"]]
    tables = [table("Walking, rod model", rows)]
    beside = compare.walks_beside_paper(summary["walks"])
    if beside:
        tables.append(table("Beside the paper", beside))
    write_report(
        folder / "report.html", summary, figures, tables, summary["notes"],
        views=[walk_view(walk) for walk in walks[:MOST_WALKS]], appendix=appendix(design),
        title=f"{design.name}: walking",
    )  # fmt: skip


def table(title: str, rows: Sequence[Mapping[str, Any]]) -> tuple[str, list[str], list[list[Any]]]:
    """A table of the report."""
    header = list(dict.fromkeys(key for row in rows for key in row))
    return title, header, [[row.get(name) for name in header] for row in rows]
