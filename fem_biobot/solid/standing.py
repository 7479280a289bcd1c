"""How a meshed machine stands: the shape its standing tension bends it to, put on its feet and left to settle.

The shape is static, without weight; rings that are not bonded have slid in it to where static contact has them. How it
stands is found by steps of backward Euler that grow longer and take all energy of motion: feet that stick, and rings,
leave more than one answer, and this one is where the machine would come to rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import SolveError
from fem_biobot.friction.ground import Ground
from fem_biobot.material.law import Array
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.book import begun
from fem_biobot.solid.dynamics.feet import Feet, feet_of
from fem_biobot.solid.dynamics.integrate import solid_dynamics
from fem_biobot.solid.dynamics.motion import SolidCheckpoint
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.dynamics.step import State
from fem_biobot.solid.from_design import newton_settings, tension_step
from fem_biobot.solid.model import SolidState, solve

FEET = ("foot_short", "foot_long")

# steps of settling [s], how many of one length, and how many slices at most
_FIRST, _LONGEST, _SLICE, _SLICES = 1e-3, 16e-3, 10, 80
# energy of motion relative to the weight's work over a micrometre, below which a machine stands
_STILL = 1e-9


@dataclass(frozen=True, eq=False)
class Standing:
    """A machine standing on the ground under its standing tension.

    Attributes
    ----------
    checkpoint
        At rest at time 0, to begin a motion from.
    time
        That settling took [s].
    kinetic_energy
        Left when it was called still [uJ].
    tilt
        About the lateral axis, from the floating shape to the standing one as it was put down [rad].
    """

    checkpoint: SolidCheckpoint
    time: float
    kinetic_energy: float
    tilt: float

    def arrays(self) -> dict[str, Array]:
        """For a file."""
        numbers = {k: np.array(getattr(self, k)) for k in ("kinetic_energy", "tilt")}
        return {**self.checkpoint.arrays(), **numbers, "settling": np.array(self.time)}

    @classmethod
    def from_arrays(cls, arrays: dict[str, Array]) -> Standing:
        """From what `arrays` gave."""
        found = SolidCheckpoint.from_arrays(arrays)
        return cls(found, float(arrays["settling"]), float(arrays["kinetic_energy"]), float(arrays["tilt"]))


def stand(
    design: Design,
    body: MovingBody,
    ground: Ground,
    *,
    feet: Feet | None = None,
    settings: DynamicsSettings | None = None,
    listener: Callable[[float, float], None] | None = None,
) -> Standing:
    """Find how a design's machine stands.

    Parameters
    ----------
    design, body, ground
        The machine, free of supports, and what it stands on.
    feet
        Points that touch; by default all of both soles.
    settings
        Of the integrator, whose scheme is backward Euler whatever it says.
    listener
        Told the time reached [s] and the energy of motion left [uJ].

    Raises
    ------
    SolveError
        A tension too strong for the beam, or a machine that does not come to rest; `best` is what was reached.
    """
    settings = replace(settings or DynamicsSettings(), scheme=Scheme.backward_euler)
    passive = tension_step(design, design.tension(0.0))
    floating = solve(body.model, [passive], settings=newton_settings(design)).last
    feet = feet or feet_of(body, FEET)
    u, tilt = placed(body, floating, ground, feet)
    at: SolidState | SolidCheckpoint = replace(floating, u=u)
    weight = float(np.linalg.norm(body.weight.sum(axis=0)))
    still = _STILL * max(weight, 1e-12) * 1e-3
    time, step, energy = 0.0, _FIRST, np.inf
    for _ in range(_SLICES):
        motion = solid_dynamics(
            body, _SLICE * step, step, ground=ground, feet=feet, drive=lambda t: passive, start=at, settings=settings
        )
        time += _SLICE * step
        at, energy = motion.final, float(motion.energy("kinetic")[_SLICE // 2 :].max())
        if listener is not None:
            listener(time, energy)
        if energy <= still and step >= _LONGEST:
            return Standing(_rested(body, motion.final), time, energy, tilt)
        step = min(2.0 * step, _LONGEST)
    raise SolveError(
        f"standing: after {time:.3g} s the machine still moves with {energy:.3g} uJ, expected it to stand",
        best=at,
        reason="the machine does not come to rest",
    )


def _rested(body: MovingBody, found: SolidCheckpoint) -> SolidCheckpoint:
    """The same place without any motion, at time 0, with a new book; what sticks sticks on."""
    u, still = found.state.u, np.zeros_like(found.state.u)
    touch = found.state.touch._replace(slide=np.zeros_like(found.state.touch.slide))
    p = found.state.p
    return SolidCheckpoint(State(u, still, still, touch, p, found.state.between), begun(body, u, still, p), 0.0)


def placed(body: MovingBody, shape: SolidState, ground: Ground, feet: Feet) -> tuple[Array, float]:
    """Displacement (3, n) [mm] of a shape turned about the lateral axis and lowered until it can stand, and the turn.

    The lowest line from a contact point behind the centre of mass to one before it becomes level. The centre of mass
    keeps its place along the ground.
    """
    X, mass, axes = shape.X, body.node_mass / body.total_mass, ground.axes
    x = X + shape.u
    centre = x @ mass
    nodes = feet.nodes
    up, forward = axes[0] @ (x[:, nodes] - centre[:, None]), axes[1] @ (x[:, nodes] - centre[:, None])
    behind, before = forward < 0.0, forward > 0.0
    tilt = 0.0
    if behind.any() and before.any():
        # height of the line through each pair below the centre; the lowest carries the machine
        run = forward[before][None] - forward[behind][:, None]
        rise = up[before][None] - up[behind][:, None]
        height = up[behind][:, None] - forward[behind][:, None] * rise / run
        i, k = np.unravel_index(int(height.argmin()), height.shape)
        tilt = float(np.arctan2(rise[i, k], run[i, k]))
    c, s = np.cos(tilt), np.sin(tilt)
    # rows: normal, forward, lateral; points before the centre go down by a positive turn
    turn = axes.T @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ axes
    x = turn @ (x - centre[:, None])
    across = X @ mass
    across -= axes[0] * (axes[0] @ across)
    lift = ground.height - float((axes[0] @ x[:, nodes]).min())
    return x + (across + lift * axes[0])[:, None] - X, tilt
