"""Compiled forces, stiffness and energies of a whole assembly, for statics, modes and both time integrators."""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ALLOCATES, BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.activation.kernels import active_tension  # noqa: E402
from fem_biobot.rod.element.kernels import add_forces, element_tangent, strains  # noqa: E402
from fem_biobot.rod.parts.kernels import (  # noqa: E402
    add_gravity,
    add_loads,
    add_member_forces,
    constraint,
    load_tangent,
    member_lengths,
    member_tangent,
    passive_tension,
)


@njit(**KERNEL, **BORROWS)
def measure(assembly, x, Q, strain, lengths):
    """Write element strains (m, 6) and member lengths (k,); returns the largest turn within an element [rad]."""
    member_lengths(assembly.members, x, Q, lengths)
    return strains(assembly.elements, x, Q, strain)


@njit(**KERNEL, **BORROWS)
def resultants(assembly, before, after, weight, rate, s):
    """Write ``s = C (weight after + (1 - weight) before - natural + rate tau (after - before))``, (m, 6).

    `before` and `after` are strains (m, 6), `tau` the Kelvin-Voigt times, `rate` one over the time between them.
    """
    E = assembly.elements
    for e in range(E.nodes.shape[0]):
        lag = rate * assembly.damping[e]
        for i in range(6):
            natural = E.eps0[e, i] if i < 3 else E.kappa0[e, i - 3]
            mean = before[e, i] + weight * (after[e, i] - before[e, i])
            s[e, i] = E.stiffness[e, i] * (mean - natural + lag * (after[e, i] - before[e, i]))


@njit(**KERNEL, **BORROWS)
def tensions(members, activation, before, after, weight, rate, pull, tension, active, slopes):
    """Write the tensile force of each member (k,): `weight` and `rate` as in `resultants`, `pull` what drive adds.

    `active` takes its active part (k,), `slopes` that part's slopes by length and by rate of length (k, 2).
    """
    for k in range(members.law.shape[0]):
        new, _, _ = passive_tension(members.law[k], members.stiffness[k], members.length[k], after[k])
        old = new
        if weight < 1.0:
            old, _, _ = passive_tension(members.law[k], members.stiffness[k], members.length[k], before[k])
        viscous = members.viscosity[k] * rate * (after[k] - before[k])
        active[k], slopes[k, 0], slopes[k, 1] = active_tension(
            activation, k, members.length[k], before[k], after[k], weight, rate, pull[k]
        )
        tension[k] = active[k] + old + weight * (new - old) + viscous


@njit(**KERNEL, **BORROWS)
def add_all_forces(assembly, x, Q, s, tension, load_factor, gravity_factor, force):
    """Add to `force` (n, 6) every force but those of joints and ground: what accelerates the nodes."""
    for i in range(force.shape[0]):
        for c in range(6):
            force[i, c] = -force[i, c]
    add_forces(assembly.elements, x, Q, s, force)
    for i in range(force.shape[0]):
        for c in range(6):
            force[i, c] = -force[i, c]
    add_member_forces(assembly.members, x, Q, tension, force)
    add_loads(assembly.loads, load_factor, Q, force)
    add_gravity(assembly.inertia, assembly.gravity, gravity_factor, force)


@njit(**KERNEL, **BORROWS)
def _add_pair(K, slots, a, b, held, scale, blocks):
    """Add a (12, 12) matrix to the four blocks of a pair of nodes; held nodes and the world take nothing."""
    for p in range(4):
        i = a if p < 2 else b
        j = a if p % 2 == 0 else b
        if slots[p] < 0 or held[i] == 1 or held[j] == 1:
            continue
        B = blocks[slots[p]]
        first = 6 * (p // 2)
        left = 6 * (p % 2)
        for r in range(6):
            for c in range(6):
                B[r, c] += scale * K[first + r, left + c]


@njit(**KERNEL, **ALLOCATES)
def add_stiffness(assembly, system, x, Q, s, gain, tension, slopes, lengths, weight, rate, load_factor, scale, blocks):
    """Add `scale` times minus the derivative of `add_all_forces` by the nodes' increments to `blocks`.

    `gain` (m,) multiplies the section stiffnesses; the slope of a member's tension is ``weight`` times that by length,
    plus ``rate`` times that by rate, `slopes` (k, 2) of the active part. Same as finite differences of the forces in
    tests/oracles.
    """
    K = np.empty((12, 12))
    C = np.empty(6)
    E = assembly.elements
    M = assembly.members
    held = assembly.inertia.held
    for e in range(E.nodes.shape[0]):
        for i in range(6):
            C[i] = gain[e] * E.stiffness[e, i]
        element_tangent(E, e, x, Q, s[e], C, K)
        _add_pair(K, system.element[e], E.nodes[e, 0], E.nodes[e, 1], held, scale, blocks)
    for k in range(M.law.shape[0]):
        _, slope, _ = passive_tension(M.law[k], M.stiffness[k], M.length[k], lengths[k])
        slope = weight * (slope + slopes[k, 0]) + rate * (M.viscosity[k] + slopes[k, 1])
        member_tangent(M, k, x, Q, tension, slope, K)
        _add_pair(K, system.member[k], M.nodes[k, 0], M.nodes[k, 1], held, scale, blocks)
    L = assembly.loads
    small = np.empty((6, 6))
    for k in range(L.node.shape[0]):
        i = L.node[k]
        if held[i] == 0:
            load_tangent(L, k, load_factor[k], Q, small)
            B = blocks[system.plan.diagonal[i]]
            for r in range(6):
                for c in range(6):
                    B[r, c] += scale * small[r, c]


@njit(**KERNEL, **ALLOCATES)
def joint_gaps(constraints, held, x, Q, v, gap, rate):
    """Write the residuals of the joints and their rates for `v` (n, 6), (j, 6); held nodes do not move."""
    rows = np.empty((6, 12))
    for j in range(constraints.rows.shape[0]):
        constraint(constraints, j, x, Q, gap[j], rows)
        for r in range(6):
            rate[j, r] = 0.0
        for end in range(2):
            i = constraints.nodes[j, end]
            if i >= 0 and held[i] == 0:
                for r in range(6):
                    for c in range(6):
                        rate[j, r] += rows[r, 6 * end + c] * v[i, c]


@njit(**KERNEL, **ALLOCATES)
def add_joint_forces(constraints, held, x, Q, multiplier, force):
    """Add to `force` (n, 6) what the joints exert: `multiplier` (j, 6) on first parts, the opposite on second ones."""
    gap = np.empty(6)
    rows = np.empty((6, 12))
    for j in range(constraints.rows.shape[0]):
        constraint(constraints, j, x, Q, gap, rows)
        for end in range(2):
            i = constraints.nodes[j, end]
            if i >= 0 and held[i] == 0:
                for r in range(6):
                    for c in range(6):
                        force[i, c] += multiplier[j, r] * rows[r, 6 * end + c]


@njit(**KERNEL, **ALLOCATES)
def joint_blocks(constraints, held, slots, x, Q, soft, blocks):
    """Write the joints' rows and columns to `blocks`, at `slots` (j, 5); rows that do not hold get a unit diagonal.

    The others get `soft` times their compliance.
    """
    gap = np.empty(6)
    rows = np.empty((6, 12))
    for j in range(constraints.rows.shape[0]):
        constraint(constraints, j, x, Q, gap, rows)
        for end in range(2):
            i = constraints.nodes[j, end]
            if i >= 0 and held[i] == 0:
                over = blocks[slots[j, 2 * end]]
                under = blocks[slots[j, 2 * end + 1]]
                for r in range(6):
                    for c in range(6):
                        under[r, c] = rows[r, 6 * end + c]
                        over[c, r] = -rows[r, 6 * end + c]
        for r in range(6):
            blocks[slots[j, 4], r, r] = soft * constraints.soft[j, r] if constraints.rows[j, r] == 1 else 1.0


@njit(**KERNEL, **BORROWS)
def energies(assembly, x, strain, lengths):
    """Elastic energy of rods and members, and potential energy of weight [uJ]."""
    elastic = 0.0
    E = assembly.elements
    for e in range(E.nodes.shape[0]):
        for i in range(6):
            d = strain[e, i] - (E.eps0[e, i] if i < 3 else E.kappa0[e, i - 3])
            elastic += 0.5 * E.length[e] * E.stiffness[e, i] * d * d
    M = assembly.members
    for k in range(M.law.shape[0]):
        _, _, energy = passive_tension(M.law[k], M.stiffness[k], M.length[k], lengths[k])
        elastic += energy
    weight = 0.0
    for i in range(x.shape[0]):
        for c in range(3):
            weight -= assembly.inertia.mass[i] * assembly.gravity[c] * x[i, c]
    return elastic, weight
