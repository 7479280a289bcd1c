"""The interactive views of a run: a body through its states, rods through time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fem_biobot.view.interactive import Coloured, Moving
from fem_biobot.view.machine import GEL, MUSCLE, STRESS_COLOURS, STRETCH_COLOURS, Machine, Shape
from fem_biobot.vtk import boundary_surface

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

GROUND = "#d5dadd"
_PERCENT = 99.0  # where the colours of a stress end: at a sharp corner it grows without bound


def machine_view(
    machine: Machine, shapes: Sequence[Shape], *, title: str, shown: int = -1, caption: str = "", from_rest: bool = True
) -> Moving:
    """A body in its states, coloured by stress, displacement and the muscle's stretch.

    Parameters
    ----------
    machine
        The undeformed body.
    shapes
        States in order; fields as `Shape` has them, the same ones in all.
    title, shown, caption
        As of `Moving`; a sentence about the states is added to the caption.
    from_rest
        Whether the first state is the body at rest, from which displacement counts and is exaggerated.
    """
    cells, of_muscle = machine.split[1], machine.of_muscle
    # each region closed, so that one can be looked at without the other
    regions = [cells[:, machine.muscle == inside] for inside in (False, True) if np.any(machine.muscle == inside)]
    triangles = np.hstack([boundary_surface(region) for region in regions])
    names = [
        name for name, there in (("hydrogel", not machine.muscle.all()), ("muscle", machine.muscle.any())) if there
    ]
    part = of_muscle.astype(np.int64) if len(names) == 2 else np.zeros(of_muscle.size, dtype=np.int64)
    points = np.array([machine.placed(shape) for shape in shapes])
    outer = np.unique(machine.surface)
    fields = []
    if all(shape.von_mises is not None for shape in shapes):
        values = np.array([machine.nodal(np.asarray(shape.von_mises)) for shape in shapes])
        fields.append(stress_field("von Mises Cauchy stress [kPa]", values, values[:, outer]))
    moved = np.linalg.norm(points - points[0], axis=1)
    if from_rest and moved.max() > 0.0:
        fields.append(Coloured("displacement [mm]", moved, (0.0, float(moved.max())), "viridis"))
    if machine.muscle.any() and all(shape.fibre_stretch is not None for shape in shapes):
        values = np.array([machine.nodal(np.asarray(shape.fibre_stretch), muscle_only=True) for shape in shapes])
        values[:, ~of_muscle] = np.nan
        low, high = np.percentile(values[:, of_muscle], [1.0, 99.0])
        fields.append(Coloured("fibre stretch [1]", values, _apart(float(low), float(high)), STRETCH_COLOURS))
    return Moving(
        title,
        points,
        triangles,
        part,
        {name: MUSCLE if name == "muscle" else GEL for name in names},
        [shape.label for shape in shapes],
        edges=machine.edges,
        fields=fields,
        caption=f"{caption} To scale unless exaggerated; from one state to the next along straight lines.".strip(),
        shown=shown,
        exaggerated=bool(from_rest and moved.max() > 0.0),
    )


def side_by_side(first: Moving, second: Moving, *, title: str, words: tuple[str, str], label: str) -> Moving:
    """Two views of the same states as one, the second behind the first, under one colour bar.

    Parameters
    ----------
    first, second
        With a stress as their first field.
    title
        Of the whole.
    words
        Put before the parts' names.
    label
        Of the stress of both, with its unit.
    """
    n, count = first.points.shape[2], len(first.parts)
    # a fifth of the first one's width between them
    across = first.points[:, 1]
    away = np.array([0.0, across.max() + 0.2 * np.ptp(across) - second.points[:, 1].min(), 0.0])
    stress = np.hstack([view.fields[0].values for view in (first, second)])
    both = zip(words, (first, second), strict=True)
    return Moving(
        title,
        np.concatenate([first.points, second.points + away[:, None]], axis=2),
        np.hstack([first.triangles, second.triangles + n]),
        np.concatenate([first.part, second.part + count]),
        {f"{word} {name}": colour for word, view in both for name, colour in view.parts.items()},
        first.labels,
        edges=np.hstack([first.edges, second.edges + n]),
        fields=[stress_field(label, stress, stress)],
        caption="To scale; from one state to the next along straight lines.",
        shown=first.shown,
    )


def stress_field(label: str, values: Array, seen: Array) -> Coloured:
    """A stress from zero to the 99th percentile of what is seen of it."""
    there = seen[np.isfinite(seen)]
    top, high = float(there.max()), float(np.percentile(there, _PERCENT))
    high = high if high > 0.0 else max(top, 1.0)
    note = f"colours end at the 99th percentile; highest shown {top:.3g} kPa" if top > high else ""
    return Coloured(label, values, (0.0, high), STRESS_COLOURS, note)


def _apart(low: float, high: float) -> tuple[float, float]:
    """Limits that differ."""
    half = max((high - low) / 2.0, 1e-6 * max(abs(low), abs(high), 1.0))
    middle = (low + high) / 2.0
    return middle - half, middle + half
