"""Mass matrix, natural frequencies of bodies, and loss of stability: properties and refusals."""

from __future__ import annotations

import numpy as np
import pytest
import skfem
from scipy import sparse
from scipy.linalg import eigh

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid import modes as module
from fem_biobot.solid.linear import SuperLU
from fem_biobot.solid.mass import mass_matrix
from fem_biobot.solid.model import SolidModel, SolidState, buckling, solve
from fem_biobot.solid.modes import modes
from fem_biobot.solid.records import Fix, Foundation, Pressure, Step, Symmetry, Traction
from tests.helpers import TIGHT, box_mesh, on_three_corners, rotation, turned_about, unit

SIZE = (1.0, 0.8, 1.2)
MESH = box_mesh((2, 2, 2), SIZE, layers=(0.5, 1.0), names=("muscle", "skeleton"))
DENSITIES = {"muscle": 1.06e-6, "skeleton": 1.4e-6}
every_element = pytest.mark.parametrize("element", ["P2", "P1", "P2-P1"])


def _model(element: str = "P2", mesh: BodyMesh = MESH, supports: list | None = None, **more: object) -> SolidModel:
    laws = {"muscle": NeoHooke(10.0, 0.3), "skeleton": NeoHooke(60.0, 0.4)}
    return SolidModel(mesh, laws, supports=supports or on_three_corners(SIZE), element=element, **more)  # type: ignore[arg-type]


def _rest(model: SolidModel) -> SolidState:
    return SolidState(model, Step(0.0, 0.0), np.zeros_like(model.system.space.points))


def _dense(model: SolidModel, data: np.ndarray) -> np.ndarray:
    p = model.system.pattern
    upper = sparse.csr_matrix((data, p.columns, p.starts), shape=(p.n_dofs, p.n_dofs)).toarray()
    return upper + np.triu(upper, 1).T


@every_element
def test_the_mass_matrix_is_that_of_the_form(element: str) -> None:
    """Entries equal scikit-fem's int rho u . v, in each node's own axes; pressures have no mass.

    Catches: transposed places, the density of another region, a quadrature that is too low, turned nodes left out.
    """
    Q = rotation(17)
    mesh = turned_about(MESH, Q)
    model = _model(element, mesh, [Symmetry("x0"), Symmetry("z0"), Fix("y0")])
    system = model.system
    assert len(np.unique(system.turned)) > 4
    M = _dense(model, mass_matrix(system, mesh, DENSITIES))
    shape = skfem.ElementTetP1() if element == "P1" else skfem.ElementTetP2()
    basis = skfem.Basis(system.space.mesh, skfem.ElementVector(shape), intorder=4)
    rho = np.zeros((mesh.n_elements, 1))
    for name, density in DENSITIES.items():
        rho[mesh.regions[name]] = density
    form = skfem.BilinearForm(lambda u, v, w: w.rho * np.einsum("i...,i...->...", u, v))
    expected = form.assemble(basis, rho=np.broadcast_to(rho, basis.dx.shape)).toarray()
    n = len(expected)
    turn = np.zeros_like(expected)
    for node, own in enumerate(system.turned):
        place = slice(3 * node, 3 * node + 3)
        turn[place, place] = np.eye(3) if own < 0 else system.held.axes[:, :, own]
    expected = turn @ expected @ turn.T
    np.testing.assert_allclose(M[:n, :n], expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())
    assert not M[n:].any()


@pytest.mark.parametrize("free", [False, True])
def test_frequencies_are_those_of_the_dense_problem(free: bool) -> None:
    """The lowest squares and shapes solve K u = w^2 M u, held or free; shapes have unit kinetic energy.

    Catches: mass of held unknowns counted, a shift above the lowest mode, shapes not normalised.
    """
    model = _model()
    system, state = model.system, _rest(model)
    found = modes(state, DENSITIES, 9, free=free)
    points = system.points(state.F, 0.0)
    K = _dense(model, system.matrix(points, points.S))
    M = _dense(model, mass_matrix(system, MESH, DENSITIES))
    keep = np.arange(system.n_dofs) if free else np.setdiff1d(np.arange(system.n_dofs), system.held.dofs)
    squares = eigh(K[np.ix_(keep, keep)], M[np.ix_(keep, keep)], eigvals_only=True)[:9]
    np.testing.assert_allclose(found.squares, squares, rtol=1e-7, atol=1e-8 * squares[-1])
    np.testing.assert_allclose(found.frequencies[6 * free :], np.sqrt(squares[6 * free :]) / (2 * np.pi), rtol=1e-7)
    assert np.all(found.frequencies[: 6 * free] == 0.0)
    for square, shape in zip(found.squares, found.shapes, strict=True):
        x = shape.T.ravel()
        assert x @ M @ x == pytest.approx(1.0, rel=1e-9)
        rest = (K @ x - square * (M @ x))[keep]
        assert np.linalg.norm(rest) < 1e-6 * np.linalg.norm(K @ np.roll(x, 1))


def test_rigid_motions_of_a_loaded_free_body_are_still_rigid() -> None:
    """A contracted muscle that floats has six motions without stiffness, the rest not; the mixed element too.

    Catches: a geometric stiffness that does not vanish under rotation (its stresses not in balance).
    """
    for element, poisson in (("P2", 0.4), ("P2-P1", 0.5)):
        laws = {"muscle": NeoHooke(10.0, poisson), "skeleton": NeoHooke(60.0, poisson)}
        active = {"muscle": ActiveStress(4.0, unit(0.3, 0.8, -0.5))}
        model = SolidModel(MESH, laws, active, on_three_corners(SIZE), element=element)
        state = solve(model, [1.0], settings=TIGHT).last
        found = modes(state, DENSITIES, 8, free=True)
        assert np.all(found.frequencies[:6] == 0.0)
        assert found.frequencies[6] > 0.0
        X = state.X + state.u
        arm = X - X.mean(axis=1, keepdims=True)
        rigid = np.stack(
            [
                *(np.repeat(e[:, None], X.shape[1], axis=1) for e in np.eye(3)),
                *(np.cross(e, arm.T).T for e in np.eye(3)),
            ]
        ).reshape(6, -1)
        basis = np.linalg.qr(rigid.T)[0]
        for shape in found.shapes[:6]:
            x = shape.ravel()
            assert np.linalg.norm(x - basis @ (basis.T @ x)) < 1e-3 * np.linalg.norm(x)


def test_a_body_on_springs_swings_as_a_mass_on_a_spring() -> None:
    """A nearly rigid block between two foundations: w^2 = 2 k A / m along each axis and about z.

    About x its springs do 2 k A (h^2/4 + b^2/12) against m (b^2 + h^2) / 12, about y the same with the other side.
    Catches: foundations let go with the supports, a mass in other units.
    """
    k = 1e-3
    stiff = {"muscle": NeoHooke(1e4, 0.0), "skeleton": NeoHooke(1e4, 0.0)}
    springs = [Foundation(face, k, k) for face in ("z0", "z1")]
    model = SolidModel(MESH, stiff, supports=springs)
    found = modes(_rest(model), {"muscle": 1e-6, "skeleton": 1e-6}, 6, free=True)
    square = 2.0 * k * SIZE[0] * SIZE[1] / (1e-6 * np.prod(SIZE))
    a, b, h = SIZE
    turning = [(3.0 * h**2 + side**2) / (side**2 + h**2) for side in (a, b)]
    # the block gives way by its stiffness over that of the springs, some 1e-6
    np.testing.assert_allclose(found.squares / square, [1.0, 1.0, 1.0, 1.0, *turning], rtol=1e-5)


def test_frequencies_do_not_depend_on_the_factorisation(monkeypatch: pytest.MonkeyPatch) -> None:
    """SuperLU gives the same frequencies, mixed element included.

    Catches: a shifted matrix that the other factorisation takes for indefinite.
    """
    for element in ("P2", "P2-P1"):
        state = _rest(_model(element))
        usual = modes(state, DENSITIES, 3).frequencies
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("FEM_BIOBOT_FACTORISATION", "superlu")
            assert module.direct_solver(state.model).name == SuperLU.name
            np.testing.assert_allclose(modes(state, DENSITIES, 3).frequencies, usual, rtol=1e-8)


def test_an_unstable_equilibrium_has_no_frequency_there() -> None:
    """A column beyond its buckling load, straight, swings by a negative square: not a number, and the first.

    Catches: a shift that stays above the negative eigenvalue, a square root of its size.
    """
    length, E = 10.0, 100.0
    euler = np.pi**2 * E / 12.0 / (4.0 * length**2)
    mesh = box_mesh((1, 1, 6), (1.0, 1.0, length), shift=0.0)
    stress = -1.5 * euler
    model = SolidModel(
        mesh, {"muscle": NeoHooke(E, 0.0)}, supports=[Fix("z0")], loads=[Traction("z1", (0.0, 0.0, stress))]
    )
    # straight: mu (s - 1/s) = stress with E = 2 mu
    s = 0.5 * (stress / (0.5 * E) + np.sqrt((stress / (0.5 * E)) ** 2 + 4.0))
    u = np.zeros_like(model.system.space.points)
    u[2] = (s - 1.0) * model.system.space.points[2]
    found = modes(SolidState(model, Step(1.0, 0.0), u), {"muscle": 1e-6}, 4)
    assert np.all(np.isnan(found.frequencies[:2]))
    assert np.all(found.squares[:2] < 0.0)
    assert np.all(found.frequencies[2:] > 0.0)


@pytest.mark.parametrize(
    ("densities", "count", "word"),
    [
        ({"muscle": 1e-6}, 3, "none for region 'skeleton'"),
        ({**DENSITIES, "bone": 1e-6}, 3, "region 'bone'"),
        ({**DENSITIES, "muscle": 0.0}, 3, "above 0 kg"),
        ({**DENSITIES, "muscle": (1.0, 2.0)}, 3, "above 0 kg"),
        (DENSITIES, 0, "at least 1"),
        (DENSITIES, 2.0, "at least 1"),
        (DENSITIES, 10_000, "less than the"),
    ],
)
def test_modes_that_make_no_sense_are_refused(densities: dict, count: int, word: str) -> None:
    """Missing, unknown and vanishing densities, and counts beyond the body's motions, are refused by name.

    Catches: massless regions that swing infinitely fast.
    """
    with pytest.raises(ModelError, match=word):
        modes(_rest(_model()), densities, count)


def test_modes_ask_for_balance_and_a_potential() -> None:
    """A state out of balance, supports let go that carry force, and loads without potential are refused.

    Catches: frequencies about a state that is none.
    """
    pulled = _model(supports=[Fix("z0")], loads=[Traction("z1", (0.0, 0.0, 1.0))])
    state = solve(pulled).last
    assert modes(state, DENSITIES, 1).frequencies[0] > 0.0
    with pytest.raises(ModelError, match="forces out of balance"):
        modes(SolidState(pulled, Step(1.0, 1.0), 0.5 * state.u), DENSITIES)
    with pytest.raises(ModelError, match="supports that are let go"):
        modes(state, DENSITIES, free=True)
    follows = _model(supports=[Fix("z0")], loads=[Pressure("z1", 1.0)])
    with pytest.raises(ModelError, match="without a potential"):
        modes(_rest(follows), DENSITIES)


def test_a_body_without_stiffness_has_no_modes() -> None:
    """Where no shift makes the matrix positive definite this is said.

    Catches: an endless search for a shift.
    """

    class Falling:
        """A law of negative stiffness."""

        law = NeoHooke(10.0, 0.3)

        def energy(self, F: np.ndarray) -> np.ndarray:
            return -1e12 * self.law.energy(F)

        def stress(self, F: np.ndarray) -> np.ndarray:
            return -1e12 * self.law.stress(F)

        def tangent(self, F: np.ndarray) -> np.ndarray:
            return -1e12 * self.law.tangent(F)

    model = SolidModel(box_mesh(1), {"muscle": Falling()}, supports=[Fix("z0")])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_SHIFTS", 1)
        with pytest.raises(ModelError, match="no shift"):
            modes(_rest(model), {"muscle": 1e-6})


# --- loss of stability ------------------------------------------------------------------------------------------------

LENGTH, YOUNG = 10.0, 100.0


def _column(element: str, poisson: float, width: float = 0.8, **more: object) -> tuple[SolidModel, float]:
    """A clamped-free column under a dead load of 1 at its top, and its buckling load by Euler and shear."""
    euler = np.pi**2 * YOUNG * width**3 / 12.0 / (4.0 * LENGTH**2) / width
    critical = euler / (1.0 + euler / (5.0 / 6.0 * YOUNG / (2.0 + 2.0 * poisson)))
    model = SolidModel(
        box_mesh((1, 1, 8), (1.0, width, LENGTH), shift=0.0),
        {"muscle": NeoHooke(YOUNG, poisson)},
        supports=[Fix("z0", "z"), Symmetry("x0"), Fix((0.0, 0.0, 0.0), "y"), Fix((0.0, width, 0.0), "x")],
        loads=[Traction("z1", (0.0, 0.0, -1.0))],
        element=element,
        **more,  # type: ignore[arg-type]
    )
    return model, critical


@pytest.mark.parametrize(("element", "poisson"), [("P2", 0.0), ("P2-P1", 0.5)])
def test_the_critical_load_of_a_column_is_eulers(element: str, poisson: float) -> None:
    """From the unloaded and from the loaded column the critical factor is Euler's load, the mode 1 - cos(pi z / 2 L).

    Catches: the change of the tangent without its geometric part, the way counted from zero load, the wrong sign.
    """
    model, critical = _column(element, poisson)
    rest = _rest(model)
    loaded = solve(model, [0.8 * critical]).last
    for state, tolerance in ((rest, 0.03), (loaded, 0.015)):
        found = buckling(state, 2.0 * critical)
        assert found is not None
        assert found.step.load == pytest.approx(critical, rel=tolerance)
        here = state.step.load
        assert here + found.way * (2.0 * critical - here) == pytest.approx(found.step.load, rel=1e-12)
        assert np.abs(found.mode).max() == 1.0
        expected = 1.0 - np.cos(0.5 * np.pi * model.system.space.points[2] / LENGTH)
        np.testing.assert_allclose(np.abs(found.mode[1]), expected, rtol=0.0, atol=0.02)


def test_a_column_shortened_by_its_ends_buckles_as_under_the_load() -> None:
    """Clamped and guided it takes pi^2 E I / L^2, which here is reached by moving the upper end.

    Catches: prescribed displacements left out of the path's tangent, so that nothing changes along it.
    """
    width = 0.5
    euler = np.pi**2 * YOUNG * width**2 / 12.0 / LENGTH**2
    critical = euler / (1.0 + euler / (5.0 / 6.0 * YOUNG / 2.0))
    model = SolidModel(
        box_mesh((1, 1, 8), (1.0, width, LENGTH), shift=0.0),
        {"muscle": NeoHooke(YOUNG, 0.0)},
        supports=[Fix("z0"), Symmetry("x0"), Fix("z1", "z", -critical / YOUNG * LENGTH)],
    )
    found = buckling(_rest(model), Step(1.0, 0.0))
    assert found is not None
    assert found.step.load == pytest.approx(1.0, abs=0.04)


def test_a_path_that_ends_in_buckling_says_where_and_how() -> None:
    """The error carries the critical factor and the mode, and its message the factor.

    Catches: only "not positive definite"; the factor of the step that failed for the critical one.
    """
    model, critical = _column("P2", 0.0)
    with pytest.raises(SolveError, match=r"it buckles at load x0\.\d+") as caught:
        solve(model, [0.7 * critical, 1.5 * critical])
    lost = caught.value.buckling
    assert lost.step.load == pytest.approx(critical, rel=0.01)
    assert lost.step.load > caught.value.reached.load
    assert np.abs(lost.mode[1]).max() == pytest.approx(1.0, abs=1e-3)


def test_a_body_without_a_critical_load_has_none() -> None:
    """Pulled, a column does not buckle; a body whose matrix does not change has nothing to lose either.

    Catches: the critical load of the opposite direction, an iteration on a zero operator.
    """
    model, critical = _column("P2", 0.0)
    found = buckling(_rest(model), Step(-critical, 0.0))
    assert found is None or found.way > 10.0
    dead = _model(loads=[Traction("z1", (0.0, 0.0, 0.0))])
    assert buckling(_rest(dead), Step(1.0, 0.0)) is None


def test_a_failure_without_instability_names_no_buckling() -> None:
    """A step that inverts an element has no critical factor.

    Catches: an eigenvalue far away told as the reason.
    """
    model = _model(supports=[Fix("z0"), Fix("z1", "xyz", (0.0, 0.0, -2.0 * SIZE[2]))])
    with pytest.raises(SolveError) as caught:
        solve(model)
    assert caught.value.buckling is None or caught.value.buckling.way <= 2.0


def test_buckling_wants_a_stable_state_and_a_way() -> None:
    """The state's own step, and a state that is not stable, are refused.

    Catches: the null vector of a matrix that was never definite.
    """
    model, critical = _column("P2", 0.0)
    state = solve(model, [0.5 * critical]).last
    with pytest.raises(ModelError, match="own step"):
        buckling(state, state.step)
    squeezed = SolidState(model, Step(0.0, 0.0), np.array([[0.0], [0.0], [-0.2]]) * model.system.space.points)
    with pytest.raises(ModelError, match="not stable"):
        buckling(squeezed, 1.0)
