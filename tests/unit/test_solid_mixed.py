"""The mixed element P2-P1: pressures, refusals, warnings, inertia, and what is read off its states."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy import sparse

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.material import ActiveStress, NaturalState, NeoHooke
from fem_biobot.material.natural_state import isochoric_contraction
from fem_biobot.solid import linear
from fem_biobot.solid.linear import Pardiso, SuperLU, minimal_residuals, pardiso_missing
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.newton import Equilibrium, NewtonSettings
from fem_biobot.solid.path import predict
from fem_biobot.solid.records import Fix, Step, Symmetry, Traction
from fem_biobot.solid.space import LockingWarning
from fem_biobot.solid.stress import cauchy_stress, node_probe, probe
from tests.helpers import TIGHT, box_mesh, generator, hold_everywhere, on_three_corners, slope, unit
from tests.mixed import Split, rest

SIZE = (1.0, 0.8, 1.2)
FIBRE = unit(0.3, 0.8, -0.5)
MESH = box_mesh(2, SIZE, layers=(0.5, 1.0), names=("muscle", "skeleton"))

needs_pardiso = pytest.mark.skipif(pardiso_missing() is not None, reason=f"PARDISO: {pardiso_missing()}")


def _model(muscle: float = 0.5, skeleton: float = 0.499, element: str = "P2-P1", **more: object) -> SolidModel:
    laws = {"muscle": NeoHooke(10.0, muscle), "skeleton": NeoHooke(60.0, skeleton)}
    active = {"muscle": ActiveStress(3.0, FIBRE)}
    return SolidModel(MESH, laws, active, on_three_corners(SIZE), element=element, **more)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def contracted() -> SolidState:
    """Incompressible muscle on a nearly incompressible layer."""
    return solve(_model(), [1.0], settings=TIGHT).last


def _matrix(state: SolidState) -> np.ndarray:
    """Whole matrix at a state, held unknowns blocked."""
    system = state.model.system
    points = system.points(state.F, state.step.tension, state.pressure)
    data = system.matrix(points, points.S)
    system.block(data)
    p = system.pattern
    upper = sparse.csr_matrix((data, p.columns, p.starts), shape=(p.n_dofs, p.n_dofs)).toarray()
    return upper + np.triu(upper, 1).T


def test_every_region_has_pressures_of_its_own(contracted: SolidState) -> None:
    """Vertices of the interface carry two pressures, which differ; positions are those of the regions' vertices.

    Catches: one continuous pressure through gel and muscle.
    """
    X, p = contracted.pressure_points, contracted.pressure
    assert p is not None
    at_interface = np.flatnonzero(np.abs(X[2] - 0.5 * SIZE[2]) < 1e-12)
    assert len(at_interface) == 2 * 9
    assert X.shape[1] == len(p) == 2 * (27 - 9)
    first, second = at_interface[:9], at_interface[9:]
    np.testing.assert_array_equal(X[:, first], X[:, second])
    assert np.abs(p[first] - p[second]).min() > 0.05
    assert contracted.model.n_dofs == 3 * contracted.u.shape[1] + len(p)


def test_the_volume_of_an_incompressible_region_stays(contracted: SolidState) -> None:
    """Weighted with each pressure's shape function the change of volume vanishes, locally as well as in sum.

    Catches: a residual of the pressures that is not asked to converge.
    """
    system = contracted.model.system
    assert system.mixed is not None
    field = system.mixed.field
    muscle = contracted.model.mesh.regions["muscle"]
    J = np.linalg.det(np.moveaxis(contracted.F, (0, 1), (-2, -1)))[muscle]
    assert np.abs(J - 1.0).max() > 1e-3
    lost = np.zeros(field.n)
    np.add.at(lost, field.nodes[:, muscle], np.einsum("cq,eq->ce", field.values, np.log(J) * system.space.dV[muscle]))
    np.testing.assert_allclose(lost, 0.0, rtol=0.0, atol=1e-11 * field.volume.max())


def test_the_matrix_is_the_derivative_of_the_residual() -> None:
    """Taylor remainder of the whole residual in displacement and pressure falls with slope 2.

    Catches: a coupling without its derivative by F, moduli of the pressure with the wrong sign.
    """
    model = _model(0.5, 0.45)
    system, draw = model.system, generator(8)
    X = system.space.points.T
    x = np.concatenate([(0.1 * np.sin(2.0 * X[:, ::-1])).ravel(), draw.normal(size=system.n_pressures)])
    change = np.concatenate([np.cos(3.0 * X).ravel(), draw.normal(size=system.n_pressures)])
    assert system.mixed is not None
    unit_of = np.concatenate([np.ones(X.size), system.mixed.field.scale])

    def residual(x: np.ndarray) -> np.ndarray:
        u, p = system.parts(x / unit_of)
        points = system.points(system.deformation_gradient(u), 1.0, p)
        force, _ = system.internal_force(points)
        return system.residual(points, force, np.zeros_like(force))

    u, p = system.parts(x / unit_of)
    points = system.points(system.deformation_gradient(u), 1.0, p)
    along = system.product(system.matrix(points, points.S), change / unit_of)
    eps = 2.0 ** -np.arange(6, 12)
    rests = np.array([residual(x + e * change) - residual(x) - e * along for e in eps])
    n = X.size
    for part in (slice(n), slice(n, None)):
        assert slope(list(eps), list(np.linalg.norm(rests[:, part], axis=1))) == pytest.approx(2.0, abs=0.1)


def test_a_stable_state_has_one_negative_eigenvalue_a_pressure() -> None:
    """By dense eigenvalues; both factorisations count the same pivots, with bulk infinite or not.

    Catches: the count of another matrix, positive pivots counted, compliance with the wrong sign.
    """
    mesh = box_mesh((1, 1, 2), SIZE, layers=(0.5, 1.0), names=("muscle", "skeleton"))
    model = _model()
    state = solve(SolidModel(mesh, model.materials, model.active, model.supports, element="P2-P1")).last
    values = np.linalg.eigvalsh(_matrix(state))
    system = state.model.system
    n = system.n_pressures
    assert np.sum(values < 0.0) == n
    assert system.mixed is not None
    points = system.points(state.F, 1.0, state.pressure)
    data = system.matrix(points, points.S)
    system.block(data)
    data[system.mixed.compliance_places] += 1e-6 * system.mixed.steadying
    for kind in [SuperLU] + [Pardiso] * (pardiso_missing() is None):
        factor = kind(system.pattern)
        factor.factor(data)
        assert factor.negative_pivots == n
        b = generator(4).normal(size=system.n_dofs)
        np.testing.assert_allclose(system.product(data, factor.solve(b)), b, rtol=0.0, atol=1e-6)


def test_a_nearly_incompressible_column_buckles() -> None:
    """Straight under 0.9 of its critical load, refused at 1.6: one negative pivot too many.

    Catches: the count not looked at, so that the straight state is accepted because it balances.
    """
    E, length = 100.0, 10.0
    euler = np.pi**2 * E / 12.0 / (4.0 * length**2)
    model = SolidModel(
        box_mesh((2, 2, 8), (1.0, 1.0, length), shift=0.0),
        {"muscle": NeoHooke(E, 0.5)},
        supports=[Fix("z0")],
        loads=[Traction("z1", (0.0, 0.0, -euler))],
        element="P2-P1",
    )
    assert len(solve(model, [0.9]).states) == 1
    with pytest.raises(SolveError, match="positive definite") as caught:
        solve(model, [1.6])
    assert caught.value.reached.load < 1.1


def test_superlu_solves_the_mixed_form_as_well(contracted: SolidState, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other factorisation gives the same state, and refuses the unstable one.

    Catches: pivots off the diagonal taken for a failure, a factor of the unsteadied matrix.
    """
    monkeypatch.setenv("FEM_BIOBOT_FACTORISATION", "superlu")
    found = solve(_model(), [1.0], settings=TIGHT)
    assert found.linear_solver == SuperLU.name
    np.testing.assert_allclose(found.last.u, contracted.u, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.last.pressure, contracted.pressure, rtol=0.0, atol=1e-8)


@needs_pardiso
def test_the_solution_names_the_indefinite_factorisation(contracted: SolidState) -> None:
    """With pressures the symmetric indefinite one, without the positive definite one.

    Catches: Cholesky's refusal of every mixed matrix taken for instability.
    """
    assert "indefinite" in Pardiso(contracted.model.system.pattern).name
    assert "positive definite" in Pardiso(_model(0.4, 0.4, "P2").system.pattern).name


def test_a_path_with_the_pressure_carried_takes_few_iterations() -> None:
    """Four states up to a stretch of some 0.7: at most six iterations each and no halving.

    Catches: the pressure left out of the predictor or of the carried stress.
    """
    found = solve(_model(), [0.5, 1.0, 1.5, 2.0])
    assert max(state.newton_iterations for state in found.states) <= 8
    assert found.states[-1].newton_iterations <= 5
    assert found.halvings == 0


def test_the_predictor_extrapolates_the_pressures() -> None:
    """From three states the trial's pressures miss the solution's by less than a tenth of what the last state's do.

    Catches: pressures left at the last state, or at zero, while displacement and stress go ahead.
    """
    model = _model()
    states = solve(model, [0.4, 0.5, 0.6, 0.7], settings=TIGHT).states
    history = [
        Equilibrium(s.step, np.ascontiguousarray(s.u.T), np.asarray(s.pressure), s.points, s.internal_force.T, 0.0, 0)
        for s in states[:3]
    ]
    trial = predict(model.system, history, states[3].step)
    assert trial.p is not None
    assert np.linalg.norm(trial.p - states[3].pressure) < 0.1 * np.linalg.norm(states[2].pressure - states[3].pressure)


def test_a_change_of_pressure_is_carried_into_the_stress() -> None:
    """The error of the stress carried along with displacement and pressure falls with the square of the change.

    Catches: the pressure's part left out of what is carried (slope 1).
    """
    model = _model()
    system, draw = model.system, generator(8)
    X = system.space.points.T
    u, p = 0.1 * np.sin(2.0 * X[:, ::-1]), draw.normal(size=system.n_pressures)
    v, change = np.cos(3.0 * X), 5.0 * draw.normal(size=system.n_pressures)
    points = system.points(system.deformation_gradient(u), 1.0, p)
    eps = 2.0 ** -np.arange(7, 12)
    rests = []
    for e in eps:
        F = system.deformation_gradient(u + e * v)
        new = system.points(F, 1.0, p + e * change)
        rests.append(float(np.linalg.norm(new.S - system.carry(points, F, e * change))))
    assert slope(list(eps), rests) == pytest.approx(2.0, abs=0.1)


def test_a_state_goes_on_where_it_was_and_its_trial_is_the_solution(contracted: SolidState) -> None:
    """Nothing is left to do from a converged state, given as the start or as a trial with its pressures.

    Catches: pressures lost on the way in, zero pressures for the ones given.
    """
    assert solve(contracted.model, [1.0], start=[contracted]).newton_iterations == 0
    trial = (contracted.u, contracted.points.S, contracted.pressure)
    assert solve(contracted.model, [1.0], trial=trial).newton_iterations == 0
    # without the pressures the iteration has to find them
    assert solve(contracted.model, [1.0], trial=(contracted.u, None)).newton_iterations > 0


def test_energy_is_the_muscles_work(contracted: SolidState) -> None:
    """The passive energy equals the tension's work along the path, by Simpson's rule on eleven states.

    Catches: the pressure's energy left out or counted with the wrong sign in the compressible layer.
    """
    model = _model(0.5, 0.3)
    tensions = np.linspace(0.0, 1.0, 11)[1:]
    states = solve(model, tensions, settings=TIGHT).states
    dV = model.system.space.dV[MESH.regions["muscle"]]
    lengths = np.array([0.0, *(3.0 * np.sum((s.stretch[MESH.regions["muscle"]] - 1.0) * dV) for s in states)])
    # int L dT = T L - work
    integral = (lengths[0] + 4.0 * lengths[1::2].sum() + 2.0 * lengths[2:-1:2].sum() + lengths[-1]) / 30.0
    work = -(lengths[-1] - integral)
    assert states[-1].energy == pytest.approx(work, rel=1e-4)


def test_stress_at_any_place_is_that_of_the_points() -> None:
    """In a homogeneous state the probe's Cauchy stress, pressure included, is that at the quadrature points.

    Catches: the pressure forgotten at probes, or taken from another region.
    """
    F = np.diag([1.1, 0.9, 1.0 / (1.1 * 0.9)])
    model = _model()
    u = (F - np.eye(3)) @ model.system.space.points
    p = np.where(np.arange(model.system.n_pressures) < 18, 3.0, -2.0)
    state = SolidState(model, Step(1.0, 0.0), u, pressure=p)
    sigma = cauchy_stress(state.points)
    for region, pressure in (("muscle", 3.0), ("skeleton", -2.0)):
        mine = MESH.regions[region]
        mu = model.materials[region].mu  # type: ignore[attr-defined]
        expected = mu * (F @ F.T - np.eye(3)) + pressure * np.eye(3)
        np.testing.assert_allclose(
            sigma[:, :, mine], np.broadcast_to(expected[:, :, None, None], sigma[:, :, mine].shape), atol=1e-11
        )
        where = probe(model.system, MESH.points[:, MESH.cells[:, mine]].mean(axis=1))
        own = np.isin(where.elements, mine)
        found = where.cauchy_stress(state)[:, :, own]
        np.testing.assert_allclose(found, np.broadcast_to(expected[:, :, None], found.shape), atol=1e-11)
    nodal = node_probe(model.system).cauchy_stress(state)
    np.testing.assert_allclose(nodal.reshape(3, 3, -1, 10)[:, :, :, 0], sigma[:, :, :, 0], atol=1e-11)


def test_an_element_inverted_at_a_node_is_probed_at_its_nearest_point() -> None:
    """Where det F is negative at a node only, its stress is that of the nearest quadrature point, not an error.

    Catches: a far deformed state whose pictures cannot be drawn.
    """
    model = _model(0.4, 0.4, "P2")
    u = np.zeros_like(model.system.space.points)
    u[2, model.mesh.landmarks["corner_001"]] = -0.3
    state = SolidState(model, Step(1.0, 0.0), u)
    J = np.linalg.det(np.moveaxis(state.F, (0, 1), (-2, -1)))
    assert J.min() > 0.0
    nodes = node_probe(model.system)
    plain = np.eye(3)[:, :, None] + np.einsum(
        "ibk,bdk->idk", u[:, model.system.space.nodes[:, nodes.elements]], nodes.slopes
    )
    inverted = np.flatnonzero(np.linalg.det(np.moveaxis(plain, -1, 0)) <= 0.0)
    assert inverted.size
    F = nodes.deformation_gradient(state)
    for k in inverted:
        own = state.F[:, :, nodes.elements[k]]
        assert np.min(np.abs(own - F[:, :, [k]]).max(axis=(0, 1))) == 0.0
    assert np.all(np.isfinite(nodes.cauchy_stress(state)))


def test_other_laws_share_the_space_and_change_the_answer() -> None:
    """`with_materials` gives the state that a model made with those laws gives, infinite bulk for finite included.

    Catches: the compliance of the laws before kept.
    """
    laws = {"skeleton": NeoHooke(40.0, 0.5), "muscle": NeoHooke(12.0, 0.48)}
    changed = _model().with_materials(laws)
    assert changed.system.pattern is not None
    fresh = SolidModel(MESH, laws, _model().active, on_three_corners(SIZE), element="P2-P1")
    one, other = (solve(m, [1.0], settings=TIGHT).last for m in (changed, fresh))
    np.testing.assert_allclose(one.u, other.u, rtol=0.0, atol=1e-10)
    with pytest.raises(ModelError, match="split in other regions"):
        _model().with_materials({"muscle": NeoHooke(10.0, 0.0), "skeleton": NeoHooke(60.0, 0.4)})


def test_a_law_without_volumetric_energy_keeps_the_displacement_form() -> None:
    """At a Poisson's ratio of 0 a coupled law has none; with an unsplit law neither; both equal P2.

    Catches: an infinite compliance, a region without a law.
    """
    free = _model(0.0, 0.0)
    assert free.system.mixed is None
    same = _model(0.0, 0.0, "P2")
    one, other = (solve(m, [0.5], settings=TIGHT).last for m in (free, same))
    np.testing.assert_allclose(one.u, other.u, rtol=0.0, atol=1e-12)
    assert one.pressure is None
    assert one.pressure_points.shape == (3, 0)


def test_tissue_in_a_natural_state_is_mixed_too() -> None:
    """An isochoric natural state keeps its pressure; without load the body goes there with its volume.

    Catches: remodelled tissue that falls back to the displacement form.
    """
    F0 = isochoric_contraction(0.9, FIBRE)
    law = NaturalState(NeoHooke(10.0, 0.5), F0)
    model = SolidModel(box_mesh(2, SIZE), {"muscle": law}, {}, on_three_corners(SIZE), element="P2-P1")
    # the undeformed body is far from equilibrium: begin near the end, turned as the supports want it
    F = np.linalg.qr(F0)[1]
    F *= np.sign(np.diag(F))[:, None]
    trial = (0.9 * (F - np.eye(3)) @ model.system.space.points, None)
    state = solve(model, [1.0], settings=TIGHT, trial=trial).last
    C = np.einsum("im...,ik...->mk...", state.F, state.F)
    np.testing.assert_allclose(C, np.broadcast_to((F0.T @ F0)[:, :, None, None], C.shape), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(state.pressure, 0.0, rtol=0.0, atol=1e-8)


def test_incompressible_tissue_needs_the_mixed_element() -> None:
    """P2 and P1 refuse a Poisson's ratio of one half when the model is made, also within a natural state.

    Catches: an infinite modulus that becomes a NaN in the first iteration.
    """
    for element in ("P2", "P1"):
        with pytest.raises(ModelError, match="needs the mixed element P2-P1"):
            _model(element=element)
    law = NaturalState(NeoHooke(10.0, 0.5), np.diag([0.9, 1.0, 1.0]))
    with pytest.raises(ModelError, match="needs the mixed element P2-P1"):
        SolidModel(box_mesh(1), {"muscle": law}, supports=on_three_corners())


def test_incompressible_tissue_held_all_around_is_refused() -> None:
    """Its pressure is undetermined; with one free face, or a compressible neighbour, it is not.

    Catches: a singular matrix met in the middle of a path, a check of each region alone.
    """
    mesh = box_mesh(2, layers=(0.5, 1.0), names=("muscle", "skeleton"))
    both = {"muscle": NeoHooke(10.0, 0.5), "skeleton": NeoHooke(60.0, 0.5)}
    held = hold_everywhere()
    with pytest.raises(ModelError, match="held all around"):
        SolidModel(mesh, both, supports=held, element="P2-P1")
    sliding = [Symmetry(face) for face in ("x0", "x1", "y0", "y1", "z0", "z1")]
    with pytest.raises(ModelError, match="held all around"):
        SolidModel(mesh, both, supports=sliding, element="P2-P1")
    SolidModel(mesh, {**both, "skeleton": NeoHooke(60.0, 0.4)}, supports=held, element="P2-P1")
    SolidModel(mesh, both, supports=held[:-1], element="P2-P1")


@pytest.mark.parametrize(
    ("element", "poisson", "number"), [("P2", 0.495, "0.495"), ("P1", 0.45, "0.45"), ("P2", 0.49, ""), ("P1", 0.4, "")]
)
def test_displacement_elements_warn_above_what_they_bear(element: str, poisson: float, number: str) -> None:
    """Above 0.49 (P2) and 0.4 (P1) with the region and its ratio; not at the limit; never from the mixed element.

    Catches: a limit of the other element, the bulk modulus taken for Lame's constant.
    """
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        model = _model(0.3, poisson, element)
    texts = [str(w.message) for w in told if issubclass(w.category, LockingWarning)]
    assert list(model.system.notes) == texts
    assert len(texts) == bool(number)
    if number:
        assert f"skeleton: Poisson's ratio {number} is above" in texts[0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _model(0.3, poisson)


def test_a_law_that_does_not_split_is_told_of_in_the_mixed_element() -> None:
    """A nearly incompressible law without `split` stays in displacement form there, and the model says so.

    Catches: silence because the element is the mixed one.
    """

    class Whole:
        """A law without split."""

        law = NeoHooke(10.0, 0.498)
        energy, stress, tangent = law.energy, law.stress, law.tangent

    with pytest.warns(LockingWarning, match="a law that splits"):
        model = SolidModel(box_mesh(1), {"muscle": Whole()}, supports=on_three_corners(), element="P2-P1")
    assert model.system.mixed is None


# --- minimal residuals ------------------------------------------------------------------------------------------------


def test_minimal_residuals_solve_with_the_factor_of_a_near_matrix(contracted: SolidState) -> None:
    """A saddle point's matrix is solved with the factor of a steadier one, in few iterations; cut short it says so.

    Catches: the residual of the preconditioned system taken for the true one, the flag always true.
    """
    system = contracted.model.system
    assert system.mixed is not None
    points = system.points(contracted.F, 1.0, contracted.pressure)
    data = system.matrix(points, points.S)
    system.block(data)
    steady = data.copy()
    steady[system.mixed.compliance_places] += 1e-2 * system.mixed.steadying
    factor = SuperLU(system.pattern)
    factor.factor(steady)
    b = 1e-7 * generator(6).normal(size=system.n_dofs)
    x, used, reached = minimal_residuals(system.pattern, data, b, factor.solve, tolerance=1e-9, max_iterations=12)
    assert reached
    assert used < 12
    assert np.linalg.norm(system.product(data, x) - b) < 1.1e-9 * np.linalg.norm(b)
    x, used, reached = minimal_residuals(system.pattern, data, b, factor.solve, tolerance=1e-9, max_iterations=1)
    assert (used, reached) == (1, False)
    zero, used, reached = minimal_residuals(
        system.pattern, data, 0.0 * b, factor.solve, tolerance=1e-9, max_iterations=3
    )
    assert (used, reached, zero.any()) == (0, True, False)


def test_a_solve_that_needs_no_steadying_is_steadied_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is factored has the small compliance, whatever the bulk modulus, so that no pivot vanishes.

    Catches: the incompressible matrix factored as it is.
    """
    seen: list[np.ndarray] = []
    model = _model(0.5, 0.5)
    mixed = model.system.mixed
    assert mixed is not None
    assert not mixed.compliance.any()
    kind = SuperLU if pardiso_missing() else Pardiso
    factor = kind.factor
    monkeypatch.setattr(
        getattr(linear, kind.__name__), "factor", lambda self, data: seen.append(data.copy()) or factor(self, data)
    )
    solve(model, [0.1], settings=NewtonSettings(max_iterations=8))
    assert seen
    for data in seen:
        assert np.all(np.abs(data[mixed.compliance_places]) > 0.0)


def test_a_split_of_ones_own_is_enough() -> None:
    """A user's law with `split` and without compiled form solves; bulk 1e5 and inf agree to about mu over bulk.

    Catches: a mixed form only for the package's own laws.
    """
    answers = []
    for bulk in (1e5, np.inf):
        law = Split(rest(3.0), bulk)
        model = SolidModel(
            box_mesh(1), {"muscle": law}, {"muscle": ActiveStress(2.0, FIBRE)}, on_three_corners(), element="P2-P1"
        )
        answers.append(solve(model, [1.0]).last.u)
    np.testing.assert_allclose(answers[0], answers[1], rtol=0.0, atol=1e-4)
    assert np.abs(answers[0] - answers[1]).max() > 1e-7
