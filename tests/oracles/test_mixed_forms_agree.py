"""The mixed form's compiled kernels against scikit-fem's forms: forces, volume residuals, matrix, sparsity."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from scipy import sparse

from fem_biobot.material import ActiveStress
from fem_biobot.material.volume import LINEAR, LOG, QUADRATIC, volume_measure
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.mixed import kernels
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.records import Fix, Symmetry
from tests.helpers import box_mesh, generator, on_three_corners, plain_python, rotation, turned_about, unchanged, unit
from tests.mixed import MEASURES, Split, plain_measure, rest
from tests.oracles.forms import Fields, FormOracle, PressureOracle, PressurePart

SIZE = (1.3, 0.8, 1.1)
MU = {"muscle": 3.4, "skeleton": 107.0}
BULK = {"muscle": np.inf, "skeleton": 930.0}
FIBRE, TENSION = unit(0.5, -0.4, 0.7), 6.3
# sums of some hundred products; g itself is a difference of numbers near 1
AGREE = 1e-12
KERNELS = ("volumetric_points", "volume_residual", "coupling", "add_pressure_change", "volume_measure")


@pytest.fixture(params=["compiled", "plain"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run the kernels compiled, and as the Python they were compiled from (on one cell's tetrahedra)."""
    if request.param == "plain":
        with plain_python(kernels, *KERNELS):
            yield request.param
    else:
        yield request.param


def _mesh(mode: str = "compiled") -> BodyMesh:
    n = (2, 2, 2) if mode == "compiled" else (1, 1, 2)
    return box_mesh(n, SIZE, layers=(0.5, 1.0), names=("muscle", "skeleton"))


def _model(mesh: BodyMesh, measure: int, supports: list | None = None) -> SolidModel:
    laws = {name: Split(rest(MU[name]), BULK[name], measure) for name in MU}
    active = {"muscle": ActiveStress(TENSION, FIBRE)}
    return SolidModel(mesh, laws, active, supports or on_three_corners(SIZE), element="P2-P1")


def _state(model: SolidModel) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (n, 3) of some 30 % strain, J away from 1, and pressures (m,)."""
    X = model.system.space.points.T
    draw = generator(21)
    u = X @ (0.25 * draw.normal(size=(3, 3))).T + 0.05 * np.sin(4.0 * X[:, ::-1]) + 0.01 * draw.normal(size=X.shape)
    return u, 5.0 * draw.normal(size=model.system.n_pressures)


def _expected(model: SolidModel, u: np.ndarray, p: np.ndarray, measure: int) -> tuple[np.ndarray, np.ndarray]:
    """Residual and dense matrix in the oracles' own unscaled pressures, in the order of our unknowns."""
    mesh, system = model.mesh, model.system
    n = mesh.n_elements
    mu, tension = np.zeros(n), np.zeros(n)
    for name, elements in mesh.regions.items():
        mu[elements] = MU[name]
    tension[mesh.regions["muscle"]] = TENSION
    fields = Fields(mu, np.zeros(n), tension, np.tile(FIBRE[:, None], n))
    oracle = FormOracle(mesh.points, mesh.cells, system.space.points)
    force, K = oracle.internal_force(u, fields), oracle.tangent(u, fields).toarray()
    first, m = 0, system.n_pressures
    volume, B, C = np.zeros(m), np.zeros((len(K), m)), np.zeros((m, m))
    for name, elements in mesh.regions.items():
        part = PressurePart(elements, BULK[name], lambda J: plain_measure(J, measure))
        mine = PressureOracle(oracle, mesh.points, mesh.cells, part)
        own = slice(first, first + len(mine.vertices))
        first = own.stop
        assert system.mixed is not None
        np.testing.assert_array_equal(system.mixed.field.vertex[own], mine.vertices)
        push, volume[own] = mine.forces(u, p[own])
        force = force + push
        more, B[:, own], C[own, own] = mine.matrix(u, p[own])
        K = K + more
    assert first == m
    return np.concatenate([force.ravel(), volume]), np.block([[K, B], [B.T, C]])


def _full(model: SolidModel, data: np.ndarray) -> np.ndarray:
    p = model.system.pattern
    upper = sparse.csr_matrix((data, p.columns, p.starts), shape=(p.n_dofs, p.n_dofs)).toarray()
    return upper + np.triu(upper, 1).T


def _units(model: SolidModel) -> np.ndarray:
    """What a unit of each of our unknowns is in displacement and pressure."""
    mixed = model.system.mixed
    assert mixed is not None
    return np.concatenate([np.ones(model.n_dofs - mixed.field.n), mixed.field.scale])


@pytest.mark.parametrize("measure", MEASURES.values(), ids=MEASURES)
def test_residual_and_matrix_are_those_of_the_forms(measure: int, mode: str) -> None:
    """Two regions, one incompressible, contracting, at large strain with arbitrary pressures.

    Catches: a lost second derivative of g, C^-1 for its square, compliance of the wrong region, a pressure node shared
    across the interface, rows of a node displaced by one, the scale taken once for twice.
    """
    model = _model(_mesh(mode), measure)
    system = model.system
    u, p = _state(model)
    points = system.points(system.deformation_gradient(u), 1.0, p)
    assert np.abs(np.linalg.det(np.moveaxis(points.F, (0, 1), (-2, -1))) - 1.0).min() > 1e-3
    with unchanged(u, p, *points[:4]):
        force, _ = system.internal_force(points)
        r = system.residual(points, force, np.zeros_like(force))
        K = _full(model, system.matrix(points, points.S))
    expected_r, expected = _expected(model, u, p, measure)
    scale = _units(model)
    expected_r, expected = expected_r * scale, expected * np.outer(scale, scale)
    np.testing.assert_allclose(r, expected_r, rtol=0.0, atol=AGREE * np.abs(expected_r).max())
    np.testing.assert_allclose(K, expected, rtol=0.0, atol=AGREE * np.abs(expected).max())
    n = len(r) - system.n_pressures
    # each block on its own scale, for the pressures' entries are small
    for rows, columns in ((slice(n), slice(n, None)), (slice(n, None), slice(n, None))):
        block = expected[rows, columns]
        np.testing.assert_allclose(K[rows, columns], block, rtol=0.0, atol=AGREE * np.abs(block).max())


def test_turned_nodes_couple_in_their_own_axes(mode: str) -> None:
    """Nodes held along oblique axes turn the rows of the coupling too.

    Catches: the coupling left in global axes, the transposed turn.
    """
    mesh = turned_about(_mesh(mode), rotation(17))
    axes = tuple(tuple(float(x) for x in row) for row in rotation(3))
    supports = [Symmetry("x0"), Symmetry("z0"), Fix("y0", "x", axes=axes), Fix("corner_111", "xz", axes=axes)]
    model = _model(mesh, LOG, supports)
    system = model.system
    u, p = _state(model)
    points = system.points(system.deformation_gradient(u), 1.0, p)
    K = _full(model, system.matrix(points, points.S))
    turn = np.eye(len(K))
    for node, own in enumerate(system.turned):
        if own >= 0:
            turn[3 * node : 3 * node + 3, 3 * node : 3 * node + 3] = system.held.axes[:, :, own]
    scale = _units(model)
    expected = turn @ (_expected(model, u, p, LOG)[1] * np.outer(scale, scale)) @ turn.T
    np.testing.assert_allclose(K, expected, rtol=0.0, atol=AGREE * np.abs(expected).max())


def test_rows_are_sorted_and_couple_what_shares_an_element() -> None:
    """Upper triangle, diagonal first, pressures behind displacements, an entry exactly where unknowns meet.

    Catches: pressures of two regions coupled, columns out of order, a coupling left out.
    """
    model = _model(_mesh(), LOG)
    p, mixed = model.system.pattern, model.system.mixed
    assert mixed is not None
    ours = _full(model, np.ones(len(p.columns))) != 0
    n = p.n_dofs - p.n_pressures
    touching = np.zeros_like(ours)
    for e in range(model.mesh.n_elements):
        dofs = (3 * model.system.space.nodes[:, e][:, None] + np.arange(3)).ravel()
        dofs = np.concatenate([dofs, n + mixed.field.nodes[:, e]])
        touching[np.ix_(dofs, dofs)] = True
    np.testing.assert_array_equal(ours, touching)
    for row in range(p.n_dofs):
        columns = p.columns[p.starts[row] : p.starts[row + 1]]
        assert columns[0] == row
        assert np.all(np.diff(columns) > 0)


@pytest.mark.parametrize("measure", [LOG, LINEAR, QUADRATIC])
def test_the_kernels_measure_is_that_of_the_laws(measure: int) -> None:
    """g and its derivatives equal `material.volume`'s on both sides of the switch between series and closed form.

    Catches: another numbering of the measures, a sign in the series.
    """
    compiled = kernels.volume_measure
    J = np.array([0.3, 0.79, 0.81, 0.97, 1.0 - 1e-9, 1.0, 1.002, 1.19, 1.21, 2.5])
    for kernel in {compiled, getattr(compiled, "py_func", compiled)}:
        found = np.array([kernel(x, measure) for x in J]).T
        np.testing.assert_allclose(found, volume_measure(J, measure), rtol=1e-12, atol=1e-13)
