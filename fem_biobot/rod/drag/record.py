"""What a viscous medium does to rods and bodies that move in it: the record, and its lumps at the nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.rod.arrays import Drags
from fem_biobot.rod.atlas import Atlas
from fem_biobot.rod.drag.linear import LinearDrag
from fem_biobot.rod.element.arrays import Elements
from fem_biobot.rod.records import Array, Rod, Vector, _number, _set, vector

# length over radius from which a rod counts as slender
SLENDER = 10.0


@dataclass(frozen=True)
class Drag:
    """Resistance of a medium, among the loads of a model; at rest or in uniform motion, without walls.

    Parameters
    ----------
    viscosity
        Of the medium [kPa s]; water has 1e-6.
    velocity
        Of the medium, (3,) [mm/s].
    density
        Of the medium [kg/mm^3], for the part that grows with the square of the velocity; 0 leaves that out.
    rods
        Names of the rods that are dragged as slender bodies; by default all that `spheres` does not name.
    spheres
        Names of bodies and rods that are dragged as a sphere of their volume; by default all bodies with a volume.
    radius
        Of the slender rods [mm]; by default that of the circle of each section's area.
    rod_coefficient, sphere_coefficient
        Drag coefficients of the quadratic part [1], on the diameter of a rod and on the disc of a sphere. The defaults
        are those of a smooth cylinder across the flow and of a sphere at Reynolds numbers from 1e3 to 1e5.

    Notes
    -----
    *Rods.* Per reference length, with the velocity v relative to the medium, its part ``v_n`` across the tangent t, the
    rod's length L as drawn and radius r,

        f = -4 pi mu / ln(L/r) (I - t t^T / 2) v - (rho C r) |v_n| v_n,    m = -4 pi mu r^2 (t . omega) t

    The first term is slender-body theory of Stokes flow at its leading order (Cox 1970; in this form Gazzola, Dudte,
    McCormick and Mahadevan 2018), twice as large across the rod as along it: Reynolds numbers ``rho v r / mu`` far
    below 1, and ``ln(L/r)`` far above 1, since the relative error falls with that alone (a long cylinder has
    ``ln(L/r) + 0.15`` across and ``ln(L/r) - 0.90`` along, Tirado, Martinez and Garcia de la Torre 1984). Parts of one
    rod, and different rods, do not feel each other's flow. The second is the drag part of Morison, O'Brien, Johnson and
    Schaaf (1950) for Reynolds numbers far above 1, added as it stands; no added mass. The moment is that of a long
    cylinder that spins. All three are lumped at the rod's nodes like its mass.

    *Spheres.* An assumption for whatever is not slender: parts that move as one rigid part count as one sphere of their
    common volume about its centre, ``f = -6 pi mu R v - rho C pi R^2 / 2 |v| v`` and ``m = -8 pi mu R^3 omega``
    (Stokes 1851); a rod's sphere is spread over its length, without moment. A cube sinks 8 % slower than that sphere
    in Stokes flow (Pettyjohn and Christiansen 1948); a plate departs from it by more.

    Left out: walls (a foot near the ground is dragged more), flow made by one part at another, added mass.
    """

    viscosity: float
    velocity: Vector = (0.0, 0.0, 0.0)
    density: float = 0.0
    rods: Sequence[str] | None = None
    spheres: Sequence[str] | None = None
    radius: float | None = None
    rod_coefficient: float = 1.1
    sphere_coefficient: float = 0.44

    def __post_init__(self) -> None:
        for key in ("viscosity", "density", "rod_coefficient", "sphere_coefficient"):
            _number(f"drag: {key}", getattr(self, key), 0.0)
        vector("drag: velocity", self.velocity)
        if self.radius is not None:
            _number("drag: radius", self.radius, 0.0, open_low=True)
        for key in ("rods", "spheres"):
            names = getattr(self, key)
            if names is None:
                continue
            if isinstance(names, str) or not all(isinstance(name, str) for name in names):
                raise ModelError(f"drag: {key}: found {names!r}, expected a sequence of names")
            _set(self, **{key: tuple(names)})


def drag_lumps(loads: Sequence[object], atlas: Atlas, elements: Elements) -> Drags:
    """Resistances at the nodes of all drag records among the loads; refuses parts named twice or not slender."""
    rows: list[tuple[int, Array, Array, list[float], Array]] = []
    seen: set[str] = set()
    for drag in loads:
        if isinstance(drag, LinearDrag):
            rows += [(*row, np.zeros(3)) for row in _against_rest(drag, seen, atlas, elements)]
        if not isinstance(drag, Drag):
            continue
        spheres = [n for n, b in atlas.bodies.items() if b.volume > 0.0] if drag.spheres is None else drag.spheres
        rods = [name for name in atlas.rods if name not in spheres] if drag.rods is None else drag.rods
        for name in (*rods, *spheres):
            if name in seen:
                raise ModelError(f"drag: {name!r} is dragged twice, expected each part once")
            seen.add(name)
        u = np.array(drag.velocity, dtype=float)
        for name in rods:
            if name not in atlas.rods:
                known = ", ".join(atlas.rods) or "none"
                raise ModelError(f"drag: rods: no rod of the name {name!r}, expected one of: {known}")
            rows += [(*row, u) for row in _slender(drag, atlas.rods[name], atlas, elements)]
        for name in spheres:
            if name not in atlas.rods and name not in atlas.bodies:
                known = ", ".join([*atlas.bodies, *atlas.rods])
                raise ModelError(f"drag: spheres: no body or rod of the name {name!r}, expected one of: {known}")
        rows += [(*row, u) for row in _round(drag, spheres, atlas, elements)]
    d = len(rows)
    numbers = np.array([r[3] for r in rows], dtype=float).reshape(d, 5)
    along, across, quadratic, spin, tumble = (np.array(column) for column in numbers.T)
    return Drags(
        np.array([r[0] for r in rows], dtype=np.int64),
        np.array([r[1] for r in rows], dtype=float).reshape(d, 3),
        np.array([r[2] for r in rows], dtype=float).reshape(d, 3),
        along,
        across,
        quadratic,
        spin,
        tumble,
        np.array([r[4] for r in rows], dtype=float).reshape(d, 3),
    )


def _against_rest(
    drag: LinearDrag, seen: set[str], atlas: Atlas, elements: Elements
) -> list[tuple[int, Array, Array, list[float]]]:
    """Lumps without axis of a drag that knows no direction."""
    rows: list[tuple[int, Array, Array, list[float]]] = []
    for name in drag.rods:
        if name not in atlas.rods:
            known = ", ".join(atlas.rods) or "none"
            raise ModelError(f"linear drag: no rod of the name {name!r}, expected one of: {known}")
        if name in seen:
            raise ModelError(f"drag: {name!r} is dragged twice, expected each part once")
        seen.add(name)
        per_length = np.array([drag.force, drag.force, 0.0, drag.moment, drag.moment])
        shares = per_length[:, None] * _lengths(atlas.rods[name], atlas, elements) @ atlas.shares(name)
        rows += [(*atlas.locate((name, i)), np.zeros(3), share.tolist()) for i, share in enumerate(shares.T)]
    return rows


def _slender(drag: Drag, rod: Rod, atlas: Atlas, elements: Elements) -> list[tuple[int, Array, Array, list[float]]]:
    """Resistances along a rod, at its nodes: along, across, quadratic, about the axis, across it."""
    lengths = _lengths(rod, atlas, elements)
    r = np.array([np.sqrt(s.area / np.pi) if drag.radius is None else drag.radius for s in rod.sections])
    ratio = float(lengths.sum() / r.max())
    if ratio < SLENDER:
        raise ModelError(
            f"drag: rod {rod.name} is {ratio:.3g} times as long as its radius, expected at least {SLENDER:g} for a "
            "slender body (or name it among spheres)"
        )
    across = 4.0 * np.pi * drag.viscosity / np.log(lengths.sum() / r)
    per_length = np.array(
        [
            0.5 * across,
            across,
            drag.density * drag.rod_coefficient * r,
            4.0 * np.pi * drag.viscosity * r**2,
            np.zeros_like(r),
        ]
    )
    shares = per_length * lengths @ atlas.shares(rod.name)
    places = [atlas.locate((rod.name, i)) for i in range(len(lengths) + 1)]
    tangents = atlas.frames[rod.name][:, 2]
    return [(*place, t, share.tolist()) for place, t, share in zip(places, tangents, shares.T, strict=True)]


def _round(
    drag: Drag, names: Sequence[str], atlas: Atlas, elements: Elements
) -> list[tuple[int, Array, Array, list[float]]]:
    """One sphere for the bodies of each node, and those of rods, without axis."""
    volume: dict[int, float] = {}
    moment: dict[int, Array] = {}
    rows: list[tuple[int, Array, Array, list[float]]] = []
    for name in names:
        if name in atlas.bodies:
            body = atlas.bodies[name]
            if not body.volume > 0.0:
                raise ModelError(f"drag: body {name}: found volume 0 mm^3, expected one above 0 for a sphere")
            node, offset = atlas.locate((name, body.centre))
            volume[node] = volume.get(node, 0.0) + body.volume
            moment[node] = moment.get(node, np.zeros(3)) + body.volume * offset
            continue
        rod = atlas.rods[name]
        lengths = _lengths(rod, atlas, elements)
        areas = np.array([s.area for s in rod.sections])
        shares = lengths / lengths.sum() @ atlas.shares(name)
        for i, share in enumerate(shares):
            whole = _sphere(drag, float(areas @ lengths))
            rows.append((*atlas.locate((name, i)), np.zeros(3), [float(share) * c for c in (*whole[:3], 0.0, 0.0)]))
    for node, v in volume.items():
        rows.append((node, moment[node] / v, np.zeros(3), _sphere(drag, v)))
    return rows


def _sphere(drag: Drag, volume: float) -> list[float]:
    """Resistances of a sphere of the volume [mm^3]."""
    R = float(np.cbrt(0.75 * volume / np.pi))
    force = 6.0 * np.pi * drag.viscosity * R
    moment = 8.0 * np.pi * drag.viscosity * R**3
    return [force, force, 0.5 * drag.density * drag.sphere_coefficient * np.pi * R**2, moment, moment]


def _lengths(rod: Rod, atlas: Atlas, elements: Elements) -> Array:
    """Reference lengths of a rod's elements, (m,) [mm]."""
    begin = 0
    for each in atlas.rods.values():
        if each is rod:
            break
        begin += len(each.sections)
    return elements.length[begin : begin + len(rod.sections)]
