"""A run's numbers beside what the paper prints or a closed form gives, and the mesh's error from two sizes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import root

from fem_biobot.design import Design
from fem_biobot.design_parts import Muscle
from fem_biobot.material.law import lame
from fem_biobot.study.paper import (
    EFFICIENCY,
    PASSIVE_FORCE,
    RING_BOT_FORCE,
    SIMULATED_FORCE_TO_DEFLECTION,
    SPEED_4_HZ,
    STROKE_FORCE_2_HZ,
    STROKE_FORCE_4_HZ,
    Printed,
)

State = Mapping[str, Any]

# the quantities whose error is estimated
_WITH_ERROR = ("tip_closing_mm", "muscle_force_mN", "tip_deflection_mm", "fibre_stretch_1", "ball_von_mises_kPa")


def strokes(states: Sequence[State]) -> dict[str, dict[str, Any]]:
    """Passive state and the stroke measured from it, for each reference state of the tissue that was solved."""
    by_key = {s["key"]: s for s in states}
    found = {}
    for name, prefix in (("as_moulded", ""), ("remodelled", "remodelled_")):
        passive, peak = by_key.get(f"{prefix}passive"), by_key.get(f"{prefix}peak")
        if passive is None or peak is None:
            continue
        found[name] = {
            "passive_closing_mm": passive["tip_closing_mm"],
            "passive_force_mN": passive["muscle_force_mN"],
            "passive_eq3_force_mN": passive["eq3_force_mN"],
            "stroke_mm": peak["tip_closing_mm"] - passive["tip_closing_mm"],
            "stroke_force_mN": peak["muscle_force_mN"] - passive["muscle_force_mN"],
            "stroke_eq3_force_mN": _minus(peak["eq3_force_mN"], passive["eq3_force_mN"]),
            "natural_stretch_1": passive["natural_stretch_1"],
        }
    return found


def beside_paper(
    design: Design, states: Sequence[State], stroke: Mapping[str, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Rows of a bot's numbers beside the printed ones; nothing is tuned, differences stand as they are."""
    rows: list[dict[str, Any]] = []
    by_key = {s["key"]: s for s in states}
    assert design.muscle is not None
    if design.muscle.layout == "ring":
        passive = by_key.get("passive")
        if passive is not None:
            rows.append(_row("passive muscle force", passive["muscle_force_mN"], RING_BOT_FORCE))
        return rows
    for force, printed in SIMULATED_FORCE_TO_DEFLECTION:
        state = by_key.get(f"force_{force:g}".replace(".", "p"))
        if state is not None:
            rows.append(_row(f"tip closing at {force:g} mN of muscle force", state["tip_closing_mm"], printed))
    for reference, values in stroke.items():
        name = reference.replace("_", " ")
        rows.append(_row(f"passive force through the muscle, {name}", values["passive_force_mN"], PASSIVE_FORCE))
        rows.append(_row(f"passive force as Eq. 3 infers it, {name}", values["passive_eq3_force_mN"], PASSIVE_FORCE))
        for printed in (STROKE_FORCE_2_HZ, STROKE_FORCE_4_HZ):
            rows.append(_row(f"stroke force as Eq. 3 infers it, {name}", values["stroke_eq3_force_mN"], printed))
    return rows


def walks_beside_paper(walks: Sequence[State]) -> list[dict[str, Any]]:
    """Rows of walking numbers beside those measured in the paper."""
    rows = []
    for walk in walks:
        frequency = walk["frequency_Hz"]
        place = {"air": ", in air", "submerged": ", submerged"}.get(walk.get("immersion", ""), "")
        if frequency == 4.0:
            rows.append(_row(f"walking speed{place}", walk["speed_mm_per_s"], SPEED_4_HZ))
        if frequency in EFFICIENCY:
            rows.append(_row(f"efficiency of walking{place}", walk["efficiency_1"], EFFICIENCY[frequency]))
    return rows


def beside_closed_form(design: Design, states: Sequence[State]) -> list[dict[str, Any]]:
    """Rows of a strip's or cantilever's numbers beside closed forms."""
    if design.kind == "strip" and design.muscle is not None:
        material = design.muscle.material
        if not _has_closed_form(design.muscle):
            return []
        return [
            _row(
                f"fibre stretch at {s['tension_kPa']:.4g} kPa",
                s["fibre_stretch_1"],
                Printed(
                    free_contraction(material.young, material.poisson, s["tension_kPa"])[0],
                    "1",
                    "free contraction, neo-Hooke, along the fibre",
                ),
            )
            for s in states
            if abs(design.muscle.theta - np.pi / 2) < 1e-9 and s["key"] != "rest"
        ]
    if design.kind == "cantilever" and design.load is not None:
        return [
            _row(
                f"tip deflection at {s['load_1']:.0%} of {design.load.tip_force:g} mN",
                s["tip_deflection_mm"],
                Printed(s["load_1"] * timoshenko_tip(design), "mm", "Timoshenko beam, small deflection"),
            )
            for s in states
            if s["load_1"] > 0.0
        ]
    return []


def _has_closed_form(muscle: Muscle) -> bool:
    """Whether `free_contraction` speaks of this muscle: coupled neo-Hooke under plain nominal tension."""
    plain = muscle.convention == "nominal" and muscle.force_length == "none" and muscle.activation is None
    return plain and muscle.material.law == "neo_hooke" and muscle.spread == muscle.transverse == 0.0


def free_contraction(young: float, poisson: float, tension: float) -> tuple[float, float]:
    """Stretches along and across the fibre of a free compressible neo-Hookean body under nominal tension [1].

    Solves ``P = 0`` along, ``mu (s - 1/s) + lmbda ln(J)/s + T = 0``, and across, ``mu (w - 1/w) + lmbda ln(J)/w = 0``,
    with ``J = s w^2``; `young` and `tension` in kPa. An incompressible one has ``mu (s - 1/s^2) + T = 0``.
    """
    lmbda, mu = lame(young, poisson)
    if np.isinf(lmbda):
        s = np.max(np.roots([mu, tension, 0.0, -mu]).real)  # the only positive root
        return float(s), float(1.0 / np.sqrt(s))

    def residual(v: np.ndarray) -> list[float]:
        s, w = np.exp(v)
        pressure = lmbda * np.log(s * w * w)
        return [(mu * (s * s - 1.0) + pressure + tension * s) / mu, (mu * (w * w - 1.0) + pressure) / mu]

    strain = tension / (3.0 * mu + tension)
    logarithms = root(residual, [-strain, 0.5 * poisson * strain], tol=1e-13).x
    return float(np.exp(logarithms[0])), float(np.exp(logarithms[1]))


def timoshenko_tip(design: Design) -> float:
    """Small tip deflection of a cantilever, ``F L^3 / (3 E I) + F L / (5/6 G A)`` [mm]; sections may curve across."""
    skeleton, load = design.skeleton, design.load
    assert skeleton is not None
    assert load is not None
    young, poisson = skeleton.material.young, skeleton.material.poisson
    shear = young / (2.0 * (1.0 + poisson))
    area = skeleton.beam_width * skeleton.beam_thickness
    length = skeleton.beam_length
    return load.tip_force * (length**3 / (3.0 * young * design.second_moment) + length / (5.0 / 6.0 * shear * area))


def error_estimate(states: Sequence[State], coarse: Sequence[State], ratio: float) -> list[dict[str, Any]]:
    """Error of the main numbers from the same states on a coarser mesh.

    Parameters
    ----------
    states, coarse
        On the run's mesh and on the coarser one.
    ratio
        How much coarser: ratio of the mean element sizes [1].

    Notes
    -----
    Richardson's extrapolation at first order, ``|fine - coarse| / (ratio - 1)``: the re-entrant corners limit the rate
    of global quantities to about one (twice the exponent 0.545 of a right-angled notch), whatever the element.
    """
    rows = []
    by_key = {s["key"]: s for s in coarse}
    scale = {name: max((abs(s[name]) for s in states if s.get(name) is not None), default=0.0) for name in _WITH_ERROR}
    for state in states:
        other = by_key.get(state["key"])
        if other is None or state["key"] == "rest":
            continue
        for name in _WITH_ERROR:
            value, before = state.get(name), other.get(name)
            # a state defined by its force has no error in the force; what is zero but for rounding has none to tell
            defined = name == "muscle_force_mN" and state["key"].startswith("force")
            if value is None or before is None or defined or abs(value) <= max(1e-6 * scale[name], 1e-9):
                continue
            error = abs(value - before) / (ratio - 1.0)
            rows.append(
                {
                    "state": state["label"], "quantity": name, "this mesh": value, "coarser mesh": before,
                    "estimated error": error, "relative_1": error / abs(value) if value else None,
                }
            )  # fmt: skip
    return rows


def _row(quantity: str, ours: float | None, printed: Printed) -> dict[str, Any]:
    return {
        "quantity": quantity,
        "ours": ours,
        "paper": printed.value,
        "deviation": printed.deviation,
        "unit": printed.unit,
        "difference": _minus(ours, printed.value),
        "relative_1": None if ours is None else (ours - printed.value) / printed.value,
        "source": printed.where,
    }


def _minus(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else a - b
