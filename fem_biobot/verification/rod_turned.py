"""R9: an assembly of everything that rods have, drawn a second time turned and moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem_biobot import (
    Body,
    DistributedLoad,
    Gravity,
    Hinge,
    Hold,
    Muscle,
    PointLoad,
    Rigid,
    RodModel,
    RodState,
    Spring,
    statics,
)
from fem_biobot.verification.blocks import rotation
from fem_biobot.verification.records import Case, Claim, Finding
from fem_biobot.verification.rod_parts import arc, rod_of, straight

Array = NDArray[np.float64]
Vector = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Drawing:
    """Where an assembly is drawn: turned by `R` (3, 3), then moved by `shift` (3,) [mm]."""

    R: Array
    shift: Array

    def at(self, p: ArrayLike) -> Array:
        """Positions (..., 3) as drawn."""
        return np.asarray(p, dtype=float) @ self.R.T + self.shift

    def vector(self, x: float, y: float, z: float) -> Vector:
        """A direction or load as drawn."""
        a, b, c = (float(value) for value in self.R @ np.array([x, y, z]))
        return a, b, c

    def place(self, name: str, p: ArrayLike) -> tuple[str, Vector]:
        """A place of a body as drawn."""
        a, b, c = (float(value) for value in self.at(p))
        return name, (a, b, c)


PLAIN = Drawing(np.eye(3), np.zeros(3))
TURNED = Drawing(rotation(5), np.array([3.0, -7.0, 2.0]))


def assembly(drawn: Drawing) -> RodModel:
    """A bent rod with natural curvature, a bar on a hinge, a body; dead, following and distributed load, and weight.

    A muscle and a spring pull at the body.
    """
    stiffness, vector = (40.0, 50.0, 70.0, 3.1, 2.3, 1.7), drawn.vector
    end = arc(8, 3.0, 1.2)[-1]
    bar = straight(4, 2.0, (0.3, 0.2, 1.0)) + end
    far = bar[-1]
    rods = [
        rod_of(
            drawn.at(arc(8, 3.0, 1.2)),
            stiffness,
            name="bent",
            normal=vector(0.0, 0.0, 1.0),
            natural_curvature=(0.1, 0.2, 0.05),
        ),
        rod_of(drawn.at(bar), stiffness, name="bar", normal=vector(1.0, 0.0, 0.0)),
    ]
    inertia = drawn.R @ np.diag([1.0, 2.0, 2.5]) @ drawn.R.T
    centre = drawn.place("foot", far + np.array([0.2, 0.1, 0.3]))[1]
    foot = drawn.place("foot", far)
    return RodModel(
        rods,
        [Hinge(("bent", -1), ("bar", 0), vector(0.2, 1.0, 0.1)), Rigid(("bar", -1), foot)],
        [Body(centre, 1e-4, inertia, "foot")],
        [Hold(("bent", 0))],
        [
            PointLoad(foot, vector(0.3, -0.2, 0.1), vector(0.02, 0.1, -0.05)),
            PointLoad(("bar", 2), vector(0.1, 0.1, 0.0), following=True),
            DistributedLoad("bent", vector(0.0, 0.05, -0.1)),
            Gravity(vector(0.0, 0.0, -500.0)),
        ],
        [
            Muscle(drawn.place("foot", far + np.array([0.5, 0.0, 0.0])), ("bent", 3), 0.3, 4.0, 1.0, 0.5),
            Spring(foot, drawn.place("", far + np.array([1.0, 1.0, 0.0]))[1], 0.4),
        ],
    )


def turned_assembly() -> Finding:
    """R9: a model turned with its loads has the turned state.

    Problem: an assembly with everything that rods have, in equilibrium; then drawn turned by a generic rotation and
        moved, with all loads turned.
    Measured: strains and curvatures of both rods, positions of their nodes, energy, muscle force; largest difference.
    Tolerance: 1e-9 of strains, energy and force, 1e-8 mm of positions: what the tolerance of the equilibrium leaves.
    Cannot see: any error that turns with the model.
    Catches: a component in the drawing's axes where the part's are meant, anywhere.
    """
    a, b = (statics(assembly(drawn)).last for drawn in (PLAIN, TURNED))

    def strains(state: RodState) -> Array:
        return np.vstack([np.hstack(state.strain(name)) for name in ("bent", "bar")])

    def positions(state: RodState) -> Array:
        return np.vstack([state.points(name) for name in ("bent", "bar")])

    return Finding.of(
        [
            np.abs(strains(b) - strains(a)).max(),
            np.abs(positions(b) - TURNED.at(positions(a))).max(),
            b.energy / a.energy,
            b.muscle_force("muscle") / a.muscle_force("muscle"),
        ]
    )


_OBJECTIVE = "objectivity (Truesdell and Noll 1965)"
R9 = Case(
    "R9",
    "model and loads turned together",
    (
        Claim("change of strains [1] and curvatures [1/mm]", 0.0, 1e-9, "1", _OBJECTIVE),
        Claim("change of turned positions", 0.0, 1e-8, "mm", _OBJECTIVE),
        Claim("energy over that before", 1.0, 1e-9, "1", _OBJECTIVE),
        Claim("muscle force over that before", 1.0, 1e-9, "1", _OBJECTIVE),
    ),
    turned_assembly,
)

CASES = (R9,)
