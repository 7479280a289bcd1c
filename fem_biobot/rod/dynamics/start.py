"""Arrays with which an integration begins, and starts that are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.friction.kernels import STICK
from fem_biobot.rod.arrays import Assembly
from fem_biobot.rod.assembly import kernels as assembly_kernels
from fem_biobot.rod.dynamics.arrays import Plane, State
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.parts.kernels import contact
from fem_biobot.rod.touching.kernels import touch

Array = NDArray[np.float64]

_INSIDE = 1e-6  # of the model's size, that rounding may put a start into the ground


def plane_of(ground: Ground | None, c: int, between: Array) -> Plane:
    """Arrays of the ground under `c` contact points, with the friction `between` touching parts, (t,)."""
    g = ground or Ground()
    # slip against `forward` meets the reverse coefficient; sideways the forward one
    parts = np.repeat(between[:, None], 4, axis=1)
    return Plane(
        np.ascontiguousarray(g.axes),
        float(g.height),
        np.array(g.velocity, dtype=float),
        np.concatenate([np.tile(g.static_coefficients, (c, 1)), parts]),
        np.concatenate([np.tile(g.kinetic_coefficients, (c, 1)), parts]),
    )


def state_of(assembly: Assembly, start: RodState) -> State:
    """State of the integrators for a start; `assembly` has the contact points in force."""
    n, j = len(assembly.inertia.mass), len(assembly.constraints.rows)
    c = len(assembly.contacts.node) + len(assembly.touches.node)
    for what, shape in (("x", (n, 3)), ("Q", (n, 3, 3)), ("v", (n, 6))):
        found = getattr(start, what)
        if np.shape(found) != shape or not np.isfinite(found).all():
            raise ModelError(f"start: {what}: found shape {np.shape(found)}, expected {shape} of finite numbers")
    strain, lengths = np.zeros((len(assembly.damping), 6)), np.zeros(len(assembly.members.law))
    x, Q = np.array(start.x, dtype=float), np.array(start.Q, dtype=float)
    assembly_kernels.measure(assembly, x, Q, strain, lengths)
    v = np.array(start.v, dtype=float)
    v[assembly.inertia.held == 1] = 0.0
    no_contact = (np.zeros((c, 3)), np.full(c, STICK, dtype=np.int64), np.zeros((c, 2)))
    none_yet = (np.zeros(1, dtype=np.int64), np.zeros(1))
    return State(x, Q, v, np.zeros((n, 6)), *no_contact, np.zeros((j, 6)), strain, lengths, *none_yet)


def fits(state: State, like: State) -> bool:
    """Whether a checkpoint's arrays have the shapes of a model's."""
    return all(a.shape == b.shape and bool(np.isfinite(a).all()) for a, b in zip(state, like, strict=True))


def refuse_inside(assembly: Assembly, plane: Plane, state: State) -> None:
    """A start with a contact point in the ground, or a touching node in another part."""
    size = 1.0 + float(np.abs(state.x).max())
    rows: Any = np.zeros((3, 3, 6))
    for k in range(len(assembly.touches.node)):
        gap = touch(assembly.touches, k, state.x, state.Q, rows, np.zeros(3, dtype=np.int64))
        if gap < -_INSIDE * size:
            raise ModelError(
                f"start: touching node {k} lies {-gap:.3g} mm inside what it touches, expected on or outside it "
                "(draw the parts apart or give a smaller distance)"
            )
    for k in range(len(assembly.contacts.node)):
        gap = contact(assembly.contacts, k, state.x, state.Q, plane.axes, plane.height, False, rows)
        if gap < -_INSIDE * size:
            raise ModelError(
                f"start: contact point {k} lies {-gap:.3g} mm inside the ground, expected on or above it "
                "(lower the ground or lift the machine)"
            )


def refuse_massless(model: RodModel, assembly: Assembly) -> None:
    """A part without mass or inertia, which explicit steps cannot move."""
    inertia = assembly.inertia
    least = np.minimum(inertia.mass, np.linalg.eigvalsh(inertia.J)[:, 0])
    for node in np.flatnonzero((inertia.held == 0) & ~(least > 0.0)):
        name = next(key[0] for key, number in model.atlas.node_of.items() if number == node)
        raise ModelError(f"dynamics: {name!r} has no mass or no inertia, expected some for explicit steps")
