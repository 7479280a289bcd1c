"""What results say at the terminal: the summary of a run, a mesh, the presets, as a few tables and lines.

A run is shown from its summary alone, so that a result that was on disk already looks like a new one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fem_biobot.tables import Table

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.mesh.body import BodyMesh

Rows = Sequence[Mapping[str, Any]]

_STATE_COLUMNS = {
    "label": "state",
    "tension_kPa": "tension [kPa]",
    "muscle_force_mN": "muscle force [mN]",
    "tip_closing_mm": "tip closing [mm]",
    "tip_deflection_mm": "tip deflection [mm]",
    "sagitta_mm": "sagitta [mm]",
    "fibre_stretch_1": "fibre stretch [1]",
    "max_von_mises_kPa": "max von Mises [kPa]",
}
_STROKE_ROWS = {
    "passive_closing_mm": "passive tip closing [mm]",
    "passive_force_mN": "passive force through the muscle [mN]",
    "passive_eq3_force_mN": "passive force as Eq. 3 infers it [mN]",
    "stroke_mm": "stroke, tip closing from the passive state [mm]",
    "stroke_force_mN": "stroke force through the muscle [mN]",
    "stroke_eq3_force_mN": "stroke force as Eq. 3 infers it [mN]",
    "natural_stretch_1": "natural stretch of the tissue [1]",
}


def result_tables(summary: Mapping[str, Any], kind: str) -> list[Table]:
    """Tables of a whole result; what is not in the summary is said by `remarks`.

    Parameters
    ----------
    summary
        As `study.run.run` returns it.
    kind
        Kind of the design: a bot is compared with the paper, the others with closed forms.
    """
    solid = summary["solid"]
    complete = "error_estimate" in solid or summary["job"]["kind"] == "run"
    tables = [] if complete else [_states(solid["states"])]
    if solid.get("comparison"):
        tables.append(_comparison(solid["comparison"], "paper" if kind == "bot" else "closed form"))
    if solid.get("stroke"):
        tables.append(_stroke(solid["stroke"]))
    if solid.get("error_estimate"):
        tables.append(_errors(solid["error_estimate"]))
    if summary.get("walks"):
        tables.append(walk_table(summary["walks"]))
    if summary.get("design_check"):
        tables.append(_check(summary["design_check"]))
    return tables


def remarks(summary: Mapping[str, Any], kind: str) -> list[str]:
    """Lines below the tables: what a reader would look for and not find, and what the result took."""
    solid, mesh = summary["solid"], summary["mesh"]
    lines = []
    if kind == "bot" and not solid.get("stroke"):
        lines.append("No stroke: the passive or the stimulated state was not solved.")
    if summary["job"]["kind"] == "run" and not solid.get("error_estimate"):
        lines.append("The error of the mesh was not estimated (see the notes).")
    work = f"{mesh['unknowns_1']} unknowns, {len(solid['states'])} states, {solid['factorisations_1']} factorisations"
    total = summary["timings_s"].get("total")
    lines.append(work + (f", {total:.0f} s." if total is not None else "."))
    return lines


_WALK_COLUMNS = {
    "model": "model",
    "stroke_from": "rods with",
    "immersion": "in",
    "frequency_Hz": "Hz",
    "active_force_mN": "active force [mN]",
    "step_mm": "step [mm]",
    "step_spread_mm": "+-",
    "speed_mm_per_s": "speed [mm/s]",
    "stroke_mm": "stroke [mm]",
    "camera_stroke_mm": "as filmed [mm]",
    "slip_fraction_1": "slip [1]",
    "efficiency_1": "efficiency [1]",
    "mechanical_efficiency_1": "mechanical [1]",
}


def _check(rows: Rows) -> Table:
    """The design check without its reasons, which the report has."""
    lines = tuple((row["name"], row["by"], row["value"], row["limit"], row["unit"], row["verdict"]) for row in rows)
    return Table("Will it work? (why: tables/design_check.csv)", ("", "by", "value", "limit", "unit", "verdict"), lines)


def walk_table(walks: Rows) -> Table:
    """One line a walk."""
    rods = all(walk.get("model") == "rod" for walk in walks)
    kept = [name for name in _WALK_COLUMNS if any(walk.get(name) is not None for walk in walks)]
    if rods:
        kept = [name for name in kept if name != "model"]
    body = tuple(tuple(walk.get(name) for name in kept) for walk in walks)
    return Table("Walking, rod model" if rods else "Walking", tuple(_WALK_COLUMNS[name] for name in kept), body)


def where_to_look(folder: Path) -> list[str]:
    """Which files to open, of those that are there."""
    guide = {
        "report.html": "open in a browser: tables, pictures and graphs on one page",
        "solid.pvd": "open in ParaView: stress and displacement of every state",
        "solid_contacts.pvd": "open in ParaView: forces of the ground on the solid's feet over time",
        "rod.pvd": "open in ParaView: the walking rods over time, with forces",
        "tables": "every number as CSV, with the sources of the comparison",
        "summary.json": "every number for programs",
    }
    there = [(name, text) for name, text in guide.items() if (folder / name).exists()]
    width = max((len(str(folder / name)) for name, _ in there), default=0)
    return [f"{str(folder / name).ljust(width)}  {text}" for name, text in there]


def _comparison(rows: Rows, against: str) -> Table:
    header = ("quantity", "ours", against, "+-", "unit", "difference", "%")
    body = [
        (
            quantity,
            row["ours"],
            row["paper"],
            row.get("deviation"),
            row["unit"],
            row["difference"],
            _percent(row.get("relative_1")),
        )
        for quantity, row in zip(_told_apart(rows), rows, strict=True)
    ]
    # a column that says nothing anywhere is left out
    empty = [all(row[i] is None for row in body) for i in range(len(header))]
    kept = [i for i in range(len(header)) if not empty[i]]
    return Table(
        f"Beside the {against}", tuple(header[i] for i in kept), tuple(tuple(row[i] for i in kept) for row in body)
    )


def _told_apart(rows: Rows) -> list[str]:
    """Quantities of the rows; of equal ones each with what is special about its source, such as ``2 Hz``."""
    names = []
    for row in rows:
        others = [r for r in rows if r["quantity"] == row["quantity"] and r is not row]
        common = set.intersection(*(set(r["source"].split(", ")) for r in others)) if others else set()
        special = [part for part in row["source"].split(", ") if part not in common] if others else []
        names.append(", ".join([row["quantity"], *special]))
    return names


def _stroke(stroke: Mapping[str, Mapping[str, Any]]) -> Table:
    header = ("tissue", *(name.replace("_", " ") for name in stroke))
    body = [(text, *(values.get(key) for values in stroke.values())) for key, text in _STROKE_ROWS.items()]
    return Table("Passive state and stroke", header, tuple(row for row in body if set(row[1:]) != {None}))


def _errors(rows: Rows) -> Table:
    """The first quantity of each state, which is the one the machine is judged by; all are in the tables."""
    first = {row["state"]: row for row in reversed(rows)}
    kept = [row for row in rows if first[row["state"]] is row]
    header = ("state", "quantity", "this mesh", "coarser mesh", "estimated error", "%")
    body = [
        (
            row["state"],
            _spelt(row["quantity"]),
            row["this mesh"],
            row["coarser mesh"],
            row["estimated error"],
            _percent(row.get("relative_1")),
        )
        for row in kept
    ]
    return Table("Error of the mesh, from two sizes", header, tuple(body))


def _states(states: Rows) -> Table:
    kept = [name for name in _STATE_COLUMNS if any(state.get(name) is not None for state in states)]
    body = tuple(tuple(state.get(name) for name in kept) for state in states)
    return Table("States", tuple(_STATE_COLUMNS[name] for name in kept), body)


def _spelt(key: str) -> str:
    return _STATE_COLUMNS.get(key, key)


def _percent(share: float | None) -> float | None:
    return None if share is None else float(f"{100.0 * share:.2g}")


def mesh_summary(mesh: BodyMesh, design: Design | None) -> dict[str, Any]:
    """Counts, volumes, surfaces and quality of a mesh, with the volumes of the design where there is one."""
    from fem_biobot.mesh.layout import layout

    expected = layout(design).volumes if design is not None else {}
    regions = {}
    for name, volume in mesh.region_volumes().items():
        regions[name] = {"elements_1": int(mesh.regions[name].size), "volume_mm3": volume}
        if name in expected:
            regions[name] |= {"design_volume_mm3": expected[name], "relative_1": volume / expected[name] - 1.0}
    quality = mesh.quality()
    return {
        "design": None if design is None else design.name,
        "source": {key: value for key, value in mesh.source.items() if isinstance(value, str | int | float | bool)},
        "vertices_1": mesh.n_vertices,
        "elements_1": mesh.n_elements,
        "unknowns_1": mesh.n_unknowns,
        "mean_edge_mm": mesh.h_mean,
        "regions": regions,
        "surfaces": {name: {"facets_1": int(triples.shape[1])} for name, triples in mesh.surfaces.items()},
        "landmarks": {name: {"position_mm": mesh.points[:, v].tolist()} for name, v in mesh.landmarks.items()},
        "quality": {
            "worst_radius_ratio_1": quality.minimum,
            "mean_radius_ratio_1": quality.mean,
            "share_below_tenth_1": quality.share_below_tenth,
            "shortest_edge_mm": quality.shortest_edge,
            "longest_edge_mm": quality.longest_edge,
        },
    }


def mesh_tables(summary: Mapping[str, Any]) -> list[Table]:
    """Tables of a `mesh_summary`."""
    quality, regions = summary["quality"], summary["regions"]
    counts = [
        ("vertices", summary["vertices_1"]),
        ("tetrahedra", summary["elements_1"]),
        ("unknowns of quadratic elements", summary["unknowns_1"]),
        ("mean edge [mm]", summary["mean_edge_mm"]),
        ("shortest, longest edge [mm]", f"{quality['shortest_edge_mm']:.3g}, {quality['longest_edge_mm']:.3g}"),
        ("radius ratio, worst [1]", quality["worst_radius_ratio_1"]),
        ("radius ratio, mean [1]", quality["mean_radius_ratio_1"]),
        ("share of elements below 0.1 [1]", quality["share_below_tenth_1"]),
    ]
    header = ("region", "tetrahedra", "volume [mm^3]")
    rows = [(name, r["elements_1"], r["volume_mm3"]) for name, r in regions.items()]
    if all("design_volume_mm3" in r for r in regions.values()):
        header = (*header, "of the design [mm^3]", "off by [%]")
        rows = [
            (*row, r["design_volume_mm3"], f"{100.0 * r['relative_1']:+.2g}")
            for row, r in zip(rows, regions.values(), strict=True)
        ]
    surfaces = tuple((name, s["facets_1"]) for name, s in summary["surfaces"].items())
    tables = [Table("Mesh", ("", ""), tuple(counts)), Table("Regions", header, tuple(rows))]
    if surfaces:
        tables.append(Table("Surfaces", ("surface", "facets"), surfaces))
    if summary["landmarks"]:
        places = [(n, "({:.4g}, {:.4g}, {:.4g})".format(*p["position_mm"])) for n, p in summary["landmarks"].items()]
        tables.append(Table("Landmarks", ("landmark", "position [mm]"), tuple(places)))
    return tables


_NUMBER_TEXTS = {
    "span_mm": "span {:.3g} mm",
    "moment_arm_mm": "moment arm {:.3g} mm",
    "second_moment_mm4": "I {:.2g} mm^4",
    "gel_young_kPa": "gel {:.4g} kPa",
    "muscle_section_mm2": "muscle {:.3g} mm^2",
    "passive_tension_kPa": "tension {:.4g}",
    "tip_force_mN": "tip force {:.3g} mN",
    "base_force_mN": "fibres of {:.3g}",
}
_PEAKS = {"peak_tension_kPa": "kPa", "peak_force_mN": "mN"}


def preset_table(presets: Sequence[tuple[str, str, Mapping[str, float]]]) -> Table:
    """Names, descriptions and key numbers of presets."""
    rows = []
    for name, description, numbers in presets:
        texts = [text.format(numbers[key]) for key, text in _NUMBER_TEXTS.items() if key in numbers]
        for key, unit in _PEAKS.items():
            if key in numbers:
                texts[-1] += f" to {numbers[key]:.4g} {unit}"
        rows.append((name, description, ", ".join(texts)))
    return Table("", ("preset", "what it is", "key numbers"), tuple(rows))
