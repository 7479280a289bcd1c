"""The machine as closed forms bend it, to turn: its boxes, bays as arcs, pillars rigid, the muscle strung between them.

Drawn from the layout alone, so that a check needs neither a mesh nor a solve for it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.mesh.layout import Box, Layout, layout
from fem_biobot.study.bow import Bow, bow
from fem_biobot.study.outputs import standing
from fem_biobot.view.interactive import Coloured, Moving
from fem_biobot.view.machine import GEL, MUSCLE

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# pieces along a beam or a muscle
_PIECES = 48


def bow_view(design: Design) -> Moving:
    """A bot at rest, in its passive state and at full drive, as `bow` has them.

    Coloured by the strain along the machine: of the beam by bending, of the muscle its shortening.
    """
    plan = layout(design)
    shells = [_shell(box) for box in _boxes(plan)]
    drives = {"passive": 0.0, "full drive": design.drive.amplitude}
    bows = {f"{name}, {found.force:.3g} mN": found for name, found in ((k, bow(design, d)) for k, d in drives.items())}
    drawn = np.hstack([shell for shell, _, _ in shells])
    states, strains = [drawn], [np.zeros(drawn.shape[1])]
    for found in bows.values():
        placed, strain = zip(
            *(_bent(design, plan, found, k, shell) for k, (shell, _, _) in enumerate(shells)), strict=True
        )
        states.append(np.hstack(placed))
        strains.append(np.concatenate(strain))
    counts = [shell.shape[1] for shell, _, _ in shells]
    first = np.cumsum([0, *counts[:-1]])
    n_gel = 1 + len(plan.pillars)
    values = np.array(strains)
    low, high = float(values.min()), float(values.max())
    return Moving(
        "The machine as the closed forms bend it",
        np.array([standing(x) for x in states]),
        np.hstack([triangles + k for (_, triangles, _), k in zip(shells, first, strict=True)]),
        np.repeat([int(k >= n_gel) for k in range(len(shells))], counts),
        {"hydrogel": GEL, "muscle": MUSCLE},
        ["at rest", *bows],
        edges=np.hstack([edges + k for (_, _, edges), k in zip(shells, first, strict=True)]),
        fields=[Coloured("strain along the machine [1]", values, (low, high), "viridis")] if high > low else [],
        caption="Beam as an arc, pillars and rings rigid, junctions straight: what is judged, no solution. To scale.",
        exaggerated=True,
    )


def _boxes(plan: Layout) -> list[Box]:
    """Beam, pillars, then the muscle without its holes: each ring as its four sides."""
    assert plan.beam is not None
    found = [plan.beam, *plan.pillars]
    for box in plan.muscle:
        hole = None if box in plan.thin else next((h for h in plan.holes if box.low[0] < h.low[0] < box.high[0]), None)
        found += [box] if hole is None else _sides(box, hole)
    return found


def _sides(box: Box, hole: Box) -> list[Box]:
    """What is left of a box around a hole that goes through it from below."""
    (x0, y0, z0), (x1, y1, z1) = box.low, box.high
    (a0, b0, _), (a1, b1, _) = hole.low, hole.high
    return [
        Box((x0, y0, z0), (a0, y1, z1)),
        Box((a1, y0, z0), (x1, y1, z1)),
        Box((a0, y0, z0), (a1, b0, z1)),
        Box((a0, b1, z0), (a1, y1, z1)),
    ]


def _shell(box: Box) -> tuple[Array, Ints, Ints]:
    """Points (3, n), triangles (3, f) seen from outside and edges (2, s) of a box's surface, divided along x."""
    x = np.linspace(box.low[0], box.high[0], _PIECES + 1)
    y, z = (box.low[1], box.high[1]), (box.low[2], box.high[2])
    corners = [(y[0], z[0]), (y[1], z[0]), (y[1], z[1]), (y[0], z[1])]
    points = np.array([[x, np.full_like(x, b), np.full_like(x, c)] for b, c in corners])  # (corner, axis, k)
    n = x.size
    triangles, edges = [], []
    for k in range(4):
        a, b = k * n + np.arange(_PIECES), (k + 1) % 4 * n + np.arange(_PIECES)
        triangles += [np.stack([a, b, b + 1]), np.stack([a, b + 1, a + 1])]
        edges.append(np.stack([a, a + 1]))
    for at in (0, n - 1):
        ring = np.arange(4) * n + at
        order = ring[::-1] if at == 0 else ring
        triangles.append(np.array([[order[0], order[0]], [order[1], order[2]], [order[2], order[3]]]))
        edges.append(np.stack([ring, np.roll(ring, -1)]))
    return points.swapaxes(0, 1).reshape(3, -1), np.hstack(triangles), np.hstack(edges)


def _bent(design: Design, plan: Layout, found: Bow, number: int, points: Array) -> tuple[Array, Array]:
    """Positions (3, n) and strains along the machine (n,) of box `number` of `_boxes` under a bow."""
    axis = _Axis(design, plan, found)
    count = len(plan.pillars)
    if number == 0:
        return axis.carried(points), axis.strain(points)
    nothing = np.zeros(points.shape[1])
    if number <= count:
        return axis.rigid(points, number - 1), nothing
    # rings go with their pillar; what reaches from pillar to pillar is strung between them
    low, high = float(points[0].min()), float(points[0].max())
    near = [k for k, p in enumerate(plan.pillars) if (low < p.high[0] and p.low[0] < high) or _beside(p, low, high)]
    if len(near) == 1:
        return axis.rigid(points, near[0]), nothing
    left = np.clip(np.searchsorted([p.high[0] for p in plan.pillars], points[0]), 0, count - 1)
    placed, strain = np.empty_like(points), nothing
    for k, pillar in enumerate(plan.pillars):
        own = (left == k) & (points[0] >= pillar.low[0] if k else np.ones_like(left, dtype=bool))
        placed[:, own] = axis.rigid(points[:, own], k)
    for k, (a, b) in enumerate(pairwise(plan.pillars)):
        own = (points[0] > a.high[0]) & (points[0] < b.low[0])
        t = (points[0, own] - a.high[0]) / (b.low[0] - a.high[0])
        placed[:, own] = (1.0 - t) * axis.rigid(points[:, own], k, a.high[0]) + t * axis.rigid(
            points[:, own], k + 1, b.low[0]
        )
        strain[own] = -found.shortening
    last = points[0] > plan.pillars[-1].high[0]
    placed[:, last] = axis.rigid(points[:, last], count - 1)
    return placed, strain


def _beside(pillar: Box, low: float, high: float) -> bool:
    """Whether a box along x touches a pillar's side from outside."""
    return abs(low - pillar.high[0]) < 1e-9 or abs(high - pillar.low[0]) < 1e-9


class _Axis:
    """The beam's axis: arcs in the bays, straight over the pillars, level in its middle."""

    def __init__(self, design: Design, plan: Layout, found: Bow) -> None:
        self.height, self.found = design.beam_axis_height, found
        self.pillars, self.bay = plan.pillars, design.bay
        bays = [(p.high[0], q.low[0]) for p, q in pairwise(plan.pillars)]
        assert plan.beam is not None
        ends = sorted({plan.beam.low[0], plan.beam.high[0], *(x for bay in bays for x in bay), 0.0})
        self.x = np.array(ends)
        middles = (self.x[1:] + self.x[:-1]) / 2.0
        inside = np.array([any(a < m < b for a, b in bays) for m in middles])
        self.curvature = np.where(inside, 2.0 * found.half_angle / design.bay, 0.0)
        # downward turn of the axis along x, none in the middle
        angle = np.concatenate([[0.0], np.cumsum(self.curvature * np.diff(self.x))])
        self.angle = angle - np.interp(0.0, self.x, angle)
        steps = [_arc(self.angle[k], self.curvature[k], d) for k, d in enumerate(np.diff(self.x))]
        place = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)])
        self.place = place - place[int(np.flatnonzero(self.x == 0.0)[0])]

    def at(self, x: Array) -> tuple[Array, Array, Array]:
        """Along, up and angle of the axis at drawn places, (n,) each."""
        k = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.curvature) - 1)
        d = x - self.x[k]
        step = np.array([_arc(a, c, s) for a, c, s in zip(self.angle[k], self.curvature[k], d, strict=True)])
        return self.place[k, 0] + step[:, 0], self.place[k, 1] + step[:, 1], self.angle[k] + self.curvature[k] * d

    def carried(self, points: Array) -> Array:
        """Points that follow the axis below or above which they were drawn."""
        along, up, angle = self.at(points[0])
        off = points[2] - self.height
        return np.array([along + off * np.sin(angle), points[1], self.height + up + off * np.cos(angle)])

    def rigid(self, points: Array, pillar: int, x: float | None = None) -> Array:
        """Points that go with a pillar, as if they all were drawn at `x` where that is given."""
        p = self.pillars[pillar]
        centre = 0.5 * (p.low[0] + p.high[0])
        along, up, angle = (float(v[0]) for v in self.at(np.array([centre])))
        a, off = (points[0] if x is None else np.full(points.shape[1], x)) - centre, points[2] - self.height
        s, c = np.sin(angle), np.cos(angle)
        return np.array([along + a * c + off * s, points[1], self.height + up - a * s + off * c])

    def strain(self, points: Array) -> Array:
        """Of the beam's fibres: longer above the axis, compressed in the mean."""
        along = np.array([any(p.high[0] <= x <= q.low[0] for p, q in pairwise(self.pillars)) for x in points[0]])
        return np.where(along, 2.0 * self.found.half_angle / self.bay * (points[2] - self.height), 0.0)


def _arc(angle: float, curvature: float, length: float) -> tuple[float, float]:
    """Along and up from the beginning of an arc that turns downward."""
    middle = angle + 0.5 * curvature * length
    half = 0.5 * curvature * length
    chord = length * (np.sin(half) / half if abs(half) > 1e-9 else 1.0)
    return chord * np.cos(middle), -chord * np.sin(middle)
