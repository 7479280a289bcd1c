"""The muscle of a mesh alone, its two bonds moved as rigid plates, and the forces that move them.

What a junction is as a member of rods is read from such states; the skeleton takes no part in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from fem_biobot.design import Design
from fem_biobot.link.observed import Array, rotation
from fem_biobot.link.parts import BONDS, part_of
from fem_biobot.material.active import ActiveStress
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.muscle.fibres import fibre_field
from fem_biobot.solid.from_design import law_of, tension_of, tension_step
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.records import Fix, Step


class Pull(NamedTuple):
    """Nominal tension [kPa], approach of the bonds [mm], and the turn of each inwards [rad]."""

    tension: float
    approach: float
    turn: float


@dataclass(frozen=True)
class MuscleAlone:
    """The muscle of a mesh between its bonds.

    Attributes
    ----------
    design, mesh
        A bot of two pillars with a junction, and its mesh.
    """

    design: Design
    mesh: BodyMesh

    @cached_property
    def body(self) -> BodyMesh:
        """Its elements."""
        return part_of(self.mesh, "muscle")

    @cached_property
    def middle(self) -> Array:
        """Of the strip, (3,) [mm]."""
        return np.array([0.0, 0.0, self.design.value("muscle.junction_height")])

    @cached_property
    def _tensed(self) -> ActiveStress:
        return tension_of(self.design, fibre_field(self.design, self.mesh))

    def _model(self, bonds: Sequence[Fix]) -> SolidModel:
        law = law_of(self.design.value("muscle.material"))
        element = self.design.mesh.element
        return SolidModel(self.body, {"muscle": law}, {"muscle": self._tensed}, bonds, element=element)

    def moved(self, k: int, steps: Sequence[tuple[float, float]]) -> Sequence[SolidState]:
        """States at tensions [kPa] and amounts [mm] or [rad] of one motion of the long bond."""
        model = self._model([Fix(BONDS[0]), Fix(BONDS[1], "xyz", lambda X: _rigid(k, X, self.middle))])
        return solve(model, [Step(by, tension_step(self.design, T).tension) for T, by in steps]).states

    def turned(self, pull: Pull) -> SolidState:
        """The state at a pull whose bonds turn as well."""
        half = self.design.span / 2
        ends = [self.middle + np.array([x, 0.0, 0.0]) for x in (-half, half)]
        bonds = [Fix(name, "xyz", partial(_turned, pull, end)) for name, end in zip(BONDS, ends, strict=True)]
        return solve(self._model(bonds), [Step(1.0, tension_step(self.design, pull.tension).tension)]).last


def _rigid(k: int, X: Array, middle: Array) -> Array:
    """Unit displacement along axis `k`, or small turn about axis ``k - 3``, of positions (3, n), (3, n) [mm]."""
    axis = np.eye(3)[:, [k % 3]]
    if k < 3:
        return np.repeat(axis, X.shape[1], axis=1)
    return np.cross(np.broadcast_to(axis, X.shape), X - middle[:, None], axis=0)


def _turned(pull: Pull, end: Array, X: Array) -> Array:
    """Displacement of a bond by half of a pull's approach and by its turn about an end of the strip, (3, n) [mm]."""
    inwards, arm = -float(np.sign(end[0])), X - end[:, None]
    turned = rotation(inwards * pull.turn) @ arm - arm
    return turned + np.array([[0.5 * inwards * pull.approach], [0.0], [0.0]])


def reaction(state: SolidState, middle: Array) -> Array:
    """Force and moment about the strip's middle that moves the long bond, (6,) [mN, uJ]."""
    about = tuple(middle.tolist())
    return np.concatenate([state.reaction(BONDS[1]), state.reaction_moment(BONDS[1], about)])


def heights(design: Design, states: Sequence[SolidState], ends: Sequence[tuple[float, float]]) -> list[float]:
    """How far above the ends of the strip, at positions `ends` along x [mm], the line of each pull passes [mm]."""
    z, found = design.value("muscle.junction_height"), []
    for state, at in zip(states, ends, strict=True):
        each = [state.reaction_moment(b, (x, 0.0, z))[1] / state.reaction(b)[0] for b, x in zip(BONDS, at, strict=True)]
        found.append(float(np.mean(each)))
    return found
