"""What follows from how a muscle was seeded: the section and the tension that a design need not state then.

Called by `Design` when it is made, and by the reader of design files, so that a section ``[muscle.tissue]`` replaces
what a preset says and clashes with what stands beside it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from fem_biobot.design_parts import Tissue
from fem_biobot.errors import DesignError
from fem_biobot.muscle.compaction import compacted_section
from fem_biobot.muscle.maturation import tensions
from fem_biobot.units import format_quantity

FOLLOWING = {"junction_width": "mm", "junction_thickness": "mm", "passive_tension": "kPa", "active_tension": "kPa"}
_ROUNDING = 1e-9


def following(tissue: Tissue) -> dict[str, float]:
    """Width and thickness [mm], passive and active tension [kPa] of tissue, by key of the muscle."""
    width, thickness = compacted_section(tissue.seeded_width, tissue.seeded_depth, tissue.volume_kept)
    passive, active = tensions(tissue.days, tissue.seeding)
    return dict(zip(FOLLOWING, (width, thickness, passive, active), strict=True))


def without_following(muscle: Mapping[str, Any]) -> dict[str, Any]:
    """A muscle's values without those that follow from its tissue."""
    return {name: value for name, value in muscle.items() if name not in FOLLOWING}


def completed(data: Any) -> Any:
    """Values of a design with what follows from its ``[muscle.tissue]`` filled in; others as they are.

    Raises
    ------
    DesignError
        A value stated beside the tissue that is not the one that follows.
    """
    muscle = data.get("muscle") if isinstance(data, dict) else None
    tissue = muscle.get("tissue") if isinstance(muscle, dict) else None
    if not isinstance(muscle, dict) or tissue is None:
        return data
    try:
        values = following(tissue if isinstance(tissue, Tissue) else Tissue.model_validate(tissue))
    except (ValidationError, DesignError):
        # what is wrong with it is said in the words of its key when types and ranges are checked
        values = dict.fromkeys(FOLLOWING, 1.0)
        return {**data, "muscle": {**values, **muscle}}
    for name, value in values.items():
        given = muscle.get(name)
        if given is not None and not (isinstance(given, float) and math.isclose(given, value, rel_tol=_ROUNDING)):
            unit = FOLLOWING[name]
            found = format_quantity(given, unit, digits=6) if isinstance(given, float) else str(given)
            raise DesignError(
                f"muscle.{name}: found {found} beside muscle.tissue, from which "
                f"{format_quantity(value, unit, digits=6)} follows; expected one of the two"
            )
    return {**data, "muscle": {**muscle, **values}}


def at_rest(muscle: Any) -> str | None:
    """A line about what states at rest leave out of a muscle, None where that is nothing."""
    if getattr(muscle, "force_velocity", None) is None:
        return None
    return (
        "muscle.force_velocity: equilibria have no velocity, so that the stimulated tension is the isometric one "
        "there; walks have it"
    )


def told(muscle: Any) -> str | None:
    """A line about what followed from a muscle's tissue, None for one that was stated."""
    tissue = getattr(muscle, "tissue", None)
    if tissue is None:
        return None
    kept = "as deep as its trench" if tissue.volume_kept is None else f"{tissue.volume_kept:.3g} of its volume left"
    return (
        f"muscle.tissue: seeded with {tissue.seeding} {tissue.seeded_width:g} mm wide, {tissue.days:g} days, {kept}: "
        f"junction {muscle.junction_width:.4g} mm by {muscle.junction_thickness:.4g} mm, tension "
        f"{muscle.passive_tension:.4g} kPa passive, {muscle.active_tension:.4g} kPa active"
    )
