"""The lengths of a design read from a drawing: thin slices through its solids tell where beam and pillars are.

Speaks to the OpenCASCADE model that it is handed and imports no Gmsh, as `solids`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import MeshError

Array = NDArray[np.float64]
Entities = list[tuple[int, int]]

# thickness of a slice, over the drawing's longest edge
_THIN = 1e-4
# by which OpenCASCADE's boxes are wider than their bodies, on each side [mm]
_MARGIN = 1e-7
# of the height of the pillars below the beam: where they are looked for, until there are as many as asked for; fillets
# at the beam and rounded soles are out of the way of the first
_HEIGHTS = (0.5, 0.3, 0.15, 0.05)
# and where, if they do not reach the beam's ends there: tapered ones may do so under the beam
_UNDER = 0.02
# over the longest edge: pillars that differ by more are not alike
_ALIKE = 1e-3


def skeleton_lengths(occ: Any, file: str, solid: Entities, count: int) -> dict[str, float]:
    """Lengths of a skeleton of `count` pillars by the keys of a design, in the numbers of the drawing.

    Raises
    ------
    MeshError
        Something that a skeleton has is not there; the message says which key to give it with.
    """
    low, high = _box(occ, solid)
    long = float((high - low).max())
    middle = 0.5 * (low[0] + high[0])
    between = middle if count % 2 == 0 else middle + 0.25 * (high[0] - low[0]) / (count - 1)
    beam = _slices(occ, solid, 0, between, _THIN * long)
    if len(beam) != 1:
        raise MeshError(
            f"{file}: found {len(beam)} parts between the pillars at x = {between:.4g}, expected the beam alone"
        )
    (_, _, under), (_, _, top) = beam[0]
    if under - low[2] < _ALIKE * long:
        raise MeshError(f"{file}: found nothing below the beam, expected {count} pillars (z is up)")
    found: list[tuple[Array, Array]] = []
    for share in _HEIGHTS:
        found = _slices(occ, solid, 2, under - share * (under - low[2]), _THIN * long)
        if len(found) == count:
            break
    if len(found) != count:
        raise MeshError(
            f"{file}: found {len(found)} pillars below the beam, expected {count}; "
            f"if it has others, say so with --set skeleton.pillar_count={max(len(found), 2)}"
        )
    found.sort(key=lambda box: float(box[0][0]))
    if max(found[0][0][0] - low[0], high[0] - found[-1][1][0]) > _ALIKE * long:
        under_beam = _slices(occ, solid, 2, under - _UNDER * (under - low[2]), _THIN * long)
        if len(under_beam) == count:
            found = sorted(under_beam, key=lambda box: float(box[0][0]))
    lengths = np.array([b - a for a, b in found])
    for axis, key in ((0, "pillar_length"), (1, "pillar_width")):
        if np.ptp(lengths[:, axis]) > _ALIKE * long:
            told = ", ".join(f"{value:.4g}" for value in lengths[:, axis])
            raise MeshError(f"{file}: found pillars of {told}, expected one skeleton.{key} for all; give it with --set")
    soles = [_sole(occ, solid, a, b, low[2], under) for a, b in found]
    axis = 0.5 * (under + top)
    if soles[0] < soles[-1] - _ALIKE * long:
        raise MeshError(
            f"{file}: the longer pillar is at the lower x, expected x to run from the short to the long pillar: turn it"
        )
    ends = np.array([found[0][0][0] - low[0], high[0] - found[-1][1][0]])
    if np.abs(ends).max() > _ALIKE * long:
        raise MeshError(
            f"{file}: the beam reaches {ends[0]:.4g} and {ends[1]:.4g} beyond its pillars, expected pillars at its ends"
        )
    return {
        "skeleton.beam_length": float(high[0] - low[0]),
        "skeleton.beam_width": float(beam[0][1][1] - beam[0][0][1]),
        "skeleton.beam_thickness": float(top - under),
        "skeleton.pillar_length": float(lengths[:, 0].mean()),
        "skeleton.pillar_width": float(lengths[:, 1].mean()),
        "skeleton.short_pillar_height": float(axis - soles[0]),
        "skeleton.long_pillar_height": float(axis - soles[-1]),
    }


def muscle_lengths(occ: Any, file: str, solid: Entities, skeleton: Entities, *, looped: bool) -> dict[str, float]:
    """Lengths of a muscle in the frame of its skeleton, by the keys of a design; `looped` for one ring round all."""
    low, high = _box(occ, solid)
    base, _ = _box(occ, skeleton)
    long = float((high - low).max())
    outer = float(base[0] - low[0])
    if not outer > _ALIKE * long:
        raise MeshError(f"{file}: found no muscle beyond the pillars' outer faces, expected rings round them")
    found = {"muscle.ring_thickness": outer, "muscle.ring_height": float(high[2] - low[2])}
    middle = 0.5 * (low[2] + high[2]) - base[2]
    if looped:
        return found | {"muscle.junction_height": float(middle), "muscle.ring_offset": 0.0}
    junction = _slices(occ, solid, 0, 0.5 * (low[0] + high[0]), _THIN * long)
    if len(junction) != 1:
        raise MeshError(f"{file}: found {len(junction)} junctions at mid-span, expected one")
    (_, y0, z0), (_, y1, z1) = junction[0]
    height = 0.5 * (z0 + z1) - base[2]
    return found | {
        "muscle.junction_width": float(y1 - y0),
        "muscle.junction_thickness": float(z1 - z0),
        "muscle.junction_height": float(height),
        "muscle.ring_offset": float(middle - height),
    }


def _box(occ: Any, solid: Entities) -> tuple[Array, Array]:
    corners = np.array([occ.getBoundingBox(*entity) for entity in solid])
    return corners[:, :3].min(axis=0) + _MARGIN, corners[:, 3:].max(axis=0) - _MARGIN


def _slices(occ: Any, solid: Entities, axis: int, at: float, thin: float) -> list[tuple[Array, Array]]:
    """Boxes of what a thin slice normal to an axis cuts out of solids, which stay as they are."""
    low, high = _box(occ, solid)
    start, size = low - thin, high - low + 2.0 * thin
    start[axis], size[axis] = at - 0.5 * thin, thin
    return _within(occ, solid, start, size)


def _within(occ: Any, solid: Entities, start: Array, size: Array) -> list[tuple[Array, Array]]:
    tool = [(3, occ.addBox(*start, *size))]
    cut, _ = occ.intersect(occ.copy(solid), tool)
    found = [_box(occ, [entity]) for entity in cut if entity[0] == 3]
    occ.remove(cut, recursive=True)
    return found


def _sole(occ: Any, solid: Entities, low: Array, high: Array, bottom: float, under: float) -> float:
    """Lowest z of a pillar between its sides."""
    start = np.array([low[0], low[1], bottom - (under - bottom)])
    size = np.array([high[0] - low[0], high[1] - low[1], 2.0 * (under - bottom)])
    return min(float(a[2]) for a, _ in _within(occ, solid, start, size))
