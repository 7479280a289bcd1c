"""Our compiled kernels against scikit-fem's forms: forces, tangent, sparsity, turned nodes, matrix-vector product."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest
from scipy import sparse

from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.material import kernels as point_kernels
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid import kernels
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.records import Fix, Symmetry
from tests.helpers import box_mesh, generator, on_three_corners, plain_python, rotation, turned_about, unchanged
from tests.oracles.forms import Fields, FormOracle
from tests.oracles.laws import lame

SOFT, STIFF = NeoHooke(9.7, 0.47), NeoHooke(311.0, 0.41)
TENSION = 6.3
# sums of some hundred products: well below the asked 1e-12 of the largest entry
AGREE = 1e-13
# linear elements are asked for more than they bear, on purpose
pytestmark = pytest.mark.filterwarnings("ignore::fem_biobot.solid.space.LockingWarning")
KERNELS = ("deformation_gradient", "internal_force", "tangent")


@pytest.fixture(params=["compiled", "plain"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run the kernels compiled, and as the Python they were compiled from (on one cell's tetrahedra)."""
    with ExitStack() as stack:
        if request.param == "plain":
            stack.enter_context(plain_python(kernels, *KERNELS))
            stack.enter_context(plain_python(point_kernels, "extrapolated_stress"))
        yield request.param


def _mesh(mode: str) -> BodyMesh:
    n = (2, 2, 2) if mode == "compiled" else (1, 1, 2)
    return box_mesh(n, (1.3, 0.8, 1.1), layers=(0.5, 1.0), names=("muscle", "skeleton"))


def _model(mesh: BodyMesh, element: str = "P2", supports: list | None = None) -> SolidModel:
    n = len(mesh.regions["muscle"])
    draw = generator(4)
    a0 = draw.normal(size=(3, n))
    active = ActiveStress(TENSION * draw.uniform(0.2, 1.0, n), a0 / np.linalg.norm(a0, axis=0))
    supports = supports or on_three_corners((1.3, 0.8, 1.1))
    return SolidModel(mesh, {"muscle": SOFT, "skeleton": STIFF}, {"muscle": active}, supports, element=element)


def _fields(model: SolidModel, factor: float = 1.0) -> Fields:
    mesh = model.mesh
    n = mesh.n_elements
    mu, lmbda, tension, a0 = np.zeros(n), np.zeros(n), np.zeros(n), np.tile([[1.0], [0.0], [0.0]], n)
    for region, law in (("muscle", SOFT), ("skeleton", STIFF)):
        lmbda[mesh.regions[region]], mu[mesh.regions[region]] = lame(law.young, law.poisson)
    muscle = model.active["muscle"]
    tension[mesh.regions["muscle"]] = factor * muscle.tension
    a0[:, mesh.regions["muscle"]] = muscle.a0
    return Fields(mu, lmbda, tension, a0)


def _oracle(model: SolidModel) -> FormOracle:
    space, linear = model.system.space, model.system.space.element == "P1"
    return FormOracle(model.mesh.points, model.mesh.cells, space.points, linear=linear, degree=1 if linear else 2)


def _displacement(model: SolidModel) -> np.ndarray:
    """Stretch of some 30 %, shear and noise, without an inverted element, (n, 3)."""
    X = model.system.space.points.T
    draw = generator(21)
    u = X @ (0.25 * draw.normal(size=(3, 3))).T + 0.05 * np.sin(4.0 * X[:, ::-1]) + 0.01 * draw.normal(size=X.shape)
    F = model.system.deformation_gradient(u)
    J = np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1)))
    assert 0.2 < J.min() < 0.8
    assert np.abs(F - np.eye(3)[:, :, None, None]).max() > 0.5
    return u


def _full(model: SolidModel, data: np.ndarray) -> sparse.csr_matrix:
    p = model.system.pattern
    upper = sparse.csr_matrix((data, p.columns, p.starts), shape=(p.n_dofs, p.n_dofs))
    return upper + sparse.triu(upper, 1).T


@pytest.mark.parametrize("element", ["P2", "P1"])
def test_internal_force_and_tangent_are_those_of_the_forms(element: str, mode: str) -> None:
    """With S_geo = S force and tangent equal scikit-fem's, two regions, fibres of every element, large strain.

    Catches: a lost geometric stiffness, a packed component exchanged, the tension left out of D, dV squared.
    """
    model = _model(_mesh(mode), element)
    system, u = model.system, _displacement(model)
    points = system.points(system.deformation_gradient(u), 0.8)
    with unchanged(u, points.F, points.S, points.D):
        force, magnitude = system.internal_force(points)
        K = _full(model, system.tangent(points.F, points.S, points.D)).toarray()
    oracle, fields = _oracle(model), _fields(model, 0.8)
    expected = oracle.internal_force(u, fields)
    np.testing.assert_allclose(force, expected, rtol=0.0, atol=AGREE * np.abs(expected).max())
    K_oracle = oracle.tangent(u, fields).toarray()
    np.testing.assert_allclose(K, K_oracle, rtol=0.0, atol=AGREE * np.abs(K_oracle).max())
    assert np.all(magnitude >= np.abs(force) * (1.0 - 1e-12))


@pytest.mark.parametrize("element", ["P2", "P1"])
def test_sparsity_is_that_of_the_forms(element: str) -> None:
    """Upper triangle, rows sorted with the diagonal first, an entry exactly where two nodes share an element.

    Catches: a block missing where the later node has the lower number, columns out of order, entries of no pair.
    """
    model = _model(_mesh("compiled"), element)
    p = model.system.pattern
    ours = _full(model, np.ones(len(p.columns))).toarray() != 0
    basis = _oracle(model)
    touching = np.zeros_like(ours)
    rank = np.empty_like(basis.order)
    rank[basis.order] = np.arange(len(rank))
    for dofs in rank[basis.basis.element_dofs].T:
        touching[np.ix_(dofs, dofs)] = True
    np.testing.assert_array_equal(ours, touching)
    for row in range(p.n_dofs):
        columns = p.columns[p.starts[row] : p.starts[row + 1]]
        assert columns[0] == row
        assert np.all(np.diff(columns) > 0)


def test_turned_nodes_are_assembled_in_their_own_axes(mode: str) -> None:
    """Nodes held along oblique axes, and on an oblique plane, turn rows and columns of the tangent.

    Catches: the turn applied to rows only, transposed, or with the axes of the other node of the pair.
    """
    Q = rotation(17)
    mesh = turned_about(_mesh(mode), Q)
    axes = tuple(tuple(float(x) for x in row) for row in rotation(3))
    supports = [Symmetry("x0"), Symmetry("z0"), Fix("y0", "x", axes=axes), Fix("corner_111", "xz", axes=axes)]
    model = _model(mesh, supports=supports)
    system, u = model.system, _displacement(model)
    assert len(np.unique(system.turned)) > 8
    points = system.points(system.deformation_gradient(u), 0.8)
    K = _full(model, system.tangent(points.F, points.S, points.D)).toarray()
    turn = np.zeros_like(K)
    for node, own in enumerate(system.turned):
        place = slice(3 * node, 3 * node + 3)
        turn[place, place] = np.eye(3) if own < 0 else system.held.axes[:, :, own]
    expected = turn @ _oracle(model).tangent(u, _fields(model, 0.8)).toarray() @ turn.T
    np.testing.assert_allclose(K, expected, rtol=0.0, atol=AGREE * np.abs(expected).max())
    v = generator(2).normal(size=u.shape)
    np.testing.assert_allclose(system.to_local(v).ravel(), turn @ v.ravel(), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(system.to_global(v).ravel(), turn.T @ v.ravel(), rtol=0.0, atol=1e-14)


def test_the_product_is_that_of_the_full_matrix(mode: str) -> None:
    """The product by the upper triangle equals that of the full symmetric matrix.

    Catches: the diagonal counted twice, the lower half left out.
    """
    model = _model(_mesh(mode))
    system, u = model.system, _displacement(model)
    points = system.points(system.deformation_gradient(u), 0.8)
    data = system.tangent(points.F, points.S, points.D)
    v = generator(7).normal(size=u.size)
    expected = _full(model, data) @ v
    with unchanged(data, v):
        found = system.product(data, v)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())


def test_blocked_unknowns_become_a_scaled_identity() -> None:
    """After `block` the rows and columns of held unknowns are those of a multiple of the identity, others untouched.

    Catches: rows blocked without their columns, the wrong diagonal place.
    """
    model = _model(_mesh("compiled"))
    system, u = model.system, _displacement(model)
    points = system.points(system.deformation_gradient(u), 0.8)
    data = system.tangent(points.F, points.S, points.D)
    before = _full(model, data).toarray()
    system.block(data)
    after = _full(model, data).toarray()
    held = system.held.dofs
    free = np.setdiff1d(np.arange(system.n_dofs), held)
    np.testing.assert_array_equal(after[np.ix_(free, free)], before[np.ix_(free, free)])
    assert not after[np.ix_(held, free)].any()
    scale = after[held[0], held[0]]
    assert scale > 0.0
    np.testing.assert_array_equal(after[np.ix_(held, held)], scale * np.eye(len(held)))


def test_the_carried_stress_is_the_linear_extrapolation(mode: str) -> None:
    """S_geo = S + D : sym(F^T dF): its error against the new stress falls with the square of the change, times two.

    Catches: shear counted once, the symmetric part not taken, F^T forgotten (all of slope 1).
    """
    model = _model(_mesh(mode))
    system, u = model.system, _displacement(model)
    F = system.deformation_gradient(u)
    points = system.points(F, 0.8)
    H = generator(11).normal(size=F.shape)
    eps = 2.0 ** -np.arange(7, 12)
    rest = []
    for e in eps:
        out = np.empty_like(points.S)
        with unchanged(F, points.S, points.D):
            point_kernels.extrapolated_stress(F, F + e * H, points.S, points.D, out)
        rest.append(np.linalg.norm(system.points(F + e * H, 0.8).S - out))
    assert abs(np.polyfit(np.log(eps), np.log(rest), 1)[0] - 2.0) < 0.1


def test_the_smallest_volume_ratio_is_found_with_its_element() -> None:
    """The kernel returns the least det F and where it is, and a NaN where there is one.

    Catches: the first element reported, NaN taken for large.
    """
    model = _model(_mesh("compiled"))
    F = model.system.deformation_gradient(_displacement(model))
    J = np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1)))
    compiled = point_kernels.smallest_volume_ratio
    for kernel in {compiled, getattr(compiled, "py_func", None)} - {None}:
        worst, element = kernel(F)
        assert element == J.min(axis=1).argmin()
        assert worst == pytest.approx(J.min(), rel=1e-13)
        broken = F.copy()
        broken[1, 2, 5, 1] = np.nan
        worst, element = kernel(broken)
        assert np.isnan(worst)
        assert element == 5
