"""Compiled solver of frictional contact condensed on the contact points, and the rule of stick and slip.

At c points, with impulses ``p`` and relative velocities ``w = b + W p`` (rows: normal, tangent 1, tangent 2),

* normal: ``0 <= w_n``, ``0 <= p_n``, ``w_n p_n = 0``;
* friction: ``p_T`` lies in ``p_n D`` and, among its points, makes ``-w_T . p_T`` largest (it opposes slip).

This is Coulomb's law itself, not the associated cone, so bodies do not lift when they slide. The unknowns solve the
natural map ``F(p) = p - P(p - w)`` (Alart and Curnier 1991), with P the projection of the normal part on ``>= 0`` and
of the tangential part on the set D scaled by the projected normal part.

Scales. The diagonal of W gives each point a normal and a tangential mobility; divided by powers of four next to them
all diagonals are about one, without any rounding. The velocity scale ``V`` is the largest tangential or approaching
velocity in `b`, the impulse scale of a point is ``V / mobility``. The residual is the largest entry of the natural
map over these: ``min(mobility p_n, w_n) / V`` for the normal part, ``|w_T| / V`` where a point sticks. Nothing else
is compared with a fixed number, so masses, steps and sizes may be anything.

Method. Semismooth Newton from the given impulses, with a proximal term in its matrix alone: a singular W (corners of a
rigid foot) is no obstacle and the answer is not changed by it; among many possible impulses one near the given ones is
found. Where that does not end, the corners are made soft (their mobility is raised), which has one solution, found by
Newton and by sweeps of block Gauss-Seidel with exact solutions point by point; softness is then taken away by factors
of ten and at last altogether. The last factors refine the answer until only rounding is left, so that what sticks
does not creep. Without a good start the order of the points enters only through rounding.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.friction.dense.kernels import factor, substitute  # noqa: E402
from fem_biobot.friction.natural_map.kernels import (  # noqa: E402
    natural_map,
    newton_system,
    rounding_floor,
    scaled,
    sweep,
    take_step,
    velocity_scale,
)

LIFTED, STICK, SLIP = 0, 1, 2
SLIP_MARGIN = 10.0  # slip is what exceeds the residual allowed by this factor

# of the scaled diagonal, round after round: small ones end fast, large ones keep the steps within the cones
_PROXIMAL = np.array([0.0, 1e-2, 1e-4, 1e-1, 1e-6, 1.0, 1e-3])
_BURST = 8  # Newton steps of the first round
_LONGEST_BURST = 48
_FIRST_SWEEPS = 6
_MOST_SWEEPS = 200
_ROUNDS_FROM_BEST = 4
_SHORTEST_STEP = 0.05
_REFINEMENTS = 3
_MOST_REFINEMENTS = 12
_NEAR = 1e-5  # proximal term that keeps impulses near the first guess; far above rounding, so that noise stays small
_LEAST_PROXIMAL = 1e-9
_SOFTNESS = np.array([1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5])  # of the scaled diagonal
_STAGE_TOLERANCE = 1e-6
_STAGE_ITERATIONS = 60


@njit(**KERNEL, **BORROWS)
def _take(n, values, to):
    for i in range(n):
        to[i] = values[i]


@njit(**KERNEL, **BORROWS)
def _newton_step(c, V, proximal, residual, shorten, S):
    """One Newton step on `S`; halved while the residual grows if `shorten`. Returns residual and size of the system."""
    n = 3 * c
    size = newton_system(c, proximal, S)
    if not factor(S.J, size, S.exchanged):
        return np.inf, size
    substitute(S.J, size, S.exchanged, S.step)
    _take(n, S.p, S.last)
    take_step(c, size, S)
    found = natural_map(c, V, S)
    if shorten and not found <= residual:
        for i in range(n):
            S.step[i] = S.p[i] - S.last[i]
        part = 0.5
        while not found <= residual and part > _SHORTEST_STEP:
            for i in range(n):
                S.p[i] = S.last[i] + part * S.step[i]
            found = natural_map(c, V, S)
            part *= 0.5
        if not found <= residual:  # the whole step may lead out of a corner
            for i in range(n):
                S.p[i] = S.last[i] + S.step[i]
            found = natural_map(c, V, S)
    return found, size


@njit(**KERNEL, **BORROWS)
def _refine(c, size, V, most, residual, S):
    """Repeat the last Newton step from `p` with its factors while that helps; `best` holds the answer.

    Returns the residual and whether only rounding is left.
    """
    n = 3 * c
    floor = rounding_floor(c, V, S)
    _take(n, S.p, S.best)
    for _ in range(most):
        if residual <= floor:
            break
        for row in range(size):
            S.step[row] = -S.F[S.place[row]]
        substitute(S.J, size, S.exchanged, S.step)
        for row in range(size):
            S.p[S.place[row]] += S.step[row]
        refined = natural_map(c, V, S)
        if not refined < residual:
            break
        _take(n, S.p, S.best)
        residual = refined
    return residual, residual <= floor


@njit(**KERNEL, **BORROWS)
def _search(c, V, S, proximal_least, tolerance, max_iterations):
    """Newton and Gauss-Seidel from `p`, answer in `best`. Returns residual, iterations, size of the last system."""
    n = 3 * c
    iterations = 0
    turn = 0
    size = 0
    sweeps = _FIRST_SWEEPS
    residual = natural_map(c, V, S)
    best = residual
    _take(n, S.p, S.best)
    _take(n, S.p, S.chain)
    while iterations < max_iterations:
        proximal = max(proximal_least, _PROXIMAL[turn % _PROXIMAL.size])
        for _ in range(min(_BURST * (1 + turn), _LONGEST_BURST)):
            if iterations >= max_iterations:
                break
            iterations += 1
            good = best <= tolerance  # then one step to polish the answer, which counts only if it does
            residual, size = _newton_step(c, V, proximal, residual, turn > 0, S)
            if residual < best:
                best = residual
                _take(n, S.p, S.best)
                if best <= tolerance:
                    best, done = _refine(c, size, V, _REFINEMENTS, best, S)
                    if done or proximal == proximal_least:
                        return best, iterations, size
                    _take(n, S.best, S.p)
                    residual = natural_map(c, V, S)
                    proximal = proximal_least
            if good:
                return best, iterations, size
            if residual == np.inf:
                break
        turn += 1
        # the best point first; later in turns with where the sweeps had come, or a bad best point would be kept for
        # ever
        from_best = turn <= _ROUNDS_FROM_BEST or turn % 2 == 0
        _take(n, S.best if from_best else S.chain, S.p)
        for _ in range(min(sweeps, max_iterations - iterations)):
            sweep(c, S)
            iterations += 1
        sweeps = min(2 * sweeps, _MOST_SWEEPS)
        _take(n, S.p, S.chain)
        residual = natural_map(c, V, S)
        if residual < best:
            best = residual
            _take(n, S.p, S.best)
    return best, iterations, size


@njit(**KERNEL, **BORROWS)
def _iterate(c, V, S, tolerance, max_iterations):
    """Solve the scaled problem: from the given impulses, else from softer and softer corners. Answer in `best`."""
    n = 3 * c
    residual = natural_map(c, V, S)
    _take(n, S.p, S.best)
    if residual <= tolerance and residual <= rounding_floor(c, V, S):
        return residual, 0
    residual, iterations, size = _search(c, V, S, _NEAR, tolerance, min(_BURST, max_iterations))
    if residual <= tolerance or iterations >= max_iterations:
        return residual, iterations
    for i in range(n):
        S.diagonal[i] = S.W[i, i]
    for i in range(n):
        S.best[i] = 0.0
    for stage in range(_SOFTNESS.size):
        _take(n, S.best, S.p)
        for i in range(n):
            S.W[i, i] = S.diagonal[i] + _SOFTNESS[stage]
        wanted = tolerance if stage == _SOFTNESS.size - 1 else _STAGE_TOLERANCE
        most = min(_STAGE_ITERATIONS, max_iterations - iterations)
        _, more, size = _search(c, V, S, _LEAST_PROXIMAL, wanted, most)
        iterations += more
    for i in range(n):
        S.W[i, i] = S.diagonal[i]
    _take(n, S.best, S.p)
    residual, done = _refine(c, size, V, _MOST_REFINEMENTS, natural_map(c, V, S), S)
    if not done and iterations < max_iterations:
        _take(n, S.best, S.p)
        residual, more, _ = _search(c, V, S, _LEAST_PROXIMAL, tolerance, max_iterations - iterations)
        iterations += more
    return residual, iterations


@njit(**KERNEL, **BORROWS)
def solve_cones(W, b, mu, p, w, scratch, tolerance, max_iterations):
    """Impulses and velocities of c frictional contact points.

    Parameters
    ----------
    W
        Velocity by impulse, (3c, 3c) or larger [1/kg]; positive semidefinite, any rank, nearly symmetric.
    b
        Velocity without contact, gap over step added to its normal part, (c, 3) [mm/s].
    mu
        Friction that resists slip along +t1, -t1, +t2, -t2, (c, 4) [1], not negative.
    p
        Impulses, (c, 3) [mN s]: the first guess, overwritten by the answer.
    w
        Written: velocities ``b + W p``, (c, 3) [mm/s].
    scratch
        Buffers from `friction.scratch.scratch(c)`, for this many points or more.
    tolerance
        Residual wanted, about 1e-12 [1]; it is then refined down to rounding where that is possible.
    max_iterations
        Newton steps and Gauss-Seidel sweeps altogether.

    Returns
    -------
    tuple
        Residual of what was reached [1], as defined on top of this module, and iterations. It is above `tolerance`
        where no solution was found, infinite where the input is not finite. Velocities are those of the impulses
        returned.

    Notes
    -----
    Impulses of corners of a rigid body are not unique: some near the first guess are found. Velocities are unique for
    small friction while no rigid foot turns as it slides; if one does, friction on it depends on how its corners
    share the load, which rigid bodies do not tell. For large friction Coulomb's law itself may have several
    solutions.
    """
    c = p.shape[0]
    n = 3 * c
    V = velocity_scale(b)
    presses = False
    finite = True
    for i in range(c):
        presses = presses or b[i, 0] < 0.0
        for k in range(3):
            finite = finite and abs(b[i, k]) < np.inf
    if not finite or not presses:
        for i in range(c):
            for k in range(3):
                p[i, k] = 0.0
                w[i, k] = b[i, k]
        return (0.0 if finite else np.inf), 0
    scaled(W, b, mu, p, scratch)
    residual, iterations = _iterate(c, V, scratch, tolerance, max_iterations)
    for j in range(n):
        p[j // 3, j % 3] = scratch.scale[j] * scratch.best[j]
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += W[i, j] * p[j // 3, j % 3]
        w[i // 3, i % 3] = b[i // 3, i % 3] + total
    return residual, iterations


@njit(**KERNEL, **BORROWS)
def _slips(w, i, threshold):
    """Whether point i touches and moves along the ground."""
    return w[i, 0] <= threshold and w[i, 1] * w[i, 1] + w[i, 2] * w[i, 2] > threshold * threshold


@njit(**KERNEL, **BORROWS)
def solve_friction(W, b, mu_static, mu_kinetic, state, slip, p, w, scratch, tolerance, max_iterations):
    """Impulses and velocities with static friction where points stick and kinetic friction where they slip.

    Stick or slip is decided from velocities, never from impulses: those of a rigid foot's corners are not unique.
    Within one call,

    1. points that STICK, and LIFTED ones that may land, are given static friction, points that SLIP kinetic friction;
    2. those with static friction that are found touching and moving become SLIP, and the problem is solved again;
    3. those that slipped before and are found moving backwards have come to rest within the step: they are tried with
       static friction once, and slip again only if that does not hold them.

    Every point changes at most three times, so it ends. A point that the second solution brings back to rest stays SLIP
    in this step, with kinetic friction; `settle` makes it STICK for the next. Landing counts as sticking because
    corners of a foot at rest may leave and touch within rounding; a caller that knows a point to land in motion may
    pass SLIP.

    Parameters
    ----------
    W, b, p, w, scratch, tolerance, max_iterations
        As in `solve_cones`; `max_iterations` holds for each solution.
    mu_static, mu_kinetic
        Friction as in `solve_cones`, (c, 4) [1]; kinetic not above static.
    state
        LIFTED, STICK or SLIP of every point at the start of the step, (c,); points that begin to slip are marked
        SLIP, none is unmarked. Pass a fresh copy in every iteration of a nonlinear step, or a passing iterate would
        begin a slip.
    slip
        Tangential velocity of every point at the end of the last step, (c, 2) [mm/s].

    Returns
    -------
    tuple
        Residual of the last solution [1], iterations of all.
    """
    c = p.shape[0]
    bound = scratch.bound[:c]
    held = scratch.held
    threshold = SLIP_MARGIN * tolerance * velocity_scale(b)
    for i in range(c):
        held[i] = 1 if state[i] != SLIP else 0  # 1: static friction; 0: kinetic; -1: kinetic until the end of the step
    residual = 0.0
    iterations = 0
    again = True
    while again:
        for i in range(c):
            for k in range(4):
                bound[i, k] = mu_static[i, k] if held[i] == 1 else mu_kinetic[i, k]
        residual, more = solve_cones(W, b, bound, p, w, scratch, tolerance, max_iterations)
        iterations += more
        again = False
        if not residual <= tolerance:
            break
        for i in range(c):
            if not _slips(w, i, threshold):
                continue
            changes = False
            if held[i] == 1:
                held[i] = -1
                state[i] = SLIP
                changes = True
            elif held[i] == 0 and w[i, 1] * slip[i, 0] + w[i, 2] * slip[i, 1] < 0.0:
                held[i] = 1
                changes = True
            if changes:
                for k in range(4):
                    again = again or mu_static[i, k] != mu_kinetic[i, k]
    return residual, iterations


@njit(**KERNEL, **BORROWS)
def settle(b, w, state, slip, tolerance):
    """Write `state` and `slip` at the end of a step that was accepted; `b`, `w`, `tolerance` as in `solve_friction`.

    A point is LIFTED when it leaves or stays away, SLIP when it touches and moves, STICK when it touches at rest,
    whatever impulse it carries.
    """
    threshold = SLIP_MARGIN * tolerance * velocity_scale(b)
    for i in range(w.shape[0]):
        slip[i, 0] = 0.0
        slip[i, 1] = 0.0
        if w[i, 0] > threshold:
            state[i] = LIFTED
        elif _slips(w, i, threshold):
            state[i] = SLIP
            slip[i, 0] = w[i, 1]
            slip[i, 1] = w[i, 2]
        else:
            state[i] = STICK
