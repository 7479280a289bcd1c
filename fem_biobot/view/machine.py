"""The pictures of a run: which scenes show a machine at rest, under its standing tension, and contracted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fem_biobot.view.scene import Bar, Inset, Layer, Panel, Picture
from fem_biobot.view.surface import feature_edges
from fem_biobot.vtk import boundary_surface, nodal_mean, nodal_mean_of_nodes, split_by_region

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

GEL, MUSCLE, GHOST, FLOOR, SHADOW = "#b7c6d4", "#c8473c", "#aab3bb", "#f3f5f6", "#e1e5e8"
EDGE, FAINT_EDGE = "#2b3137", "#7d8a96"
STRESS_COLOURS, STRETCH_COLOURS, FIBRE_STRESS_COLOURS = "stress", "viridis", "plasma"


@dataclass(frozen=True)
class Shape:
    """One state of a machine, for pictures.

    Attributes
    ----------
    key
        Short word for file names, such as ``passive``.
    label
        What the reader is told, such as ``passive, 9.09 kPa``.
    displacement
        At the nodes, (3, n) [mm].
    von_mises, fibre_stretch, fibre_stress
        Element means (e,), or what each element says at its own nodes (b, e) [kPa, 1, kPa]; the fibre fields are read
        on the muscle only. None leaves their pictures out.
    """

    key: str
    label: str
    displacement: Array
    von_mises: Array | None = None
    fibre_stretch: Array | None = None
    fibre_stress: Array | None = None


@dataclass(frozen=True)
class Machine:
    """A body to draw: quadratic (or linear) tetrahedra with named regions.

    Attributes
    ----------
    points
        Reference positions of the nodes, (3, n) [mm].
    cells
        Nodes of each element in VTK's order, (10, e) or (4, e).
    regions
        Name to element numbers; ``muscle`` is red, everything else gel.
    name
        For titles.
    ground
        Whether to draw the ground at z = 0 or, where the body reaches below, under it.
    focus
        Reference point that stress pictures magnify, such as the re-entrant corner at a pillar [mm]; none for no inset.
    """

    points: Array
    cells: Ints
    regions: Mapping[str, Ints] = field(default_factory=dict)
    name: str = ""
    ground: bool = True
    focus: tuple[float, float, float] | None = None

    @cached_property
    def muscle(self) -> NDArray[np.bool_]:
        """Which elements are muscle, (e,)."""
        mask = np.zeros(self.cells.shape[1], dtype=bool)
        mask[self.regions.get("muscle", np.zeros(0, dtype=np.int64))] = True
        return mask

    @cached_property
    def split(self) -> tuple[Ints, Ints]:
        """Node map and cells with nodes doubled between muscle and gel."""
        return split_by_region(self.cells, self.muscle.astype(np.int64), n_points=self.points.shape[1])

    @cached_property
    def volumes(self) -> Array:
        """Volume of each straight-sided element, (e,) [mm^3]."""
        corner = self.points[:, self.cells[:4]]
        return np.linalg.det((corner[:, 1:] - corner[:, :1]).transpose(2, 0, 1)) / 6.0

    @cached_property
    def surface(self) -> Ints:
        """Outer triangles of the whole body on the doubled nodes, (3, f)."""
        return boundary_surface(self.split[1], node_map=self.split[0])

    @cached_property
    def of_muscle(self) -> NDArray[np.bool_]:
        """Which of the doubled nodes belong to muscle, (m,)."""
        mask = np.zeros(self.split[0].size, dtype=bool)
        mask[self.split[1][:, self.muscle]] = True
        return mask

    @cached_property
    def edges(self) -> Ints:
        """Edges of the undeformed body and outline of the muscle on it, (2, s)."""
        node_map = self.split[0]
        group = self.of_muscle[self.surface[0]].astype(np.int64)
        return feature_edges(self.points[:, node_map], self.surface, node_map=node_map, group=group)

    @cached_property
    def muscle_surface(self) -> tuple[Ints, Ints]:
        """Outer triangles of the muscle alone and its edges."""
        triangles = boundary_surface(self.split[1][:, self.muscle])
        return triangles, feature_edges(self.points[:, self.split[0]], triangles)

    def placed(self, shape: Shape | None) -> Array:
        """Positions of the doubled nodes in a state, (3, m) [mm]."""
        points = self.points if shape is None else self.points + shape.displacement
        return points[:, self.split[0]]

    def nodal(self, values: Array, *, muscle_only: bool = False) -> Array:
        """Element values carried to the doubled nodes, (m,), without mixing muscle and gel."""
        where = self.muscle if muscle_only else np.ones(self.muscle.size, dtype=bool)
        cells, weights = self.split[1][:, where], self.volumes[where]
        own = np.asarray(values)[..., where]
        carry = nodal_mean if own.ndim == 1 else nodal_mean_of_nodes
        return carry(cells, own, weights=weights, n_points=self.split[0].size)


def machine_pictures(machine: Machine, shapes: Sequence[Shape]) -> list[Picture]:
    """The pictures of a run.

    ``machine`` shows the parts, ``shapes`` the machine at rest and in every state from the front, ``von_mises_<key>``
    every state that has this field (on one colour bar, so they compare by eye), ``fibre_stretch`` and ``fibre_stress``
    the muscle in the last state that has them.

    Parameters
    ----------
    machine
        The undeformed body.
    shapes
        States in order, usually passive and stimulated; displacements are drawn to scale.
    """
    pictures = [_parts(machine), _fronts(machine, shapes)]
    pictures += _von_mises(machine, [s for s in shapes if s.von_mises is not None])
    if machine.muscle.any():
        for kind, label, colours in (
            ("fibre_stretch", "fibre stretch [1]", STRETCH_COLOURS),
            ("fibre_stress", "Cauchy stress along the fibre [kPa]", FIBRE_STRESS_COLOURS),
        ):
            pictures += _muscle(machine, shapes, kind, label, colours)
    return pictures


def _title(machine: Machine, text: str) -> str:
    return f"{machine.name}: {text}" if machine.name else text[:1].upper() + text[1:]


def _ghost(machine: Machine) -> Layer:
    """Outline of the undeformed body."""
    return Layer(machine.placed(None), edges=machine.edges, edge_colour=GHOST, edge_width=0.8)


def _ground(machine: Machine, drawn: Array) -> list[Layer]:
    """A floor under the body and the body's shadow on it."""
    if not machine.ground:
        return []
    triangles = machine.surface
    used = drawn[:, np.unique(triangles)]
    level = min(0.0, float(used[2].min())) - 1e-3 * float(np.ptp(used[0]))
    low, high = used[:2].min(axis=1), used[:2].max(axis=1)
    pad = 0.10 * float(np.max(high - low))
    (x0, y0), (x1, y1) = low - pad, high + pad
    floor = np.array([[x0, x1, x1, x0], [y0, y0, y1, y1], [level] * 4])
    shadow = drawn.copy()
    shadow[2] = level + 1e-3 * float(np.ptp(used[0]))
    return [
        Layer(floor, np.array([[0, 0], [1, 2], [2, 3]]), colour=FLOOR, lit=False),
        Layer(shadow, triangles, colour=SHADOW, lit=False),
    ]


def _ground_line(machine: Machine, widest: Array) -> list[Layer]:
    """The ground as the front view sees it: a line at z = 0."""
    if not machine.ground:
        return []
    low, high = float(widest[0].min()), float(widest[0].max())
    pad = 0.03 * (high - low)
    y = float(widest[1].min())
    ends = np.array([[low - pad, high + pad], [y, y], [0.0, 0.0]])
    return [Layer(ends, edges=np.array([[0], [1]]), edge_colour=FAINT_EDGE, edge_width=1.0)]


def _region_layers(machine: Machine, drawn: Array, *, gel_opacity: float) -> list[Layer]:
    """The body in the colours of its parts; a translucent gel shows the muscle behind it."""
    mine = machine.of_muscle[machine.surface[0]]
    gel, muscle = machine.surface[:, ~mine], machine.surface[:, mine]
    if gel_opacity < 1.0 and machine.muscle.any():
        muscle = machine.muscle_surface[0]
    return [
        Layer(drawn, muscle, colour=MUSCLE),
        Layer(drawn, gel, colour=GEL, opacity=gel_opacity),
        Layer(drawn, edges=machine.edges, edge_colour=EDGE, edge_width=0.9),
    ]


def _legend(machine: Machine) -> list[tuple[str, str]]:
    entries = [("muscle", MUSCLE)] if machine.muscle.any() else []
    return [("hydrogel", GEL), *entries] if not machine.muscle.all() else entries


def _parts(machine: Machine) -> Picture:
    drawn = machine.placed(None)
    layers = [*_ground(machine, drawn), *_region_layers(machine, drawn, gel_opacity=0.55)]
    return Picture("machine", _title(machine, "undeformed"), [Panel(layers, "iso")], legend=_legend(machine))


def _fronts(machine: Machine, shapes: Sequence[Shape]) -> Picture:
    """Rest and every state from the front, on one scale."""
    everything = np.hstack([machine.placed(shape) for shape in (None, *shapes)])
    line = _ground_line(machine, everything)
    rest = machine.placed(None)
    panels = [Panel([*line, *_region_layers(machine, rest, gel_opacity=1.0)], "front", "at rest")]
    for shape in shapes:
        layers = [*line, _ghost(machine), *_region_layers(machine, machine.placed(shape), gel_opacity=1.0)]
        panels.append(Panel(layers, "front", f"{shape.label} (outline: at rest)"))
    title = _title(machine, "front view, deformation to scale" if shapes else "front view")
    return Picture("shapes", title, panels, legend=_legend(machine))


def _limits(values: Array, *, robust: bool = False) -> tuple[tuple[float, float], float]:
    """Limits that differ, and the true maximum; `robust` ends at the 99th percentile and starts at zero."""
    top = float(np.max(values))
    if robust:
        high = float(np.percentile(values, 99.0))
        return (0.0, high if high > 0.0 else max(top, 1.0)), top
    low = float(np.min(values))
    middle = (low + top) / 2.0
    half = max((top - low) / 2.0, 1e-3 * abs(middle), 1e-6)
    return (middle - half, middle + half), top


def _von_mises(machine: Machine, shapes: Sequence[Shape]) -> list[Picture]:
    """The whole machine coloured by von Mises stress, with a look at the muscle's end where stress gathers."""
    nodal = [machine.nodal(shape.von_mises) for shape in shapes if shape.von_mises is not None]
    if not nodal:
        return []
    shown = np.unique(machine.surface)
    limits, top = _limits(np.concatenate([values[shown] for values in nodal]), robust=True)
    note = f"colours end at the 99th percentile; highest shown {top:.3g} kPa"
    bar = Bar("von Mises Cauchy stress [kPa]", limits, STRESS_COLOURS, note, "max" if top > limits[1] else "neither")
    pictures = []
    for shape, values in zip(shapes, nodal, strict=True):
        drawn = machine.placed(shape)
        body = Layer(drawn, machine.surface, values=values, edges=machine.edges, edge_colour=EDGE, edge_width=0.8)
        layers = [*_ground(machine, drawn), _ghost(machine), body]
        title = _title(machine, f"von Mises stress, {shape.label}")
        panel = Panel(layers, "iso", inset=_inset(machine, body))
        pictures.append(Picture(f"von_mises_{shape.key}", title, [panel], bar))
    return pictures


def _inset(machine: Machine, body: Layer) -> Inset | None:
    """A look from below at the point of interest, carried along by the deformation."""
    if machine.focus is None:
        return None
    rest = machine.placed(None)
    nearest = int(np.argmin(np.linalg.norm(rest - np.array(machine.focus)[:, None], axis=0)))
    x, y, z = (float(v) for v in body.points[:, nearest])
    return Inset([body], (x, y, z), 0.16 * float(np.ptp(rest[0])), "from below")


def _muscle(machine: Machine, shapes: Sequence[Shape], kind: str, label: str, colours: str) -> list[Picture]:
    """The muscle alone in the last state that has this fibre field, the rest of the machine as an outline."""
    known = [(shape, getattr(shape, kind)) for shape in shapes if getattr(shape, kind) is not None]
    if not known:
        return []
    shape, field_values = known[-1]
    values, drawn = machine.nodal(field_values, muscle_only=True), machine.placed(shape)
    triangles, edges = machine.muscle_surface
    shown = values[np.unique(triangles)]
    limits, _ = _limits(np.percentile(shown, [1.0, 99.0]))
    note = f"colours span the 1st to the 99th percentile; shown {shown.min():.3g} to {shown.max():.3g}"
    bar = Bar(label, limits, colours, note, "both")
    outline = Layer(drawn, edges=machine.edges, edge_colour=GHOST, edge_width=0.8)
    body = Layer(drawn, triangles, values=values, edges=edges, edge_colour=EDGE, edge_width=0.8)
    title = _title(machine, f"{kind.replace('_', ' ')} in the muscle, {shape.label}")
    return [Picture(kind, title, [Panel([outline, body], "iso")], bar)]
