"""What happens in the walk of a solid besides walking: falls, flight, parts that touch, parts below the ground."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fem_biobot.solid.dynamics.motion import SolidMotion
from fem_biobot.solid.touching import in_contact, touching_parts

_UPRIGHT = 0.5  # cosine of the tilt at which a machine has fallen
_BURIED = 1e-3  # mm below the ground that a part may reach before it is told
_LOOKS = 12  # samples of a motion that are asked whether parts touch


@dataclass(frozen=True)
class Happening:
    """Something that a walk does not ignore.

    Attributes
    ----------
    name
        ``overturned`` (ends the walk), ``flight`` (no foot bears anything), ``touching`` (the body runs into itself),
        ``buried`` (a part other than a sole reaches below the ground, which holds up soles alone).
    time
        Of the first sample that shows it [s].
    text
        One line.
    """

    name: str
    time: float
    text: str


def uprightness(motion: SolidMotion) -> np.ndarray:
    """Cosine of the tilt of the body's mean rotation since the drawing against the ground's normal, (s,) [1]."""
    assert motion.ground is not None
    X, mass = motion.body.system.space.points, motion.body.node_mass
    arm = X - (X @ mass / mass.sum())[:, None]
    normal = motion.ground.axes[0]
    found = []
    for u in motion.u:
        x = X + u
        x = x - (x @ mass / mass.sum())[:, None]
        U, _, V = np.linalg.svd((x * mass) @ arm.T)
        turn = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
        found.append(float(normal @ turn @ normal))
    return np.array(found)


def fall(motion: SolidMotion) -> int | None:
    """First sample that shows the machine fallen."""
    fallen = uprightness(motion) < _UPRIGHT
    return int(fallen.argmax()) if fallen.any() else None


def happened(motion: SolidMotion) -> tuple[Happening, ...]:
    """Everything of the kinds that `Happening` names, in order of time."""
    assert motion.ground is not None
    assert motion.feet is not None
    times, events = motion.times, []

    def note(name: str, shows: Any, text: str) -> None:
        if shows.any():
            t = float(times[int(shows.argmax())])
            events.append(Happening(name, t, f"{text} at {t:.4g} s"))

    fallen = fall(motion)
    if fallen is not None:
        events.append(Happening("overturned", float(times[fallen]), f"the machine overturned at {times[fallen]:.4g} s"))
    bears = (motion.contact_share > 0.0).any(axis=1)
    note("flight", ~bears & (np.cumsum(bears) > 0), "no foot bears anything for the first time")
    X = motion.body.system.space.points
    other = np.ones(X.shape[1], dtype=bool)
    other[motion.feet.nodes] = False
    normal, height = motion.ground.axes[0], motion.ground.height
    depth = height - np.array([(normal @ (X + u))[other].min() for u in motion.u])
    note("buried", depth > _BURIED, f"a part other than a sole is below the ground, {depth.max():.3g} mm at most,")
    mesh, allowed = motion.body.model.mesh, in_contact(motion.body.model)
    for i in np.unique(np.linspace(0, len(times) - 1, _LOOKS).astype(int)):
        if words := touching_parts(mesh, motion.u[i], allowed):
            events.append(Happening("touching", float(times[i]), f"{words}, at {times[i]:.4g} s"))
            break
    return tuple(sorted(events, key=lambda event: event.time))
