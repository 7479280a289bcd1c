"""What a convergence study says: lines and tables of its limits, and pictures of the laws that they were read from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fem_biobot.design import Design
from fem_biobot.study.richardson import LEAST_ORDER, Limit, Verdict
from fem_biobot.tables import Table
from fem_biobot.view.convergence import Curve, laws_of_size

Rows = Sequence[Mapping[str, object]]
Limits = Mapping[tuple[str, str], Limit]

QUANTITIES = {
    "muscle_force_mN": "muscle force",
    "tip_closing_mm": "tip closing",
    "sagitta_mm": "sagitta",
    "tip_deflection_mm": "tip deflection",
    "fibre_stretch_1": "fibre stretch",
    "strain_energy_uJ": "strain energy",
    "skeleton_energy_uJ": "strain energy, skeleton",
    "junction_energy_uJ": "strain energy, junctions",
    "ring_energy_uJ": "strain energy, rings",
    "ball_von_mises_kPa": "von Mises, ball about the corner",
    "max_von_mises_kPa": "von Mises, highest point",
    "fillet_von_mises_kPa": "von Mises, peak in a fillet",
}
# of these, what parts of a machine do
LOCAL = (
    "skeleton_energy_uJ",
    "junction_energy_uJ",
    "ring_energy_uJ",
    "ball_von_mises_kPa",
    "max_von_mises_kPa",
    "fillet_von_mises_kPa",
)


def told(name: str, found: Limit) -> str:
    """What is known of a quantity, by its key, in words: its limit and how well, and the finest mesh beside it."""
    if found.verdict is Verdict.not_converging:
        return "not converging, its changes do not shrink: no number of any mesh can be quoted"
    text = f"{found.value:.4g}{_unit(name, ' ')}, known to {_percent(found.bar)}"
    if found.laws:
        side = "above" if found.off > 0.0 else "below"
        text += f"; the finest mesh is {_percent(abs(found.off))} {side} it, within {_percent(found.error)}"
    text += f", order {_order(found)}" if _order(found) else ""
    if found.verdict is Verdict.undecided and found.order == found.order:
        return f"undecided, its changes are small and follow no order: {text}; ask for finer meshes"
    if found.verdict is Verdict.undecided:
        return f"undecided, the meshes are too much alike, or scatter: {text}; ask for sizes further apart"
    if found.verdict is Verdict.converging:
        wanted = "" if found.size != found.size else f"; elements of {found.size:.2g} mm in the mean for what was asked"
        return f"converging: {text}{wanted}"
    return f"converged: {text}"


def _order(found: Limit) -> str:
    """The observed order; nothing where none is seen, which changes that do not shrink have either."""
    return f"{found.order:.2g}" if found.order >= LEAST_ORDER else ""


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


def _unit(name: str, before: str = "") -> str:
    """Unit of a quantity by the suffix of its key; nothing for a pure number."""
    unit = name.rpartition("_")[2]
    return "" if unit == "1" else before + unit


def energy_told(rows: Rows, limits: dict[tuple[str, str], Limit], element: str) -> list[str]:
    """That it is the rings' energy which changes, where the machine's has not converged and the rest does less."""
    whole = limits.get((element, "strain_energy_uJ"))
    if whole is None or whole.verdict is Verdict.converged or (element, "ring_energy_uJ") not in limits:
        return []
    own = sorted((row for row in rows if row["element"] == element), key=lambda row: -float(str(row["size_mm"])))
    energy, rings = (np.array([row[name] for row in own[-2:]]) for name in ("strain_energy_uJ", "ring_energy_uJ"))
    change, without = (100.0 * abs(float(e[1] / e[0]) - 1.0) for e in (energy, energy - rings))
    if without >= change:
        return []
    return [
        f"{element}, strain energy: {rings[1]:.3g} of {energy[1]:.4g} uJ are the rings', which are squeezed onto the "
        "edges of their pillars, about which their fibres turn; without these its last change is "
        f"{without:.2g} % in place of {change:.2g} %"
    ]


def values_table(rows: Rows) -> Table:
    """Every number of every mesh."""
    header = tuple(dict.fromkeys(key for row in rows for key in row))
    return Table("One state on every mesh", header, tuple(tuple(row.get(key) for key in header) for row in rows))


def limits_table(limits: Limits) -> Table:
    """What is known of every limit."""
    lines = []
    for (element, name), found in limits.items():
        none = found.verdict is Verdict.not_converging
        known, error = ("", "") if none else (_percent(found.bar), _percent(found.error))
        size = "" if found.size != found.size else f"{found.size:.2g}"
        words = QUANTITIES[name] + (f" [{_unit(name)}]" if _unit(name) else "")
        lines.append((element, words, found.value, known, error, _order(found), found.verdict.value, size))
    header = (
        "element",
        "quantity",
        "limit",
        "limit known to",
        "error of the finest",
        "order",
        "verdict",
        "mean size for what was asked [mm]",
    )
    return Table("What they tend to", header, tuple(lines))


def limit_rows(limits: Limits) -> list[dict[str, object]]:
    """The same as numbers; those that there are not are None."""
    return [
        {
            "element": element,
            "quantity": name,
            "unit": name.rpartition("_")[2],
            "value": found.value,
            "known_to_1": None if found.verdict is Verdict.not_converging else found.bar,
            "finest": found.finest,
            "finest_above_1": None if found.verdict is Verdict.not_converging else found.off,
            "error_1": None if found.verdict is Verdict.not_converging else found.error,
            "order_1": _number(found.order),
            "scatter_1": _number(found.scatter),
            "verdict": found.verdict.value,
            "size_for_wanted_mm": _number(found.size),
        }
        for (element, name), found in limits.items()
    ]


def _number(value: float) -> float | None:
    return None if value != value else value


def draw(design: Design, rows: Rows, limits: Limits, figures: Path) -> list[tuple[Path, str]]:
    """Every quantity over its value on the finest mesh: what the whole does, and stress and energy by part."""
    files = []
    for element in dict.fromkeys(element for element, _ in limits):
        own = sorted((row for row in rows if row["element"] == element), key=lambda row: -float(str(row["size_mm"])))
        for suffix, words, local in (
            ("", "what the whole does", False),
            ("_local", "stress, and energy by part", True),
        ):
            curves = {
                QUANTITIES[name]: _curve([row for row in own if name in row], name, found)
                for (element_of, name), found in limits.items()
                if element_of == element and (name in LOCAL) == local and found.finest != 0.0
            }
            if not curves:
                continue
            file = figures / f"convergence_{element}{suffix}.png"
            title = f"{design.name}, {element}: {words}"
            laws_of_size(file, curves, x="mean element size [mm]", y="over the finest [1]", title=title)
            caption = (
                f"{element}: {words}, over the value on the finest mesh. Lines: in the middle between the laws of the "
                "lowest and the highest limit (shaded); bars at no size: how well the limit is known."
            )
            files.append((file, caption))
    return files


def _curve(rows: Rows, name: str, found: Limit) -> Curve:
    """A quantity over its finest value."""
    sizes = np.array([float(str(row["size_mm"])) for row in rows])
    values = np.array([float(str(row[name])) for row in rows]) / found.finest
    if not found.laws:
        bar = None if found.verdict is Verdict.not_converging else (found.value / found.finest, found.bar)
        return Curve(sizes, values, bar=bar)
    along = np.linspace(0.0, sizes.max(), 60)
    between = np.sort([law.at(along) / found.finest for law in found.laws], axis=0)
    return Curve(sizes, values, along, between, (found.value / found.finest, found.bar))
