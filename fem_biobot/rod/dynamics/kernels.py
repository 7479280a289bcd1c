"""One implicit time step of an assembly on a frictional ground, compiled.

Unknowns are the velocities v1 at the end of the step and the impulses p of the ground and of the joints. With
``vm = theta v1 + (1 - theta) v0``, positions and directors follow from ``h vm`` (spatial rotation vectors), and

    M (v1 - v0) = h f(q at theta, strains averaged with theta) + J^T p      (momentum and spatial angular momentum)

Forces act in the configuration at ``theta`` with resultants of the averaged strains, so that linear momentum is kept to
rounding, angular momentum and energy up to terms of third order a step. ``theta = 1/2 + c h`` makes the scheme second
order in smooth motion with dissipation of high frequencies. A joint demands ``J v1 + g1 / h = 0`` and the ground
``0 <= J_n v1 + g1 / h`` complementary to its impulse: the velocity that closes the gap g1 left at the end of the step,
so positions do not drift, nothing penetrates, and a part at rest stays where it is. Impacts are inelastic, first order.

The tangent matrix and its factors are kept from step to step and renewed when convergence slows (modified Newton); the
contact problem is condensed on the nodes that carry contact points.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.assembly.kernels import (  # noqa: E402
    add_all_forces,
    add_joints,
    add_stiffness,
    energies,
    measure,
    resultants,
    tensions,
)
from fem_biobot.rod.blocks.kernels import factor, solve  # noqa: E402
from fem_biobot.rod.contact.kernels import SLIP, settle, solve_friction  # noqa: E402
from fem_biobot.rod.parts.kernels import add_loads, add_member_forces, contact  # noqa: E402
from fem_biobot.rod.rotation.kernels import turn  # noqa: E402

CONVERGED, SLOW, SINGULAR, CONTACT, WOUND = 0, 1, 2, 3, 4
_LARGEST_TURN = 3.0  # rad within an element, beyond which the rotation vector is no longer unique
CONTACT_TOLERANCE = 1e-12
CONTACT_ACCEPTED = 1e-9  # residual of the contact problem with which a step may be accepted
_CONTACT_ITERATIONS = 100
_STALE = 4  # iterations after which old factors are renewed


@njit(cache=True, nogil=True)
def spatial_inertia(J, Q, out):
    """Write ``Q^T J Q`` (3, 3)."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(3):
                for b in range(3):
                    total += Q[a, i] * J[a, b] * Q[b, j]
            out[i, j] = total


@njit(cache=True, nogil=True)
def angular_momentum(inertia, Q, v, out):
    """Write the spatial angular momentum of every node about its centre of mass, (n, 3) [kg mm^2/s]."""
    Js = np.empty((3, 3))
    for i in range(inertia.mass.shape[0]):
        spatial_inertia(inertia.J[i], Q[i], Js)
        for a in range(3):
            out[i, a] = Js[a, 0] * v[i, 3] + Js[a, 1] * v[i, 4] + Js[a, 2] * v[i, 5]


@njit(cache=True, nogil=True)
def _configure(state, h, theta, work):
    """Positions and directors at theta and at the end of the step for the velocities `work.v1`."""
    x, Q = state.x, state.Q
    for part in range(2):
        share = theta * h if part == 0 else h
        to = work.xm if part == 0 else work.x1
        for i in range(x.shape[0]):
            for c in range(3):
                to[i, c] = x[i, c] + share * work.vm[i, c]
                work.angle[i, c] = share * work.vm[i, 3 + c]
        turn(Q, work.angle, work.Qm if part == 0 else work.Q1)


@njit(cache=True, nogil=True)
def _mean_velocity(state, theta, work):
    for i in range(state.v.shape[0]):
        for c in range(6):
            work.vm[i, c] = theta * work.v1[i, c] + (1.0 - theta) * state.v[i, c]


@njit(cache=True, nogil=True)
def _residual(assembly, system, state, plane, h, theta, pull, load_factor, joint, work):
    """Write the unbalanced impulse ``h f + J^T lambda - M dv`` (n, 6), joint and contact data; returns its scale."""
    inertia = assembly.inertia
    n = inertia.mass.shape[0]
    _mean_velocity(state, theta, work)
    _configure(state, h, theta, work)
    turn_within = measure(assembly, work.x1, work.Q1, work.strain, work.lengths)
    if not turn_within < _LARGEST_TURN:
        return -1.0
    rate = 1.0 / h
    resultants(assembly, state.strain, work.strain, theta, rate, work.s)
    tensions(assembly.members, state.lengths, work.lengths, theta, rate, pull, work.tension)
    work.force[:] = 0.0
    add_all_forces(assembly, work.xm, work.Qm, work.s, work.tension, load_factor, 1.0, work.force)
    angular_momentum(inertia, work.Q1, work.v1, work.spin)
    scale = 0.0
    for i in range(n):
        for c in range(3):
            work.rhs[i, c] = h * work.force[i, c] - inertia.mass[i] * (work.v1[i, c] - state.v[i, c])
            work.rhs[i, 3 + c] = h * work.force[i, 3 + c] - (work.spin[i, c] - work.spin0[i, c])
            scale = max(scale, inertia.mass[i] * (abs(assembly.gravity[c]) * h + abs(work.v1[i, c] - state.v[i, c])))
    for e in range(work.s.shape[0]):
        for c in range(3):
            scale = max(scale, h * abs(work.s[e, c]))
    for k in range(work.tension.shape[0]):
        scale = max(scale, h * abs(work.tension[k]))
    for k in range(load_factor.shape[0]):
        for c in range(3):
            scale = max(scale, h * abs(load_factor[k] * assembly.loads.force[k, c]))
    add_joints(
        assembly, system, work.x1, work.Q1, work.v1, work.joint_gap, work.joint_rate, joint, work.rhs, work.blocks,
        False,
    )  # fmt: skip
    for k in range(assembly.contacts.node.shape[0]):
        work.gap[k] = contact(assembly.contacts, k, work.x1, work.Q1, plane.axes, plane.height, work.rows[k])
    return scale


@njit(cache=True, nogil=True)
def _factorise(assembly, system, state, h, theta, load_factor, work):
    """Fill and factorise the tangent at the present iterate; also the compliance of the nodes that touch."""
    inertia = assembly.inertia
    n = inertia.mass.shape[0]
    Js = np.empty((3, 3))
    work.blocks[:] = 0.0
    rate = 1.0 / h
    for e in range(work.gain.shape[0]):
        work.gain[e] = 1.0 + rate * assembly.damping[e] / theta
    add_stiffness(
        assembly, system, work.xm, work.Qm, work.s, work.gain, work.tension, work.lengths, 1.0, rate / theta,
        load_factor, theta * theta * h * h, work.blocks,
    )  # fmt: skip
    for i in range(n):
        B = work.blocks[system.plan.diagonal[i]]
        if inertia.held[i] == 1:
            B[:] = 0.0
            for c in range(6):
                B[c, c] = 1.0
            continue
        spatial_inertia(inertia.J[i], work.Q1[i], Js)
        w = work.v1[i, 3:]
        L = work.spin[i]
        for a in range(3):
            B[a, a] += inertia.mass[i]
            for b in range(3):
                B[3 + a, 3 + b] += Js[a, b]
        # d(Js w) = dtheta x L - Js (dtheta x w), dtheta = theta h dw
        g = theta * h
        for a in range(3):
            b = (a + 1) % 3
            c = (a + 2) % 3
            B[3 + a, 3 + c] += g * L[b]
            B[3 + a, 3 + b] -= g * L[c]
            for r in range(3):
                # column a of Js [w]x
                B[3 + r, 3 + a] += g * (Js[r, b] * w[c] - Js[r, c] * w[b])
    # joints: unit multipliers, rows J
    # the joints' multipliers are impulses, their rows those of the velocity; the right sides are scaled to that
    add_joints(
        assembly, system, work.x1, work.Q1, work.v1, work.joint_gap, work.joint_rate, work.no_joint, work.column,
        work.blocks, True,
    )  # fmt: skip
    if not factor(system.plan, work.blocks):
        return False
    for f in range(system.touching.shape[0]):
        for c in range(6):
            work.column[:] = 0.0
            work.column[system.touching[f], c] = 1.0
            solve(system.plan, work.blocks, work.column)
            for g2 in range(system.touching.shape[0]):
                for r in range(6):
                    work.compliance[6 * g2 + r, 6 * f + c] = work.column[system.touching[g2], r]
    return True


@njit(cache=True, nogil=True)
def ground_impulses(assembly, system, state, plane, h, theta, tolerance, work, scratch):
    """Impulses `work.p` of the ground for the velocities ``v1 + free``; returns the contact problem's residual."""
    count = assembly.contacts.node.shape[0]
    for i in range(count):
        node = assembly.contacts.node[i]
        f = 6 * system.foot[i]
        for a in range(3):
            present = 0.0
            free = 0.0
            for k in range(6):
                present += work.rows[i, a, k] * work.v1[node, k]
                free += work.rows[i, a, k] * work.free[node, k]
            for k in range(3):
                present -= plane.axes[a, k] * plane.velocity[k]
            # a velocity moves the gap by theta h as well; dividing by this keeps the operator symmetric
            work.b[i, a] = free + ((present + work.gap[i] / h) / (1.0 + theta) if a == 0 else present)
        for r in range(work.compliance.shape[0]):
            for a in range(3):
                total = 0.0
                for k in range(6):
                    total += work.compliance[r, f + k] * work.rows[i, a, k]
                work.response[r, 3 * i + a] = total
    for i in range(count):
        f = 6 * system.foot[i]
        for a in range(3):
            for j in range(3 * count):
                total = 0.0
                for k in range(6):
                    total += work.rows[i, a, k] * work.response[f + k, j]
                work.W[3 * i + a, j] = total
    residual, _ = solve_friction(
        work.W, work.b, plane.static, plane.kinetic, work.touch, state.slide, work.p, work.w, scratch, tolerance,
        _CONTACT_ITERATIONS,
    )  # fmt: skip
    return residual


@njit(cache=True, nogil=True)
def add_ground_impulses(assembly, work, to):
    """Add the impulses `work.p` to the nodes' impulses `to` (n, 6)."""
    for i in range(assembly.contacts.node.shape[0]):
        node = assembly.contacts.node[i]
        for a in range(3):
            if work.p[i, a] != 0.0:
                for k in range(6):
                    to[node, k] += work.rows[i, a, k] * work.p[i, a]


@njit(cache=True, nogil=True)
def _unbalance(assembly, arm, work):
    """Largest entry of the impulses left, with those of ground and joints; moments over the length `arm`."""
    work.column[:] = 0.0
    add_ground_impulses(assembly, work, work.column)
    worst = 0.0
    for i in range(assembly.inertia.mass.shape[0]):
        if assembly.inertia.held[i] == 1:
            continue
        for c in range(6):
            part = abs(work.rhs[i, c] + work.column[i, c]) / (1.0 if c < 3 else arm)
            if not part <= worst:  # also true for a NaN
                worst = part
    return worst


@njit(cache=True, nogil=True)
def implicit_step(
    assembly, system, state, plane, h, theta, pull, load_factor, arm, tolerance, most, fresh, work, scratch
):
    """Try one step of length `h` from `state`; the end goes to `work`, `accept` takes it over.

    Parameters are tuples of arrays (see `rod.arrays`, `rod.system`, `rod.dynamics.arrays`); `pull` (k,) [mN] and
    `load_factor` (l,) are averages over the step; `arm` [mm] makes moments comparable with forces; `fresh` tells that
    the factors in `work.blocks` belong to this `h`. Returns the outcome, iterations, factorisations and residual.
    """
    n = assembly.inertia.mass.shape[0]
    angular_momentum(assembly.inertia, state.Q, state.v, work.spin0)
    held = assembly.inertia.held
    for i in range(n):
        for c in range(6):
            work.v1[i, c] = 0.0 if held[i] == 1 else state.v[i, c] + h * state.change[i, c]
    work.p[:] = state.impulse
    work.joint1[:] = state.joint
    count = assembly.contacts.node.shape[0]
    factorisations = 0
    since = 0
    residual = np.inf
    trouble = 0.0
    for iteration in range(most):
        scale = _residual(assembly, system, state, plane, h, theta, pull, load_factor, work.joint1, work)
        if scale < 0.0:
            return WOUND, iteration, factorisations, residual
        before = residual
        residual = _unbalance(assembly, arm, work)
        for j in range(work.joint_gap.shape[0]):
            for r in range(6):
                if assembly.constraints.rows[j, r] == 1:
                    # a joint's gap as the impulse that would close it is of the size of the others; compare lengths
                    work.rhs[n + j, r] = -(work.joint_rate[j, r] + work.joint_gap[j, r] / h) / (1.0 + theta)
                    if abs(work.rhs[n + j, r]) * h > tolerance * arm:
                        residual = max(residual, 2.0 * tolerance * scale)
                else:
                    work.rhs[n + j, r] = 0.0
        if not np.isfinite(residual):
            return SLOW, iteration, factorisations, residual
        if iteration > 0 and residual <= tolerance * scale and trouble <= CONTACT_ACCEPTED:
            return CONVERGED, iteration, factorisations, residual / max(scale, 1e-300)
        if not fresh or (since >= _STALE and residual > 0.1 * before):
            if not _factorise(assembly, system, state, h, theta, load_factor, work):
                return SINGULAR, iteration, factorisations, residual
            factorisations += 1
            fresh = True
            since = 0
        since += 1
        for i in range(n):
            if held[i] == 1:
                work.rhs[i] = 0.0
        work.free[:] = work.rhs
        solve(system.plan, work.blocks, work.free)
        if count > 0:
            work.touch[:] = state.touch
            trouble = ground_impulses(assembly, system, state, plane, h, theta, CONTACT_TOLERANCE, work, scratch)
            add_ground_impulses(assembly, work, work.rhs)
            solve(system.plan, work.blocks, work.rhs)
        else:
            work.rhs[:] = work.free
        for i in range(n):
            for c in range(6):
                work.v1[i, c] += work.rhs[i, c]
        for j in range(work.joint1.shape[0]):
            for r in range(6):
                work.joint1[j, r] += work.rhs[n + j, r]
    return (SLOW if trouble <= CONTACT_ACCEPTED else CONTACT), most, factorisations, residual


@njit(cache=True, nogil=True)
def accept(assembly, system, state, h, theta, pull, load_factor, work, book):
    """Take over the end of a converged step and enter its energies into `book` (see `dynamics.arrays.BOOK`)."""
    E = assembly.elements
    M = assembly.members
    inertia = assembly.inertia
    n = inertia.mass.shape[0]
    Js = np.empty((3, 3))
    _mean_velocity(state, theta, work)
    kinetic = 0.0
    integrator = 0.0
    for i in range(n):
        spatial_inertia(inertia.J[i], work.Q1[i], Js)
        for a in range(3):
            change = work.v1[i, a] - state.v[i, a]
            kinetic += 0.5 * inertia.mass[i] * work.v1[i, a] ** 2
            integrator += inertia.mass[i] * change * change
            for b in range(3):
                kinetic += 0.5 * work.v1[i, 3 + a] * Js[a, b] * work.v1[i, 3 + b]
                turned = (work.v1[i, 3 + a] - state.v[i, 3 + a]) * (work.v1[i, 3 + b] - state.v[i, 3 + b])
                integrator += Js[a, b] * turned
    damping = 0.0
    for e in range(E.nodes.shape[0]):
        for r in range(6):
            change = work.strain[e, r] - state.strain[e, r]
            elastic = E.length[e] * E.stiffness[e, r] * change * change
            integrator += elastic
            damping += elastic * assembly.damping[e] / h
    for k in range(M.law.shape[0]):
        change = work.lengths[k] - state.lengths[k]
        damping += M.viscosity[k] * change * change / h
    work.column[:] = 0.0
    add_member_forces(M, work.xm, work.Qm, pull, work.column)
    muscle = 0.0
    for i in range(n):
        for c in range(6):
            muscle += h * work.column[i, c] * work.vm[i, c]
    work.column[:] = 0.0
    add_loads(assembly.loads, load_factor, work.Qm, work.column)
    loads = 0.0
    for i in range(n):
        for c in range(6):
            loads += h * work.column[i, c] * work.vm[i, c]
    normal = 0.0
    friction = 0.0
    for k in range(assembly.contacts.node.shape[0]):
        node = assembly.contacts.node[k]
        for a in range(3):
            motion = 0.0
            for c in range(6):
                motion += work.rows[k, a, c] * work.vm[node, c]
            if a == 0:
                normal += work.p[k, a] * motion
            else:
                friction += work.p[k, a] * motion
    elastic_now, weight = energies(assembly, work.x1, work.strain, work.lengths)
    book[0] = kinetic
    book[1] = elastic_now
    book[2] = weight
    book[3] += muscle
    book[4] += loads
    book[5] -= damping
    book[6] += friction
    book[7] += normal
    work.column[:] = 0.0
    add_joints(
        assembly, system, work.x1, work.Q1, work.vm, work.joint_gap, work.joint_rate, work.joint1, work.column,
        work.blocks, False,
    )  # fmt: skip
    for i in range(n):
        for c in range(6):
            book[8] += work.column[i, c] * work.vm[i, c]
    book[9] -= (theta - 0.5) * integrator
    for i in range(n):
        for c in range(6):
            state.change[i, c] = (work.v1[i, c] - state.v[i, c]) / h
    state.x[:] = work.x1
    state.Q[:] = work.Q1
    state.v[:] = work.v1
    state.impulse[:] = work.p
    state.touch[:] = work.touch
    settle(work.b, work.w, state.touch, state.slide, CONTACT_TOLERANCE)
    state.joint[:] = work.joint1
    state.strain[:] = work.strain
    state.lengths[:] = work.lengths


@njit(cache=True, nogil=True)
def implicit_run(
    assembly, system, state, plane, h, theta, pulls, load_factors, arm, tolerance, most, work, scratch, book, tally
):
    """Make steps of length `h` until one fails or the tables end; `state` is where it got to.

    `pulls` (s + 1, k) and `load_factors` (s + 1, l) hold the values at the ends of the steps. `tally` takes sums over
    them: contact impulses (c, 3), time in slip and time in contact of each point, (c, 5). Returns the steps made, the
    outcome of the last try, iterations, factorisations, and the largest residual accepted.
    """
    pull = np.empty(pulls.shape[1])
    factors = np.empty(load_factors.shape[1])
    iterations = 0
    factorisations = 0
    worst = 0.0
    fresh = False
    for i in range(pulls.shape[0] - 1):
        for k in range(pull.shape[0]):
            pull[k] = theta * pulls[i + 1, k] + (1.0 - theta) * pulls[i, k]
        for k in range(factors.shape[0]):
            factors[k] = theta * load_factors[i + 1, k] + (1.0 - theta) * load_factors[i, k]
        outcome, tried, made, residual = implicit_step(
            assembly, system, state, plane, h, theta, pull, factors, arm, tolerance, most, fresh, work, scratch
        )
        iterations += tried
        factorisations += made
        if outcome != CONVERGED and fresh:
            # old factors may be to blame
            outcome, tried, made, residual = implicit_step(
                assembly, system, state, plane, h, theta, pull, factors, arm, tolerance, most, False, work, scratch
            )
            iterations += tried
            factorisations += made
        if outcome != CONVERGED:
            return i, outcome, iterations, factorisations, residual
        fresh = True
        worst = max(worst, residual)
        accept(assembly, system, state, h, theta, pull, factors, work, book)
        for k in range(tally.shape[0]):
            for a in range(3):
                tally[k, a] += work.p[k, a]
            if state.touch[k] == SLIP:
                tally[k, 3] += h
            if work.p[k, 0] > 0.0:
                tally[k, 4] += h
    return pulls.shape[0] - 1, CONVERGED, iterations, factorisations, worst
