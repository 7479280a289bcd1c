"""What happens in a walk besides walking: falls, feet that leave the ground, slack muscles, pillars that touch.

Reads samples of a motion; also joins the motions of which a walk is made.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.rod.anatomy import anatomy, muscle_forces, path, sole_gaps, uprightness
from fem_biobot.rod.dynamics.integrate import Checkpoint, Motion

Array = NDArray[np.float64]

_UPRIGHT = 0.5  # cosine of the tilt at which a machine has fallen
_BURIED = 1e-3  # mm below the ground that a part may reach before it is told


@dataclass(frozen=True)
class Event:
    """Something that a walk does not ignore.

    Attributes
    ----------
    name
        ``overturned`` (ends the walk), ``slack`` (a muscle pushes), ``touching`` (soles meet), ``flight`` (no foot on
        the ground), ``lifted`` (a foot leaves the ground for the first time), ``buried`` (a part other than a sole
        reaches below the ground, which holds up soles alone).
    time
        Of the first sample that shows it [s].
    text
        One line.
    """

    name: str
    time: float
    text: str


def joined(motions: Sequence[Motion]) -> Motion:
    """Motions that each begin where the one before ended, as one; counts are added, the worst residual kept."""
    values: dict[str, Any] = {}
    for each in fields(Motion):
        parts = [getattr(motion, each.name) for motion in motions]
        first = parts[0]
        if isinstance(first, np.ndarray):
            # the first sample of a later motion is the last of the one before
            values[each.name] = np.concatenate([first, *(part[1:] for part in parts[1:])])
        elif isinstance(first, int):
            values[each.name] = sum(parts)
        elif isinstance(first, float):
            values[each.name] = max(parts)
        else:
            values[each.name] = parts[-1] if isinstance(first, Checkpoint) else first
    return Motion(**values)


def fall(motion: Motion) -> int | None:
    """First sample that shows the machine fallen."""
    found = anatomy(motion.model)
    fallen = uprightness(motion, found) < _UPRIGHT
    assert motion.ground is not None
    normal, height = motion.ground.axes[0], motion.ground.height
    for spot in (found.start, found.end, found.crown):
        if spot is not None:
            fallen |= path(motion, spot) @ normal <= height
    fallen |= ~np.isfinite(motion.x).all(axis=(1, 2))
    return int(fallen.argmax()) if fallen.any() else None


def cut(motion: Motion, last: int) -> Motion:
    """The motion up to a sample; its checkpoint and counts stay those of its end."""
    columns = {f.name: getattr(motion, f.name) for f in fields(Motion)}
    return replace(motion, **{k: v[: last + 1] for k, v in columns.items() if isinstance(v, np.ndarray)})


def happened(motion: Motion) -> tuple[Event, ...]:
    found = anatomy(motion.model)
    times, events = motion.times, []

    def note(name: str, shows: Any, text: str) -> None:
        if shows.any():
            t = float(times[int(shows.argmax())])
            events.append(Event(name, t, f"{text} at {t:.4g} s"))

    fallen = fall(motion)
    if fallen is not None:
        t = float(times[fallen])
        events.append(Event("overturned", t, f"the machine overturned at {t:.4g} s; the walk ends there"))
    force = muscle_forces(motion, found)
    for column, k in enumerate(found.muscles):
        note("slack", force[:, column] < 0.0, f"muscle {motion.model.members[k].name} goes slack")  # type: ignore[union-attr]
    gaps = sole_gaps(motion, found)
    for k in range(gaps.shape[1]):
        note("touching", gaps[:, k] <= 0.0, f"{found.feet[k]} and {found.feet[k + 1]} touch each other")
    bears = np.stack([(motion.contact_share[:, c] > 0.0).any(axis=1) for c in found.corners], axis=1)
    lifted = ~bears & np.maximum.accumulate(bears, axis=0)  # a foot that never bore anything does not leave
    for k, name in enumerate(found.feet):
        note("lifted", lifted[:, k], f"{name} leaves the ground for the first time")
    note(
        "flight",
        ~bears.any(axis=1) & bears.any(axis=1).cumsum().astype(bool),
        "no foot bears anything for the first time",
    )
    for name, depth in depths(motion).items():
        deepest = float(depth.max())
        note(
            "buried",
            depth > _BURIED,
            f"{name} reaches below the ground, {deepest:.3g} mm at most: soles alone rest on it,",
        )
    return tuple(sorted(events, key=lambda event: event.time))


def depths(motion: Motion) -> dict[str, Array]:
    """How far the boxes of each body reach below the ground, (s,) [mm]; negative above it."""
    found: dict[str, Array] = {}
    model = motion.model
    assert motion.ground is not None
    normal, height = motion.ground.axes[0], motion.ground.height
    for body in model.bodies:
        corners = [
            np.array(centre) + 0.5 * np.array(signs) * np.array(edges)
            for centre, edges in body.boxes
            for signs in itertools.product((-1.0, 1.0), repeat=3)
        ]
        if corners:
            node, _ = model.atlas.locate((body.name, body.centre))
            offsets = np.array(corners) - model.atlas.centre[node]
            heights = motion.x[:, node, None, :] + np.einsum("sji,cj->sci", motion.Q[:, node], offsets)
            found[body.name] = height - (heights @ normal).min(axis=1)
    return found
