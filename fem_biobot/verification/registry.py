"""All verification cases in one table: those that the package has, and those that it does not have yet."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from fem_biobot.errors import DesignError
from fem_biobot.verification import (
    cardiac,
    contact,
    contact_sticking,
    cook,
    machine,
    muscle_and_spring,
    published_walker,
    rod_systems,
    rod_turned,
    rods,
    sliding,
    solid_driven,
    solid_fields,
    solid_machine,
    solid_moving,
    solid_states,
    two_models,
    walker,
)
from fem_biobot.verification.records import Case

# every case that there shall be, in order
IDS = (
    *(f"S{k}" for k in range(1, 16)),
    *(f"R{k}" for k in range(1, 10)),
    *(f"C{k}" for k in range(1, 9)),
    *(f"B{k}" for k in range(1, 4)),
)
_FAMILIES = (
    solid_states,
    solid_fields,
    cook,
    solid_machine,
    muscle_and_spring,
    cardiac,
    rods,
    rod_systems,
    rod_turned,
    contact,
    contact_sticking,
    walker,
    solid_moving,
    sliding,
    solid_driven,
    machine,
    two_models,
    published_walker,
)
CASES: dict[str, Case] = {
    case.id: case
    for case in sorted((case for family in _FAMILIES for case in family.CASES), key=lambda case: IDS.index(case.id))
}


def not_covered() -> tuple[str, ...]:
    """Cases that the package does not have yet."""
    return tuple(name for name in IDS if name not in CASES)


def chosen(names: Sequence[str]) -> tuple[Case, ...]:
    """Cases by their names, in the order of the table, each once; all if none is named.

    Raises
    ------
    DesignError
        An unknown name, or one that is not covered yet.
    """
    if not names:
        return tuple(CASES.values())
    wanted = [name.upper() for name in names]
    for given, name in zip(names, wanted, strict=True):
        if name in CASES:
            continue
        if name in IDS:
            raise DesignError(f"case {name}: not covered yet, expected one of {', '.join(CASES)}")
        near = difflib.get_close_matches(name, CASES, 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise DesignError(f"case: found {given!r}, expected one of {', '.join(CASES)}{hint}")
    return tuple(case for name, case in CASES.items() if name in wanted)
