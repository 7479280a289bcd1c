"""Work of the muscle along the states of a job."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from fem_biobot.design import Design
from fem_biobot.solid.measures import muscle_work
from fem_biobot.study.plan import Found, Solver


def add_work(design: Design, solver: Solver, found: Sequence[Found], states: Sequence[dict[str, Any]]) -> str:
    """Put the work of the muscle into the measures of each state, from the unstressed body; for remodelled tissue from
    its own passive state.

    Parameters
    ----------
    design, solver
        Of the job.
    found, states
        What was solved, and its measures, which gain ``muscle_work_uJ`` (None where there is no energy).

    Returns
    -------
    str
        Why there is none; empty where there is.
    """
    for state in states:
        state["muscle_work_uJ"] = 0.0
    if design.muscle is None:
        return ""
    rows = [
        (f.wanted.reference, f.state.step.tension, solver.measurer.tension_length(f.state), s)
        for f, s in zip(found, states, strict=True)
    ]
    if any(math.isnan(length) for _, _, length, _ in rows):
        for state in states:
            state["muscle_work_uJ"] = None
        plain = design.muscle.convention not in ("cauchy", "active_strain")
        why = "a tension whose parts differ" if plain else f"muscle.convention {design.muscle.convention}"
        return f"muscle work: left out, with {why} there is no energy in proportion to the tension"
    path = sorted((r for r in rows if r[0] == "as_moulded" and r[1] > 0.0), key=lambda row: row[1])
    for (_, _, _, state), work in zip(path, muscle_work([r[1] for r in path], [r[2] for r in path]), strict=True):
        state["muscle_work_uJ"] = work
    other = [r for r in rows if r[0] == "remodelled"]
    for (_, before, length, _), (_, tension, length_now, state) in pairwise(other):
        state["muscle_work_uJ"] = -0.5 * (before + tension) * (length_now - length)
    return ""
