"""The rod element: strains, forces as their gradient, exact tangent; compiled and as plain Python."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fem_biobot.rod.element import kernels
from fem_biobot.rod.element.arrays import Elements
from fem_biobot.rod.rotation.kernels import turn
from tests.helpers import generator, plain_python, rotation, taylor_slope, unchanged
from tests.oracles import rod as oracle

Array = np.ndarray

EPS = np.finfo(float).eps
# relative turns of the elements' ends [rad]: none, tiny, generic, large
TURNS = np.array([0.0, 1e-7, 0.02, 0.4, 1.1, 1.9, 2.5])
NAMES = tuple(name for name, value in vars(kernels).items() if hasattr(value, "py_func"))


@pytest.fixture(params=["compiled", "plain"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run the kernels compiled, and as the Python they were compiled from."""
    with ExitStack() as stack:
        if request.param == "plain":
            stack.enter_context(plain_python(kernels, *NAMES))
        yield request.param


def _generic(seed: int = 21) -> tuple[Elements, Array, Array]:
    """Elements on nodes of their own with offsets, turns, natural strains; strained by tens of per cent."""
    draw, m = generator(seed), len(TURNS)
    axes = draw.normal(size=(m, 3))
    phi = TURNS[:, None] * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    length = draw.uniform(0.6, 1.7, m)
    strain = np.hstack([0.3 * draw.normal(size=(m, 3)), phi / length[:, None]])
    elements = Elements(
        nodes=np.arange(2 * m).reshape(m, 2)[:, ::-1].copy(),
        offset=0.5 * draw.normal(size=(m, 2, 3)),
        turn=Rotation.random(2 * m, rng=draw).as_matrix().reshape(m, 2, 3, 3),
        length=length,
        eps0=0.1 * draw.normal(size=(m, 3)),
        kappa0=0.4 * draw.normal(size=(m, 3)),
        stiffness=draw.uniform(1.0, 6.0, (m, 6)),
        section=np.ones((m, 6)),
        sway=draw.uniform(0.3, 1.2, (m, 2)),
    )
    return elements, *_placed(elements, strain, draw)


def _placed(elements: Elements, strain: Array, draw: np.random.Generator) -> tuple[Array, Array]:
    """Positions and directors of the nodes that give the elements the constant `strain` (m, 6)."""
    m = len(elements.length)
    x, Q = np.empty((2 * m, 3)), np.empty((2 * m, 3, 3))
    for e in range(m):
        g = np.eye(4)
        g[:3, :3] = Rotation.random(rng=draw).as_matrix()
        g[:3, 3] = draw.normal(size=3)
        for i, frame in enumerate((g, g @ oracle.motion(strain[e], elements.length[e]))):
            node = elements.nodes[e, i]
            Q[node] = elements.turn[e, i].T @ frame[:3, :3].T
            x[node] = frame[:3, 3] - Q[node].T @ elements.offset[e, i]
    return x, Q


def _strains(elements: Elements, x: Array, Q: Array) -> Array:
    out = np.empty((len(elements.length), 6))
    kernels.strains(elements, x, Q, out)
    return out


def _excess(elements: Elements, x: Array, Q: Array) -> Array:
    return _strains(elements, x, Q) - np.hstack([elements.eps0, elements.kappa0])


def _energies(elements: Elements, x: Array, Q: Array) -> Array:
    return 0.5 * elements.length * np.sum(elements.stiffness * _excess(elements, x, Q) ** 2, axis=1)


def _resultants(elements: Elements, x: Array, Q: Array) -> Array:
    return elements.stiffness * _excess(elements, x, Q)


def _forces(elements: Elements, x: Array, Q: Array, s: Array | None = None) -> Array:
    force = np.zeros((len(x), 6))
    kernels.add_forces(elements, x, Q, _resultants(elements, x, Q) if s is None else s, force)
    return force


def _by_element(elements: Elements, nodal: Array) -> Array:
    """Values (n, 6) of the nodes as (12, m) of the elements."""
    return nodal[elements.nodes].reshape(-1, 12).T


def _tangents(elements: Elements, x: Array, Q: Array, s: Array, C: Array) -> Array:
    out = np.full((len(s), 12, 12), np.nan)
    for e in range(len(s)):
        kernels.element_tangent(elements, e, x, Q, s[e], C[e], out[e])
    return out


def _moved(x: Array, Q: Array, step: Array) -> tuple[Array, Array]:
    after = np.empty_like(Q)
    turn(Q, np.ascontiguousarray(step[:, 3:]), after)
    return x + step[:, :3], after


# --- strains ----------------------------------------------------------------------------------------------------------


def test_strains_are_the_logarithm_of_the_motion(mode: str) -> None:
    """Elements placed by the exponential of a strain show that strain, from no turn at all to 2.5 rad.

    Catches: M left out or inverted, the frame of one end for the middle one, turn or offset applied transposed.
    """
    elements, x, Q = _generic()
    with unchanged(x, Q, *elements):
        found = _strains(elements, x, Q)
    # a logarithm of a matrix by square roots: some hundred roundings
    np.testing.assert_allclose(found, oracle.strains(elements, x, Q), rtol=0.0, atol=1e-13)


def test_strains_of_a_helix_are_exact(mode: str) -> None:
    """One element across 2.4 rad of a helix has its curvature and torsion, no stretch and no shear.

    Catches: eps without M (the chord is shorter than the arc), curvature about the wrong director.
    """
    radius, pitch = 1.3, 0.4
    w = 1.0 / np.hypot(radius, pitch)
    L = 2.4 / w * 0.99
    nodes = np.array([0.7, 0.7 + L])
    c, s = np.cos(w * nodes), np.sin(w * nodes)
    x = np.stack([radius * c, radius * s, pitch * w * nodes], axis=1)
    normal = np.stack([-c, -s, 0 * c], axis=1)
    tangent = np.stack([-radius * w * s, radius * w * c, pitch * w + 0 * c], axis=1)
    Q = np.stack([normal, np.cross(tangent, normal), tangent], axis=1)
    elements = _single(L)
    # the frame turns about tangent and binormal: torsion t + curvature b
    expected = np.array([0.0, 0.0, 0.0, 0.0, radius * w**2, pitch * w**2])
    np.testing.assert_allclose(_strains(elements, x, Q)[0], expected, rtol=0.0, atol=8 * EPS)


def test_strains_of_a_circle_are_exact(mode: str) -> None:
    """A quarter and almost half a circle, stretched by a known factor, in one element.

    Catches: the chord for the arc; the turn's sine for the turn.
    """
    for angle, stretch in ((np.pi / 2, 1.0), (3.0, 1.25)):
        L = 1.7
        radius = stretch * L / angle
        x = np.array([[0.0, 0.0, 0.0], [radius * (1 - np.cos(angle)), 0.0, radius * np.sin(angle)]])
        Q = np.stack([np.eye(3), Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix().T])
        expected = np.array([0.0, 0.0, stretch - 1.0, 0.0, angle / L, 0.0])
        np.testing.assert_allclose(_strains(_single(L), x, Q)[0], expected, rtol=0.0, atol=16 * EPS)


def _single(L: float) -> Elements:
    return Elements(
        np.array([[0, 1]]),
        np.zeros((1, 2, 3)),
        np.tile(np.eye(3), (1, 2, 1, 1)),
        np.array([L]),
        np.zeros((1, 3)),
        np.zeros((1, 3)),
        np.ones((1, 6)),
        np.ones((1, 6)),
        np.zeros((1, 2)),
    )


def test_the_largest_turn_is_reported(mode: str) -> None:
    """It is what a caller refuses by; a broken state shows as a NaN wherever it is.

    Catches: the square returned, the last element's turn, a NaN hidden by a comparison.
    """
    elements, x, Q = _generic()
    out = np.empty((len(TURNS), 6))
    np.testing.assert_allclose(kernels.strains(elements, x, Q, out), 2.5, rtol=16 * EPS)
    Q[elements.nodes[2, 1]] = np.nan
    assert np.isnan(kernels.strains(elements, x, Q, out))


def _derivatives(f: Callable[[Array], Array], q: float, orders: int) -> list[float]:
    """Derivatives 0, 1, ... of an analytic function, by Cauchy's integral over a circle of radius 3 around `q`."""
    ring = np.exp(2j * np.pi * (np.arange(64) + 0.5) / 64)
    values = f(q + 3.0 * ring)
    return [math.factorial(k) / 3.0**k * np.mean(values * ring**-k).real for k in range(orders)]


@pytest.mark.parametrize("turn", [0.0, 1e-9, 1e-3, 1.3, 2.2, 3.1])
def test_coefficients_lose_no_digits(mode: str, turn: float) -> None:
    """a, b, c and their derivatives are those of the closed forms, integrated where these are sound.

    Catches: a term of the pole sums, a factor of a derivative, cancellation at small turns.
    """

    def a(q: Array) -> Array:
        return np.sqrt(q) / 2 / np.sin(np.sqrt(q) / 2)

    def b(q: Array) -> Array:
        return (1 - a(q)) / q

    def c(q: Array) -> Array:
        return np.tan(np.sqrt(q) / 4) / (2 * np.sqrt(q))

    found = kernels._coefficients(turn**2)
    # b'' is some 6e-5 while b on the circle is 0.04, with ten roundings: 2 * 0.04 / 9 * 10 EPS / 6e-5
    for values, f in zip(found, (a, b, c), strict=True):
        np.testing.assert_allclose(values, _derivatives(f, turn**2, len(values)), rtol=1500 * EPS)


# --- forces -----------------------------------------------------------------------------------------------------------


def test_forces_do_the_work_of_the_resultants(mode: str) -> None:
    """They agree with the oracle's, made by differentiating matrix exponentials, for resultants of any origin.

    Catches: the moment of an offset, half of the middle frame's spin, the slope of M; forces written, not added.
    """
    elements, x, Q = _generic()
    s = generator(6).normal(size=(len(TURNS), 6))
    with unchanged(x, Q, s, *elements):
        force = _forces(elements, x, Q, s)
    # the oracle solves with the slope of an exponential, whose condition is below 100
    np.testing.assert_allclose(force, oracle.forces(elements, x, Q, s), rtol=0.0, atol=1e-12)
    kernels.add_forces(elements, x, Q, s, force)
    np.testing.assert_allclose(force, 2.0 * _forces(elements, x, Q, s), rtol=0.0, atol=1e-13)


def test_forces_are_the_gradient_of_the_energy(mode: str) -> None:
    """Taylor remainder of every element's energy falls with slope 2 along a generic increment.

    Catches: any wrong or missing term of the force.
    """
    elements, x, Q = _generic()
    step = 0.4 * generator(14).normal(size=(len(x), 6))
    derivative = np.sum(_by_element(elements, _forces(elements, x, Q)) * _by_element(elements, step), axis=0)
    slopes = taylor_slope(lambda t: _energies(elements, *_moved(x, Q, t * step))[None], derivative)
    np.testing.assert_allclose(slopes, 2.0, atol=0.1)


def test_forces_of_an_element_are_in_equilibrium(mode: str) -> None:
    """Their sum and their moment about any point vanish.

    Catches: moments about the ends instead of the nodes, an arm that did not turn with its node.
    """
    elements, x, Q = _generic()
    force = _forces(elements, x, Q)
    total = force[elements.nodes].sum(axis=1)
    moment = total[:, 3:] + np.cross(x[elements.nodes], force[elements.nodes][:, :, :3]).sum(axis=1)
    size = np.abs(force).max()
    np.testing.assert_allclose(total[:, :3], 0.0, atol=4 * EPS * size)
    np.testing.assert_allclose(moment, 0.0, atol=64 * EPS * size)


def test_the_natural_configuration_is_free_of_force(mode: str) -> None:
    """Placed by its own natural strains, curved, twisted and sheared, no element pulls.

    Catches: natural strains taken in another frame; a force from M alone.
    """
    elements, _, _ = _generic()
    draw = generator(30)
    x, Q = _placed(elements, np.hstack([elements.eps0, elements.kappa0]), draw)
    scale = elements.stiffness.max()
    np.testing.assert_allclose(_forces(elements, x, Q), 0.0, atol=100 * EPS * scale)
    assert np.abs(_forces(elements, *_moved(x, Q, 1e-3 * draw.normal(size=(len(x), 6))))).max() > 1e-4


def test_a_rotation_of_everything_turns_forces_and_leaves_strains(mode: str) -> None:
    """Objectivity: under a generic rotation and shift.

    Catches: spatial and material components mixed anywhere; a strain that depends on the position.
    """
    elements, x, Q = _generic()
    R, shift = rotation(), np.array([1.0, -2.0, 0.5])
    turned = (x @ R.T + shift, np.ascontiguousarray(Q @ R.T))
    np.testing.assert_allclose(_strains(elements, *turned), _strains(elements, x, Q), rtol=0.0, atol=32 * EPS)
    before, after = _forces(elements, x, Q), _forces(elements, *turned)
    size = np.abs(before).max()
    np.testing.assert_allclose(after[:, :3], before[:, :3] @ R.T, rtol=0.0, atol=64 * EPS * size)
    np.testing.assert_allclose(after[:, 3:], before[:, 3:] @ R.T, rtol=0.0, atol=64 * EPS * size)


# --- tangent ----------------------------------------------------------------------------------------------------------


def test_the_tangent_is_the_derivative_of_the_forces(mode: str) -> None:
    """Taylor remainder of every element's twelve forces falls with slope 2 along a generic increment.

    Catches: any wrong or missing geometric term, offsets that do not turn, spins taken in material components.
    """
    elements, x, Q = _generic()
    step = 0.3 * generator(15).normal(size=(len(x), 6))
    K = _tangents(elements, x, Q, _resultants(elements, x, Q), elements.stiffness)
    derivative = np.einsum("eij,je->ie", K, _by_element(elements, step))
    slopes = taylor_slope(lambda t: _by_element(elements, _forces(elements, *_moved(x, Q, t * step))), derivative)
    np.testing.assert_allclose(slopes, 2.0, atol=0.1)


def test_the_tangent_takes_moduli_and_resultants_apart(mode: str) -> None:
    """With constant resultants and no moduli it is the derivative of the geometry alone; the rest is ``L B^T C B``.

    Catches: moduli or resultants taken from the elements, as damping adds to both.
    """
    elements, x, Q = _generic()
    draw = generator(16)
    s, C, step = draw.normal(size=(7, 6)), draw.uniform(0.5, 3.0, (7, 6)), 0.3 * draw.normal(size=(len(x), 6))
    with unchanged(x, Q, s, C, *elements):
        geometric = _tangents(elements, x, Q, s, 0.0 * C)
    derivative = np.einsum("eij,je->ie", geometric, _by_element(elements, step))
    slopes = taylor_slope(lambda t: _by_element(elements, _forces(elements, *_moved(x, Q, t * step), s)), derivative)
    np.testing.assert_allclose(slopes, 2.0, atol=0.1)
    # rows of L B: the forces of unit resultants
    LB = np.stack([_by_element(elements, _forces(elements, x, Q, np.tile(unit, (7, 1)))) for unit in np.eye(6)])
    material = np.einsum("kie,ek,kje,e->eij", LB, C, LB, 1.0 / elements.length)
    np.testing.assert_allclose(_tangents(elements, x, Q, s, C) - geometric, material, rtol=0.0, atol=1e-12)


def test_the_tangent_is_symmetric_but_for_the_nodes_moments(mode: str) -> None:
    """``K - K^T`` is ``-[moment]x`` in the diagonal block of each node's turn and zero elsewhere.

    Catches: a spurious unsymmetric term; a symmetrised tangent, with which Newton's method is not quadratic.
    """
    elements, x, Q = _generic()
    s = _resultants(elements, x, Q)
    K = _tangents(elements, x, Q, s, elements.stiffness)
    force = _by_element(elements, _forces(elements, x, Q))
    expected = np.zeros_like(K)
    for e in range(len(s)):
        for at in (3, 9):
            expected[e, at : at + 3, at : at + 3] = np.cross(np.eye(3), force[at : at + 3, e]).T  # -[force]x
    np.testing.assert_allclose(K - K.transpose(0, 2, 1), expected, rtol=0.0, atol=128 * EPS * np.abs(K).max())
    assert np.abs(expected).max() > 1.0
