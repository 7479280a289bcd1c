"""Explicit time steps of an assembly on a frictional ground, compiled: kick and drift with impulses.

A step drifts positions and directors over half of it, takes the forces there once, changes momentum and spatial angular
momentum by them and by the impulses of joints and ground, and drifts the other half:

    q_half = q0 + h/2 v0,   M v1 = M v0 + h f(q_half) + J^T p,   q1 = q_half + h/2 v1

Without damping and contact this is the position form of Stoermer-Verlet: second order, momentum and angular momentum to
rounding, energy bounded. Stable for steps below 2 over the highest angular frequency. Contact and joints demand what they
do in the implicit integrator, in the configuration at the half step. Nothing but the force and contact kernels is shared
with that: no tangent, no iteration, no numerical dissipation.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.assembly.kernels import (  # noqa: E402
    add_all_forces,
    add_joints,
    energies,
    measure,
    resultants,
    tensions,
)
from fem_biobot.rod.blocks.kernels import factor, invert, solve  # noqa: E402
from fem_biobot.rod.contact.kernels import SLIP, settle  # noqa: E402
from fem_biobot.rod.dynamics.kernels import (  # noqa: E402
    CONTACT,
    CONTACT_ACCEPTED,
    CONTACT_TOLERANCE,
    CONVERGED,
    SINGULAR,
    WOUND,
    add_ground_impulses,
    angular_momentum,
    ground_impulses,
    spatial_inertia,
)
from fem_biobot.rod.parts.kernels import add_loads, add_member_forces, contact  # noqa: E402
from fem_biobot.rod.rotation.kernels import turn  # noqa: E402

_LARGEST_TURN = 3.0


@njit(cache=True, nogil=True)
def _angular_velocity(J, Q, spin, out):
    """Write the angular velocity of one node from its spatial angular momentum: components in its frame, then back."""
    body = np.empty(3)
    for a in range(3):
        body[a] = Q[a, 0] * spin[0] + Q[a, 1] * spin[1] + Q[a, 2] * spin[2]
    # inverse of a symmetric 3 by 3 matrix by cofactors
    c00 = J[1, 1] * J[2, 2] - J[1, 2] * J[2, 1]
    c01 = J[0, 2] * J[2, 1] - J[0, 1] * J[2, 2]
    c02 = J[0, 1] * J[1, 2] - J[0, 2] * J[1, 1]
    det = J[0, 0] * c00 + J[1, 0] * c01 + J[2, 0] * c02
    c11 = J[0, 0] * J[2, 2] - J[0, 2] * J[2, 0]
    c12 = J[0, 2] * J[1, 0] - J[0, 0] * J[1, 2]
    c22 = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
    w0 = (c00 * body[0] + c01 * body[1] + c02 * body[2]) / det
    w1 = (c01 * body[0] + c11 * body[1] + c12 * body[2]) / det
    w2 = (c02 * body[0] + c12 * body[1] + c22 * body[2]) / det
    for i in range(3):
        out[i] = Q[0, i] * w0 + Q[1, i] * w1 + Q[2, i] * w2


@njit(cache=True, nogil=True)
def _spin_up(inertia, Q, spin, v):
    """Write the angular velocities of all nodes into `v` (n, 6)."""
    for i in range(spin.shape[0]):
        if inertia.held[i] == 0:
            _angular_velocity(inertia.J[i], Q[i], spin[i], v[i, 3:])


@njit(cache=True, nogil=True)
def _drift(inertia, x, Q, v, spin, h, angle, quarter, to_x, to_Q):
    """Move freely for `h`: constant momentum and spatial angular momentum; second order for any inertia."""
    for i in range(x.shape[0]):
        for c in range(3):
            to_x[i, c] = x[i, c] + h * v[i, c]
            angle[i, c] = 0.5 * h * v[i, 3 + c]
    turn(Q, angle, quarter)
    _spin_up(inertia, quarter, spin, v)
    for i in range(x.shape[0]):
        for c in range(3):
            angle[i, c] = h * v[i, 3 + c]
    turn(Q, angle, to_Q)
    _spin_up(inertia, to_Q, spin, v)


@njit(cache=True, nogil=True)
def _mass_blocks(assembly, system, work):
    """Fill and factorise masses with joints at the half step."""
    inertia = assembly.inertia
    Js = np.empty((3, 3))
    work.blocks[:] = 0.0
    for i in range(inertia.mass.shape[0]):
        B = work.blocks[system.plan.diagonal[i]]
        if inertia.held[i] == 1:
            for c in range(6):
                B[c, c] = 1.0
            continue
        spatial_inertia(inertia.J[i], work.Qm[i], Js)
        for a in range(3):
            B[a, a] = inertia.mass[i]
            for b in range(3):
                B[3 + a, 3 + b] = Js[a, b]
    add_joints(
        assembly, system, work.xm, work.Qm, work.v1, work.joint_gap, work.joint_rate, work.no_joint, work.column,
        work.blocks, True,
    )  # fmt: skip
    return factor(system.plan, work.blocks)


@njit(cache=True, nogil=True)
def _compliance(assembly, system, jointed, work):
    """Velocity by impulse of the nodes that touch, (6 f, 6 f)."""
    inertia = assembly.inertia
    f = system.touching.shape[0]
    work.compliance[:] = 0.0
    block = np.zeros((6, 6))
    Js = np.empty((3, 3))
    for k in range(f):
        i = system.touching[k]
        if jointed:
            for c in range(6):
                work.column[:] = 0.0
                work.column[i, c] = 1.0
                solve(system.plan, work.blocks, work.column)
                for g in range(f):
                    for r in range(6):
                        work.compliance[6 * g + r, 6 * k + c] = work.column[system.touching[g], r]
        elif inertia.held[i] == 0:
            block[:] = 0.0
            spatial_inertia(inertia.J[i], work.Qm[i], Js)
            for a in range(3):
                block[a, a] = inertia.mass[i]
                for b in range(3):
                    block[3 + a, 3 + b] = Js[a, b]
            if not invert(block):
                return False
            for a in range(6):
                for b in range(6):
                    work.compliance[6 * k + a, 6 * k + b] = block[a, b]
    return True


@njit(cache=True, nogil=True)
def explicit_run(assembly, system, state, plane, h, pulls, load_factors, work, scratch, book, tally):
    """Make steps of length `h`; parameters and tallies as in `rod.dynamics.kernels.implicit_run`.

    `state.strain` and `state.lengths` hold those of the last half step, from which rates are taken. Returns the steps
    made and the outcome.
    """
    inertia = assembly.inertia
    E = assembly.elements
    M = assembly.members
    n = inertia.mass.shape[0]
    c = assembly.contacts.node.shape[0]
    jointed = assembly.constraints.rows.shape[0] > 0
    spin = work.spin
    angular_momentum(inertia, state.Q, state.v, spin)
    work.v1[:] = state.v
    before = np.empty((n, 6))
    worst = 0.0
    for step in range(pulls.shape[0] - 1):
        pull = 0.5 * (pulls[step] + pulls[step + 1])
        factors = 0.5 * (load_factors[step] + load_factors[step + 1])
        _drift(inertia, state.x, state.Q, work.v1, spin, 0.5 * h, work.angle, work.Q1, work.xm, work.Qm)
        before[:] = work.v1
        if not measure(assembly, work.xm, work.Qm, work.strain, work.lengths) < _LARGEST_TURN:
            return step, WOUND, worst
        resultants(assembly, state.strain, work.strain, 1.0, 1.0 / h, work.s)
        tensions(M, state.lengths, work.lengths, 1.0, 1.0 / h, pull, work.tension)
        work.force[:] = 0.0
        add_all_forces(assembly, work.xm, work.Qm, work.s, work.tension, factors, 1.0, work.force)
        for i in range(n):
            for a in range(6):
                work.rhs[i, a] = h * work.force[i, a] if inertia.held[i] == 0 else 0.0
        for k in range(c):
            work.gap[k] = contact(assembly.contacts, k, work.xm, work.Qm, plane.axes, plane.height, work.rows[k])
        if jointed:
            if not _mass_blocks(assembly, system, work):
                return step, SINGULAR, worst
            for j in range(work.joint_gap.shape[0]):
                for r in range(6):
                    work.rhs[n + j, r] = -(work.joint_rate[j, r] + work.joint_gap[j, r] / (0.5 * h))
        if c > 0:
            work.free[:] = work.rhs
            if jointed:
                solve(system.plan, work.blocks, work.free)
            else:
                for k in range(c):
                    i = assembly.contacts.node[k]
                    for a in range(3):
                        work.free[i, a] = work.rhs[i, a] / inertia.mass[i]
                    _angular_velocity(inertia.J[i], work.Qm[i], work.rhs[i, 3:], work.free[i, 3:])
            if not _compliance(assembly, system, jointed, work):
                return step, SINGULAR, worst
            work.p[:] = state.impulse
            work.touch[:] = state.touch
            trouble = ground_impulses(
                assembly, system, state, plane, 0.5 * h, 0.0, CONTACT_TOLERANCE, work, scratch
            )  # fmt: skip
            if not trouble <= CONTACT_ACCEPTED:
                return step, CONTACT, worst
            worst = max(worst, trouble)
            add_ground_impulses(assembly, work, work.rhs)
            state.impulse[:] = work.p
            state.touch[:] = work.touch
            settle(work.b, work.w, state.touch, state.slide, CONTACT_TOLERANCE)
        if jointed:
            solve(system.plan, work.blocks, work.rhs)
            # impulses of the joints are the multipliers; the nodes' part is the change of velocity
            work.column[:] = 0.0
            for i in range(n):
                for a in range(6):
                    work.v1[i, a] += work.rhs[i, a]
            state.joint[:] = work.rhs[n:]
            angular_momentum(inertia, work.Qm, work.v1, spin)
        else:
            for i in range(n):
                if inertia.held[i] == 1:
                    continue
                for a in range(3):
                    work.v1[i, a] += work.rhs[i, a] / inertia.mass[i]
                    spin[i, a] += work.rhs[i, 3 + a]
            _spin_up(inertia, work.Qm, spin, work.v1)
        for k in range(c):
            node = assembly.contacts.node[k]
            for a in range(3):
                tally[k, a] += work.p[k, a]
                motion = 0.0
                for r in range(6):
                    motion += work.rows[k, a, r] * 0.5 * (before[node, r] + work.v1[node, r])
                book[7 if a == 0 else 6] += work.p[k, a] * motion
            if state.touch[k] == SLIP:
                tally[k, 3] += h
            if work.p[k, 0] > 0.0:
                tally[k, 4] += h
        for kind in range(2):
            work.column[:] = 0.0
            if kind == 0:
                add_member_forces(M, work.xm, work.Qm, pull, work.column)
            else:
                add_loads(assembly.loads, factors, work.Qm, work.column)
            for i in range(n):
                for a in range(6):
                    book[3 + kind] += 0.5 * h * work.column[i, a] * (before[i, a] + work.v1[i, a])
        for e in range(E.nodes.shape[0]):
            rate = E.length[e] * assembly.damping[e] / h
            for r in range(6):
                book[5] -= rate * E.stiffness[e, r] * (work.strain[e, r] - state.strain[e, r]) ** 2
        for k in range(M.law.shape[0]):
            book[5] -= M.viscosity[k] / h * (work.lengths[k] - state.lengths[k]) ** 2
        state.strain[:] = work.strain
        state.lengths[:] = work.lengths
        _drift(inertia, work.xm, work.Qm, work.v1, spin, 0.5 * h, work.angle, work.Q1, state.x, state.Q)
    state.v[:] = work.v1
    measure(assembly, state.x, state.Q, work.strain, work.lengths)
    kinetic = 0.0
    for i in range(n):
        for a in range(3):
            kinetic += 0.5 * (inertia.mass[i] * state.v[i, a] ** 2 + spin[i, a] * state.v[i, 3 + a])
    elastic, weight = energies(assembly, state.x, work.strain, work.lengths)
    book[0] = kinetic
    book[1] = elastic
    book[2] = weight
    return pulls.shape[0] - 1, CONVERGED, worst
