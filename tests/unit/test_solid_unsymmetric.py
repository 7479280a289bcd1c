"""Laws without energy: the skew part of the tangent, its factorisation, and stability without symmetry."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from scipy import sparse

from fem_biobot.errors import SolveError
from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.linear import SuperLU, has_negative_eigenvalue
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.records import Fix, Pressure, Symmetry, Traction
from fem_biobot.solid.system import System
from fem_biobot.solid.unsymmetric import kernels
from tests.helpers import TIGHT, box_mesh, generator, on_three_corners, plain_python, rotation, turned_about, unit
from tests.oracles.forms import FormOracle

SIZE = (1.3, 0.8, 1.1)
FIBRE = unit(0.5, -0.4, 0.7)
SOFT, STIFF = NeoHooke(9.7, 0.42), NeoHooke(41.0, 0.37)
KERNELS = ("parted_moduli", "add_skew_stress", "skew_tangent", "add_skew_product")


@pytest.fixture(params=["compiled", "plain"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run the kernels compiled, and as the Python they were compiled from (on one cell's tetrahedra)."""
    if request.param == "plain":
        with plain_python(kernels, *KERNELS):
            yield request.param
    else:
        yield request.param


def _mesh(mode: str) -> BodyMesh:
    n = (2, 2, 2) if mode == "compiled" else (1, 1, 1)
    layers = {"layers": (0.5, 1.0), "names": ("muscle", "skeleton")} if mode == "compiled" else {}
    return box_mesh(n, SIZE, **layers)  # type: ignore[arg-type]


def _model(mesh: BodyMesh, fibre: np.ndarray = FIBRE, supports: list | None = None, **more: object) -> SolidModel:
    laws = {"muscle": SOFT, **({"skeleton": STIFF} if "skeleton" in mesh.regions else {})}
    active = {"muscle": ActiveStress(6.0, fibre, "cauchy")}
    return SolidModel(mesh, laws, active, supports or on_three_corners(SIZE), **more)  # type: ignore[arg-type]


def _bent(model: SolidModel) -> np.ndarray:
    X = model.system.space.points.T
    return X @ (0.2 * generator(21).normal(size=(3, 3))).T + 0.05 * np.sin(4.0 * X[:, ::-1])


def _dense(model: SolidModel, data: np.ndarray) -> np.ndarray:
    p = model.system.pattern
    even, odd = (sparse.csr_matrix((d, p.columns, p.starts), shape=(p.n_dofs, p.n_dofs)).toarray() for d in data)
    return even + np.triu(even, 1).T + odd - odd.T


def test_the_tangent_of_a_law_without_energy_is_that_of_the_form(mode: str) -> None:
    """Symmetric and skew part together are int grad v : dP/dF : grad du of tension per current area, nodes turned too.

    Catches: half the skew part, its sign where the later node has the lower number, shears counted once.
    """
    Q = rotation(17)
    axes = tuple(tuple(float(x) for x in row) for row in rotation(3))
    supports = [Symmetry("x0"), Symmetry("z0"), Fix("y0", "x", axes=axes), Fix("corner_111", "xz", axes=axes)]
    model = _model(turned_about(_mesh(mode), Q), Q @ FIBRE, supports)
    system, u = model.system, _bent(model)
    assert not system.symmetric
    points = system.points(system.deformation_gradient(u), 0.8)
    K = _dense(model, system.matrix(points, points.S))
    oracle = FormOracle(model.mesh.points, model.mesh.cells, system.space.points)
    tension = system.contractions[0].law.scaled(0.8)
    expected = np.zeros_like(K)
    for region, elements in model.mesh.regions.items():
        laws = [model.materials[region]]
        if region == "muscle":
            laws.append(tension.at(elements) if hasattr(tension, "at") else tension)  # type: ignore[attr-defined]
        expected += oracle.tangent_of(u, laws, elements).toarray()
    turn = np.zeros_like(K)
    for node, own in enumerate(system.turned):
        place = slice(3 * node, 3 * node + 3)
        turn[place, place] = np.eye(3) if own < 0 else system.held.axes[:, :, own]
    expected = turn @ expected @ turn.T
    assert np.abs(expected - expected.T).max() > 5e-3 * np.abs(expected).max()
    np.testing.assert_allclose(K, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_the_carried_stress_has_its_skew_part(mode: str) -> None:
    """The error of the stress carried along falls with the square of the change.

    Catches: the skew part of the moduli left out of what is carried (slope 1).
    """
    model = _model(_mesh(mode))
    system, u = model.system, _bent(model)
    F = system.deformation_gradient(u)
    points = system.points(F, 1.0)
    H = generator(11).normal(size=F.shape)
    eps = 2.0 ** -np.arange(7, 12)
    rest = [np.linalg.norm(system.points(F + e * H, 1.0).S - system.carry(points, F + e * H, np.zeros(0))) for e in eps]
    assert abs(np.polyfit(np.log(eps), np.log(rest), 1)[0] - 2.0) < 0.1


@pytest.mark.parametrize("element", ["P2", "P2-P1"])
def test_tension_per_current_area_converges_quadratically(element: str) -> None:
    """The last iterations of a step each square the residual; the unsymmetric factorisation is named.

    Catches: the symmetric part alone (a factor of some tenths an iteration).
    """
    residuals: list[float] = []
    found = solve(
        _model(_mesh("compiled"), element=element),
        [0.5, 1.0],
        settings=TIGHT,
        observe=lambda kind, v: residuals.append(v["residual"]) if kind == "iteration" else None,
    )
    assert "unsymmetric" in found.linear_solver or found.linear_solver == SuperLU.name
    last = residuals[-4:-1]
    assert all(after < 0.05 * before for before, after in pairwise(last))
    assert found.halvings == 0


def test_a_column_with_an_unsymmetric_matrix_buckles_too() -> None:
    """A column under dead load and a small follower pressure on its top stands below Euler's load and not above.

    Catches: no stability check without symmetry.
    """
    E, length = 100.0, 10.0
    euler = np.pi**2 * E / 12.0 / (4.0 * length**2)
    model = SolidModel(
        box_mesh((2, 2, 8), (1.0, 1.0, length), shift=0.0),
        {"muscle": NeoHooke(E, 0.0)},
        supports=[Fix("z0")],
        loads=[Traction("z1", (0.0, 0.0, -euler)), Pressure("z1", 1e-3 * euler)],
    )
    assert not model.system.symmetric
    assert len(solve(model, [0.9]).states) == 1
    with pytest.raises(SolveError, match="positive definite"):
        solve(model, [1.6])


def test_a_negative_eigenvalue_near_zero_is_seen() -> None:
    """Of two matrices without symmetry, one with a negative real eigenvalue and one with none, only the first is told.

    Catches: the sign of the inverse's eigenvalues lost, complex pairs taken for real.
    """
    model = _model(_mesh("compiled"))
    system = model.system
    points = system.points(system.deformation_gradient(np.zeros((system.space.n_nodes, 3))), 0.0)
    data = system.matrix(points, points.S)
    system.block(data)
    # complex pairs only: a strong skew part
    data[1] += 0.3 * np.abs(data[0]).mean() * generator(2).normal(size=data.shape[1])
    data[1, system.pattern.starts[:-1]] = 0.0
    factor = SuperLU(system.pattern, symmetric=False)
    factor.factor(data)
    assert np.linalg.eigvals(_dense(model, data)).real.min() > 0.0
    assert not has_negative_eigenvalue(factor, system.pattern)
    free = np.setdiff1d(np.arange(system.n_dofs), system.held.dofs)[40]
    data[:, :] = np.where(
        (np.repeat(np.arange(system.n_dofs), np.diff(system.pattern.starts)) == free)
        | (system.pattern.columns == free),
        0.0,
        data,
    )
    data[0, system.pattern.starts[free]] = -1e-3
    factor.factor(data)
    assert has_negative_eigenvalue(factor, system.pattern)


def _residuals(model: SolidModel) -> list[float]:
    """Of the iterations of one step from rest, none halved."""
    seen: list[float] = []
    found = solve(
        model,
        [1.0],
        settings=NewtonSettings(tolerance=1e-12, max_iterations=40, max_cg=200),
        observe=lambda kind, v: seen.append(v["residual"]) if kind == "iteration" else None,
    )
    assert found.halvings == 0
    return seen


@pytest.mark.parametrize("which", ["tension", "pressure", "both"])
def test_the_residual_is_squared_with_the_whole_tangent_and_not_with_its_symmetric_part(
    which: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tension per current area, and pressure on a free surface: the last residuals fall as r -> C r^2.

    Measured as the order ``log(r3 / r2) / log(r2 / r1)`` of the last three above rounding; with the skew part of the
    matrix put to zero the same model needs more iterations and its order is one. The tension alone: 0.31, 0.38, 0.06,
    9.4e-3, 4.4e-4, 1.4e-6, 2.3e-11, against 2.7e-5, 2e-6, 2.9e-7, 2.2e-8, ... with the symmetric part.

    Catches: a skew part lost on the way to the factorisation, of one of the two sources only, or of the wrong sign.
    """
    active = {} if which == "pressure" else {"muscle": ActiveStress(3.0, FIBRE, "cauchy")}
    loads = [] if which == "tension" else [Pressure("x1", 0.4)]
    model = SolidModel(box_mesh(2, SIZE), {"muscle": SOFT}, active, [Fix("x0")], loads)
    assert not model.system.symmetric
    whole = _residuals(model)
    assert _order(whole) > 1.6
    if which == "both":  # the symmetric part does not get there at all
        return
    original = System.matrix

    def even(self: System, *args: object, **kwargs: object) -> np.ndarray:
        data = original(self, *args, **kwargs)  # type: ignore[arg-type]
        data[1] = 0.0
        return data

    monkeypatch.setattr(System, "matrix", even)
    half = _residuals(model)
    assert len(half) > len(whole) + 1
    assert _order(half) < 1.4


def _order(residuals: list[float]) -> float:
    """Order of the last three residuals that are not rounding."""
    one, two, three = [r for r in residuals if r > 1e-13][-3:]
    return float(np.log(three / two) / np.log(two / one))
