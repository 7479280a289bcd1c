"""Compiled kernels of the two-node geometrically exact rod element: strains, internal force, consistent tangent.

The strains are constant along the element, so its axis is a helix. With the end frames ``R1, R2`` (columns are the
directors), ``phi = log(R1^T R2)``, the middle frame ``Rm = R1 exp(phi/2)`` and ``delta = x2 - x1``:

    kappa = phi / L,   eps = M(phi) Rm^T delta / L - e3,   M = a I + b phi phi^T,   a = A / sin A,   A = |phi| / 2,

and ``b = (1 - a) / |phi|^2``. This is the logarithm of the rigid motion between the ends divided by L, exact for every
rod of constant strain (arcs, helices, sheared and stretched), and objective. M is isotropic in phi, so all algebra
after the frames is done in spatial components: there ``phi`` stands for ``Rm phi``.

Turning by the spatial vectors ``t1, t2`` at the ends (``d = t2 - t1``) changes ``d phi = M d`` (components in Rm) and
spins the middle frame by ``(t1 + t2)/2 - c phi x d``, ``c = tan(A/2) / (4 A)``. Derived by hand from the right
Jacobian of the exponential; checked by Taylor remainders and against tests/oracles/rod.py.

An element with `sway` bends into an S under a shear force, as its stiffness against that says (`rod.discretisation`).
Its projection on the third director is shorter than its arc by the mean square of the S's slopes, which the third
strain gets back: ``eps_3 + sum of sway_i gamma_i^2 / 2`` with the excess shear ``gamma = eps - eps0``. Without it a
pulled element, soft in shear, would turn its directors away from its chord.

Limits: the turn between the ends must stay below pi (`strains` returns the largest, for the caller to refuse).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import zeta

from fem_biobot.compile_cache import BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.algebra.kernels import (  # noqa: E402
    add,
    add_outer,
    apply,
    combine,
    cross,
    dot,
    matrix_of,
    multiple,
    product,
    row_of,
    scaled,
    skew,
    transpose,
)
from fem_biobot.rod.rotation.kernels import angle_per_sine, quaternion  # noqa: E402

# a, b and c are sums over the poles of 1/sin and tan, z = A^2:
#     c = sum of 1/(k^2 pi^2 - z) over odd k,   -2 b = the same minus the sum over even k,   a = 1 - 4 z b.
# The nearest pole is kept, the rest is a power series: without cancellation at any angle, and to rounding up to pi,
# where a term is 1/36 of the one before at most.
_TERMS = 12
_POWER = np.arange(2.0, 2.0 * _TERMS + 1.0, 2.0)
_ODD = zeta(_POWER, 1.5) / (2.0 * math.pi) ** _POWER  # sum over k = 3, 5, ... of (k pi)^-power
_EVEN = zeta(_POWER, 2.0) / (2.0 * math.pi) ** _POWER  # sum over k = 4, 6, ...


@njit(**KERNEL, **BORROWS)
def _series(z, pole, coefficients):
    """Value and two derivatives of ``1/(pole - z) + sum coefficients[j] z^j``."""
    f0 = f1 = f2 = 0.0
    for i in range(_TERMS):
        f2 = f2 * z + f1
        f1 = f1 * z + f0
        f0 = f0 * z + coefficients[_TERMS - 1 - i]
    p = 1.0 / (pole - z)
    return f0 + p, f1 + p * p, 2.0 * (f2 + p * p * p)


@njit(**KERNEL, **BORROWS)
def _coefficients(q):
    """``a, b, c`` of ``q = |phi|^2``, each with its derivatives by q: (a, a', a''), (b, b', b''), (c, c')."""
    z = 0.25 * q
    c0, c1, c2 = _series(z, math.pi**2, _ODD)
    e0, e1, e2 = _series(z, 4.0 * math.pi**2, _EVEN)
    b0, b1, b2 = 0.5 * (e0 - c0), 0.125 * (e1 - c1), 0.03125 * (e2 - c2)
    # a = 1 - q b
    return (1.0 - q * b0, -b0 - q * b1, -2.0 * b1 - q * b2), (b0, b1, b2), (c0, 0.25 * c1)


@njit(**KERNEL, **BORROWS)
def _end(elements, e, i, x, Q):
    """End `i` of element `e`: its node, arm from the node, position, and directors (rows)."""
    node = elements.nodes[e, i]
    directors = matrix_of(Q, node)
    offset = elements.offset
    arm = apply(transpose(directors), (offset[e, i, 0], offset[e, i, 1], offset[e, i, 2]))
    t = elements.turn
    turn = (
        t[e, i, 0, 0],
        t[e, i, 0, 1],
        t[e, i, 0, 2],
        t[e, i, 1, 0],
        t[e, i, 1, 1],
        t[e, i, 1, 2],
        t[e, i, 2, 0],
        t[e, i, 2, 1],
        t[e, i, 2, 2],
    )
    return node, arm, combine(1.0, row_of(x, node), 1.0, arm), product(turn, directors)


@njit(**KERNEL, **BORROWS)
def _frame(elements, e, x, Q):
    """Both ends' nodes and arms, ``Rm^T``, and spatial ``phi`` and ``delta`` of element `e`."""
    node1, arm1, x1, Q1 = _end(elements, e, 0, x, Q)
    node2, arm2, x2, Q2 = _end(elements, e, 1, x, Q)
    w, v = quaternion(product(Q1, transpose(Q2)))
    # transpose of exp(phi/2) = I + [v]x + [v]x^2 / (1 + w), v = sin(|phi|/2) n
    f = 1.0 / (1.0 + w)
    half = add_outer(add(multiple(1.0 - f * dot(v, v)), -1.0, skew(v)), f, v, v)
    middle = product(half, Q1)
    g = angle_per_sine(w, v)
    phi = apply(transpose(middle), (g * v[0], g * v[1], g * v[2]))
    return node1, node2, arm1, arm2, middle, phi, combine(1.0, x2, -1.0, x1)


@njit(**KERNEL, **BORROWS)
def _moved(a, b, phi, v):
    """``M v``."""
    return combine(a, v, b * dot(phi, v), phi)


@njit(**KERNEL, **BORROWS)
def _pull(a, b, phi, N, y):
    """Gradient of ``N . M(phi) y`` by phi, symmetric in N and y."""
    Np, yp = dot(N, phi), dot(y, phi)
    s = 2.0 * (a[1] * dot(N, y) + b[1] * Np * yp)
    g = combine(yp, N, Np, y)
    return combine(s, phi, b[0], g)


@njit(**KERNEL, **BORROWS)
def _shear(elements, e, i, stretch):
    """Excess of the shear strain `i` of the material vector `stretch`, the length times strain."""
    return stretch / elements.length[e] - elements.eps0[e, i]


@njit(**KERNEL, **BORROWS)
def _leans(elements, e, middle, moved):
    """Derivatives of the third strain by the first two, ``sway_i gamma_i``; `moved` is the spatial ``M delta``."""
    stretch = apply(middle, moved)
    sway = elements.sway
    return sway[e, 0] * _shear(elements, e, 0, stretch[0]), sway[e, 1] * _shear(elements, e, 1, stretch[1])


@njit(**KERNEL, **BORROWS)
def strains(elements, x, Q, out):
    """Write the strains of all elements, (m, 6): ``eps`` [1] and ``kappa`` [1/mm] in material components.

    `x` (n, 3) [mm] and `Q` (n, 3, 3) [1] are positions and directors of the nodes. Returns the largest turn between the
    ends of an element [rad], or a NaN if there is one. Same as `strains` in tests/oracles/rod.py.
    """
    largest = 0.0
    for e in range(elements.nodes.shape[0]):
        _, _, _, _, middle, phi, delta = _frame(elements, e, x, Q)
        q = dot(phi, phi)
        a, b, _ = _coefficients(q)
        per_length = 1.0 / elements.length[e]
        stretch = apply(middle, _moved(a[0], b[0], phi, delta))
        turn = apply(middle, phi)
        for i in range(3):
            out[e, i] = stretch[i] * per_length
            out[e, 3 + i] = turn[i] * per_length
        out[e, 2] -= 1.0
        for i in range(2):
            out[e, 2] += 0.5 * elements.sway[e, i] * _shear(elements, e, i, stretch[i]) ** 2
        if not q <= largest:  # also true for a NaN
            largest = q
            if math.isnan(q):
                return q
    return math.sqrt(largest)


@njit(**KERNEL, **BORROWS)
def _resultants(middle, s, lean):
    """Spatial force and couple of the material resultants `s` (6,), which do work on the strains."""
    back = transpose(middle)
    return apply(back, (s[0] + lean[0] * s[2], s[1] + lean[1] * s[2], s[2])), apply(back, (s[3], s[4], s[5]))


@njit(**KERNEL, **BORROWS)
def _conjugates(phi, y, N, m, a, b, c):
    """What does work on d delta, on the mean turn and on ``d``: f, h, mu; and ``p``, on d phi (all spatial)."""
    f = _moved(a[0], b[0], phi, N)
    h = cross(f, y)
    p = combine(1.0, _pull(a, b, phi, N, y), 1.0, m)
    mu = combine(1.0, _moved(a[0], b[0], phi, p), c[0], cross(phi, h))
    return f, h, mu, p


@njit(**KERNEL, **BORROWS)
def add_forces(elements, x, Q, s, force):
    """Add to `force` (n, 6) [mN, uJ] the internal forces and moments on the nodes for the resultants `s` (m, 6).

    `s` holds force [mN] and couple [uJ] in material components. Moments are about the nodes, all components spatial;
    the forces of an element are in equilibrium, and they are the gradient of its energy when `s` is elastic. Same as
    `forces` in tests/oracles/rod.py.
    """
    for e in range(elements.nodes.shape[0]):
        node1, node2, arm1, arm2, middle, phi, y = _frame(elements, e, x, Q)
        a, b, c = _coefficients(dot(phi, phi))
        N, m = _resultants(middle, s[e], _leans(elements, e, middle, _moved(a[0], b[0], phi, y)))
        f, h, mu, _ = _conjugates(phi, y, N, m, a, b, c)
        moment1 = combine(1.0, combine(0.5, h, -1.0, mu), -1.0, cross(arm1, f))
        moment2 = combine(1.0, combine(0.5, h, 1.0, mu), 1.0, cross(arm2, f))
        for i in range(3):
            force[node1, i] -= f[i]
            force[node2, i] += f[i]
            force[node1, 3 + i] += moment1[i]
            force[node2, 3 + i] += moment2[i]


@njit(**KERNEL, **BORROWS)
def _slope(a, b, phi, v):
    """Derivative of ``M(phi) v`` by phi."""
    vp = dot(phi, v)
    along = combine(2.0 * a[1], v, 2.0 * b[1] * vp, phi)
    return add_outer(add_outer(multiple(b[0] * vp), 1.0, along, phi), b[0], phi, v)


@njit(**KERNEL, **BORROWS)
def _pull_slope(a, b, phi, N, y):
    """Derivative of `_pull` by phi, symmetric."""
    Np, yp, Ny = dot(N, phi), dot(y, phi), dot(N, y)
    g = combine(yp, N, Np, y)
    H = multiple(2.0 * (a[1] * Ny + b[1] * Np * yp))
    H = add_outer(H, 4.0 * (a[2] * Ny + b[2] * Np * yp), phi, phi)
    H = add_outer(add_outer(H, 2.0 * b[1], phi, g), 2.0 * b[1], g, phi)
    return add_outer(add_outer(H, b[0], N, y), b[0], y, N)


@njit(**KERNEL, **BORROWS)
def _turned_moduli(middle, c0, c1, c2):
    """``Rm diag(c) Rm^T``."""
    columns = (
        c0 * middle[0],
        c0 * middle[1],
        c0 * middle[2],
        c1 * middle[3],
        c1 * middle[4],
        c1 * middle[5],
        c2 * middle[6],
        c2 * middle[7],
        c2 * middle[8],
    )
    return product(transpose(middle), columns)


@njit(**KERNEL, **BORROWS)
def _turned_shear_moduli(middle, sway0, sway1, s, lean, c0, c1, c2):
    """``Rm (H^T diag(c) H + s diag(sway, 0)) Rm^T`` with the derivative H of the strains, s the third force."""
    l0, l1 = lean
    inner = (
        c0 + l0 * l0 * c2 + sway0 * s,
        l0 * l1 * c2,
        l0 * c2,
        l0 * l1 * c2,
        c1 + l1 * l1 * c2 + sway1 * s,
        l1 * c2,
        l0 * c2,
        l1 * c2,
        c2,
    )
    return product(transpose(middle), product(inner, middle))


@njit(**KERNEL, **BORROWS)
def _core(phi, y, N, m, moduli_N, moduli_m):
    """Derivatives of f, h, mu (spatial) by d delta, the mean turn and ``d``; `moduli` are divided by the length.

    Returns f, mu, then f by (d delta, mean, d), h by (mean, d), mu by d. The rest follows from symmetry: h and mu by
    d delta are the transposes, and mu by the mean turn is (h by d)^T - [mu]x, because spatial turns do not commute.
    """
    a, b, c = _coefficients(dot(phi, phi))
    f, h, mu, p = _conjugates(phi, y, N, m, a, b, c)
    M = add_outer(multiple(a[0]), b[0], phi, phi)
    G = _slope(a, b, phi, y)
    moved = product(M, moduli_N)
    f_y = product(moved, M)  # second derivatives of the energy by delta and phi, in the middle frame
    f_phi = add(_slope(a, b, phi, N), 1.0, product(moved, G))
    p_phi = add(_pull_slope(a, b, phi, N, y), 1.0, moduli_m)
    p_phi = add(p_phi, 1.0, product(transpose(G), product(moduli_N, G)))

    T = skew((-c[0] * phi[0], -c[0] * phi[1], -c[0] * phi[2]))  # spin of the middle frame by d
    Y = skew(y)
    f_mean = add(product(f_y, Y), -1.0, skew(f))
    V = product(f_phi, M)
    spun = product(f_mean, T)
    f_d = add(V, 1.0, spun)
    h_mean, h_d = scaled(-1.0, product(Y, f_mean)), scaled(-1.0, product(Y, f_d))

    U = product(Y, T)
    VU = product(transpose(V), U)
    hs = skew(h)
    mu_d = add(VU, 1.0, transpose(VU))
    mu_d = add(mu_d, 1.0, product(transpose(U), spun))
    inner = add(add(_slope(a, b, phi, p), 1.0, product(M, p_phi)), -c[0], hs)
    mu_d = add(mu_d, 1.0, product(inner, M))
    mu_d = add_outer(mu_d, 2.0 * c[1], cross(phi, h), phi)
    mu_d = add(mu_d, -1.0, product(add(product(T, hs), 1.0, skew(mu)), T))
    return f, mu, f_y, f_mean, f_d, h_mean, h_d, mu_d


@njit(**KERNEL, **BORROWS)
def _put(out, i, j, A, s):
    """Write ``s A`` into block (i, j) of `out`, ``A^T`` into block (j, i)."""
    for k in range(3):
        for m in range(3):
            value = s * A[3 * k + m]
            out[3 * i + k, 3 * j + m] = value
            out[3 * j + m, 3 * i + k] = value


@njit(**KERNEL, **BORROWS)
def _put_diagonal(out, i, A):
    """Write ``A`` into block (i, i) of `out`."""
    for k in range(3):
        for m in range(3):
            out[3 * i + k, 3 * i + m] = A[3 * k + m]


@njit(**KERNEL, **BORROWS)
def element_tangent(elements, e, x, Q, s, C, out):
    """Write the derivative of element `e`'s internal forces, (12, 12): force and moment of node 1, then of node 2.

    Columns are the spatial increments dx1, dtheta1, dx2, dtheta2 of the NODES, with ``Q`` turned as in
    `rod.rotation.turn`. `s` (6,) are the resultants of the geometric part, `C` (6,) their derivatives by the strains.
    Exact; symmetric but for the diagonal blocks of turns, where ``K - K^T = -[moment of the node]x``. Needs no scratch.
    """
    _, _, arm1, arm2, middle, phi, y = _frame(elements, e, x, Q)
    per_length = 1.0 / elements.length[e]
    a, b, _ = _coefficients(dot(phi, phi))
    lean = _leans(elements, e, middle, _moved(a[0], b[0], phi, y))
    N, m = _resultants(middle, s, lean)
    moduli_N = _turned_shear_moduli(
        middle, elements.sway[e, 0], elements.sway[e, 1], s[2] * per_length, lean,
        C[0] * per_length, C[1] * per_length, C[2] * per_length,
    )  # fmt: skip
    moduli_m = _turned_moduli(middle, C[3] * per_length, C[4] * per_length, C[5] * per_length)
    f, mu, A, f_mean, f_d, h_mean, h_d, mu_d = _core(phi, y, N, m, moduli_N, moduli_m)

    # mean turn and difference -> turns of the two ends
    half = scaled(0.5, f_mean)
    f1, f2 = add(half, -1.0, f_d), add(half, 1.0, f_d)
    mu_mean = add(transpose(h_d), -1.0, skew(mu))
    same, odd = add(mu_d, 0.25, h_mean), add(h_d, 1.0, mu_mean)
    K11, K22 = add(same, -0.5, odd), add(same, 0.5, odd)
    K12 = add(scaled(0.25, h_mean), -1.0, mu_d)
    K12 = add(K12, 0.5, add(h_d, -1.0, mu_mean))

    # ends -> nodes
    o1, o2, F = skew(arm1), skew(arm2), skew(f)
    P1, P2 = add(f1, 1.0, product(A, o1)), add(f2, -1.0, product(A, o2))
    f1t = transpose(f1)
    K11 = add(add(K11, 1.0, product(add(f1t, -1.0, F), o1)), -1.0, product(o1, P1))
    K12 = add(add(K12, -1.0, product(f1t, o2)), -1.0, product(o1, P2))
    K22 = add(add(K22, -1.0, product(add(transpose(f2), -1.0, F), o2)), 1.0, product(o2, P2))

    _put_diagonal(out, 0, A)
    _put_diagonal(out, 1, K11)
    _put_diagonal(out, 2, A)
    _put_diagonal(out, 3, K22)
    _put(out, 0, 2, A, -1.0)
    _put(out, 0, 1, P1, -1.0)
    _put(out, 0, 3, P2, -1.0)
    _put(out, 2, 1, P1, 1.0)
    _put(out, 2, 3, P2, 1.0)
    _put(out, 1, 3, K12, 1.0)
