"""Follower pressure, elastic foundation, and the unsymmetric matrices that come with open surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_biobot.errors import ModelError
from fem_biobot.material import NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.linear import Whole
from fem_biobot.solid.model import SolidModel, SolidSolution, solve
from fem_biobot.solid.records import Fix, Foundation, Pressure, Symmetry, Traction
from tests.helpers import (
    FACES,
    TIGHT,
    box_mesh,
    generator,
    on_three_corners,
    rotation,
    slope,
    turned_about,
    unchanged,
)

SIZE = (1.0, 0.8, 1.2)
MESH = box_mesh(2, SIZE)
SOFT = NeoHooke(10.0, 0.3)
every_element = pytest.mark.parametrize("element", ["P2", "P1", "P2-P1"])


def _model(
    loads: Sequence[object], supports: Sequence[object] | None = None, element: str = "P2", mesh: BodyMesh = MESH
) -> SolidModel:
    return SolidModel(
        mesh,
        {"muscle": SOFT},
        supports=on_three_corners(SIZE) if supports is None else supports,  # type: ignore[arg-type]
        loads=loads,  # type: ignore[arg-type]
        element=element,
    )


def _bent(model: SolidModel, seed: int = 9) -> np.ndarray:
    """A smooth displacement of some 20 % strain, (n, 3)."""
    X = model.system.space.points.T
    return X @ (0.15 * generator(seed).normal(size=(3, 3))).T + 0.05 * np.sin(3.0 * X[:, ::-1])


def _residual(model: SolidModel, u: np.ndarray, load: float = 1.0) -> np.ndarray:
    system = model.system
    points = system.points(system.deformation_gradient(u), 0.0)
    return system.residual(points, system.internal_force(points)[0], system.external_force(u, load))


# --- follower pressure ------------------------------------------------------------------------------------------------


@every_element
def test_a_follower_pressure_pushes_against_the_current_face(element: str) -> None:
    """Of an affinely deformed flat face the resultant is minus p times the current area vector, J F^-T N A.

    Catches: the reference normal or area, a sign, half the force for the unit triangle's half area.
    """
    model = _model([Pressure("z1", 2.5)], element=element)
    F = np.eye(3) + 0.3 * generator(3).normal(size=(3, 3))
    assert np.linalg.det(F) > 0.2
    u = model.system.space.points.T @ (F - np.eye(3)).T
    with unchanged(u):
        force = model.system.external_force(np.ascontiguousarray(u), 0.7)
    area = np.linalg.det(F) * np.linalg.inv(F).T @ [0.0, 0.0, SIZE[0] * SIZE[1]]
    np.testing.assert_allclose(force.sum(axis=0), -0.7 * 2.5 * area, rtol=0.0, atol=1e-13)


def test_on_a_closed_surface_it_has_no_resultant_and_works_on_the_volume() -> None:
    """All six faces: no force, no moment; its work in a small change is minus p times the change of volume.

    Catches: a face that looks inwards, an integral along edges left in.
    """
    model = _model([Pressure(face, 4.0) for face in FACES])
    u, v = _bent(model), _bent(model, 5)
    force = model.system.external_force(u, 1.0)
    x = model.system.space.points.T + u
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-13)
    np.testing.assert_allclose(np.cross(x, force).sum(axis=0), 0.0, atol=1e-13)

    def volume(e: float) -> float:
        fine = SolidModel(MESH, {"muscle": SOFT}, supports=on_three_corners(SIZE), quadrature_degree=5).system
        F = fine.deformation_gradient(u + e * v)
        return float(np.sum(np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1))) * fine.space.dV))

    # exact: the volume is a cubic polynomial in e
    h = 0.1
    slope_of_volume = (8.0 * (volume(h) - volume(-h)) - (volume(2 * h) - volume(-2 * h))) / (12.0 * h)
    assert float(np.sum(force * v)) == pytest.approx(-4.0 * slope_of_volume, rel=1e-12)


def test_the_order_of_a_triangles_vertices_does_not_matter() -> None:
    """Surfaces name facets, not sides: with any order of vertices the pressure pushes inwards.

    Catches: the normal taken from the mesh file's order.
    """
    turned = {name: np.roll(t, 1, axis=0)[::-1] for name, t in MESH.surfaces.items()}
    other = BodyMesh(MESH.points, MESH.cells, MESH.regions, turned, MESH.landmarks).checked()
    u = _bent(_model([]))
    one, two = (_model([Pressure("x1", 2.0)], mesh=m).system.external_force(u, 1.0) for m in (MESH, other))
    np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-15)


def test_a_pressure_that_does_not_follow_is_a_dead_traction() -> None:
    """`follower=False` is the traction -p N, whatever the displacement; both agree in the undeformed body.

    Catches: the flag ignored, either way.
    """
    dead, follows = _model([Pressure("y1", 3.0, follower=False)]), _model([Pressure("y1", 3.0)])
    traction = _model([Traction("y1", (0.0, -3.0, 0.0))])
    u = _bent(dead)
    np.testing.assert_allclose(
        dead.system.external_force(u, 1.0), traction.system.external_force(0.0 * u, 1.0), atol=1e-14
    )
    rest = follows.system.external_force(0.0 * u, 1.0)
    np.testing.assert_allclose(rest, dead.system.external_force(0.0 * u, 1.0), atol=1e-14)
    assert np.abs(follows.system.external_force(u, 1.0) - rest).max() > 0.01
    assert dead.system.symmetric
    assert not dead.system.surfaces


def test_a_varying_pressure_is_read_at_reference_positions() -> None:
    """The resultant of p = 1 + 2 x y on the undeformed face is its integral, and it moves with the material.

    Catches: the function read at deformed positions, at vertices, or with axes exchanged.
    """

    def p(X: np.ndarray) -> np.ndarray:
        return 1.0 + 2.0 * X[0] * X[1]

    model = _model([Pressure("z1", p)])
    a, b = SIZE[:2]
    expected = -(a * b + 2.0 * a**2 * b**2 / 4.0)
    rest = np.zeros((model.system.space.n_nodes, 3))
    np.testing.assert_allclose(model.system.external_force(rest, 1.0).sum(axis=0), [0.0, 0.0, expected], atol=1e-13)
    np.testing.assert_allclose(model.system.external_force(rest + 3.0, 1.0).sum(axis=0)[2], expected, atol=1e-13)


@pytest.mark.parametrize("load", [1.0, 0.4])
def test_the_matrix_is_the_derivative_with_surfaces_too(load: float) -> None:
    """Taylor remainder with an open pressure, a varying one, a foundation, and nodes held along oblique axes.

    Catches: the skew part left out or with the wrong sign, foundations scaled by the load, blocks that are not turned.
    """
    Q = rotation(17)
    mesh = turned_about(MESH, Q)
    axes = tuple(tuple(float(x) for x in row) for row in rotation(3))
    supports = [Symmetry("x0"), Fix("y0", "x", axes=axes), Foundation("z0", 7.0, 3.0)]
    loads = [Pressure("x1", 3.0), Pressure("y0", lambda X: 2.0 + X[0] ** 2), Traction("x1", (1.0, 0.0, 0.0))]
    model = _model(loads, supports, mesh=mesh)
    assert not model.system.symmetric
    system, u = model.system, _bent(model)
    v = np.cos(2.0 * system.space.points.T + 0.3)
    points = system.points(system.deformation_gradient(u), 0.0)
    matrix = system.matrix(points, points.S, u, load)
    along = system.product(matrix, system.to_local(v).ravel())
    eps = 2.0 ** -np.arange(8, 14)
    rest = [np.linalg.norm(_residual(model, u + e * v, load) - _residual(model, u, load) - e * along) for e in eps]
    assert slope(list(eps), [float(r) for r in rest]) == pytest.approx(2.0, abs=0.1)
    # each part counts: without the skew one the slope is 1
    symmetric = system.product(matrix[0], system.to_local(v).ravel())
    assert np.linalg.norm(symmetric - along) > 1e-3 * np.linalg.norm(along)


@pytest.mark.parametrize(
    ("loads", "supports", "symmetric"),
    [
        ([Pressure("z1", 2.0)], [Fix("z0")], False),
        ([Pressure(face, 2.0) for face in FACES], None, True),
        ([Pressure(face, 2.0) for face in FACES[:5]], None, False),
        ([Pressure("z1", 2.0)], [Fix("x0"), Fix("x1"), Fix("y0"), Fix("y1")], True),
        ([Pressure("z1", 2.0)], [Symmetry("x0"), Symmetry("y0"), Symmetry("z0"), Symmetry("x1"), Symmetry("y1")], True),
        ([Pressure(face, lambda X: 1.0 + X[2]) for face in FACES], None, False),
        ([Traction("z1", (0.0, 0.0, 1.0))], [Foundation("z0", 3.0, 1.0)], True),
    ],
)
def test_the_matrix_is_unsymmetric_where_an_edge_is_free(
    loads: Sequence[object], supports: Sequence[object] | None, symmetric: bool
) -> None:
    """Closed surfaces, held edges and symmetry planes have a potential; free edges and varying pressures have none.

    Catches: the costly solver for every pressure; a symmetric one where the iteration then converges slowly.
    """
    model = _model(loads, supports)
    assert model.system.symmetric == symmetric
    points = model.system.points(model.system.deformation_gradient(_bent(model)), 0.0)
    assert model.system.matrix(points, points.S, _bent(model)).ndim == 2 - symmetric


@every_element
def test_a_body_under_pressure_all_around_shrinks_by_its_law(element: str) -> None:
    """Every stretch s solves mu (s - 1/s) + 3 lmbda ln s / s = -p s^2: Cauchy stress -p I in the deformed body.

    Catches: pressure per reference area (p instead of p s^2).
    """
    p = 5.0
    model = _model([Pressure(face, p) for face in FACES], element=element)
    found = solve(model, [0.5, 1.0], settings=TIGHT)
    s = brentq(lambda s: SOFT.mu * (s - 1 / s) + 3.0 * SOFT.lmbda * np.log(s) / s + p * s**2, 0.3, 1.0, xtol=1e-15)
    C = np.einsum("im...,ik...->mk...", found.last.F, found.last.F)
    np.testing.assert_allclose(C, np.broadcast_to(s**2 * np.eye(3)[:, :, None, None], C.shape), rtol=0.0, atol=1e-10)
    assert "unsymmetric" not in found.linear_solver


def test_an_open_pressure_is_solved_without_symmetry_and_quadratically() -> None:
    """A block pressed on its free top takes the unsymmetric factorisation; forces balance at the support.

    Catches: a symmetrised tangent (linear convergence), reactions without the follower force.
    """
    for element, poisson in (("P2", 0.3), ("P2-P1", 0.5)):
        model = SolidModel(
            MESH,
            {"muscle": NeoHooke(10.0, poisson)},
            supports=[Fix("z0")],
            loads=[Pressure("z1", 2.0)],
            element=element,
        )
        residuals: list[float] = []
        found = solve(
            model,
            [1.0],
            settings=TIGHT,
            observe=lambda kind, v, r=residuals: r.append(v["residual"]) if kind == "iteration" else None,
        )
        assert "unsymmetric" in found.linear_solver or "SuperLU" in found.linear_solver
        near = [r for r in residuals if 1e-13 < r < 1e-2]
        assert all(after < 0.05 * before for before, after in pairwise(near))
        force = model.system.external_force(np.ascontiguousarray(found.last.u.T), 1.0).sum(axis=0)
        np.testing.assert_allclose(found.last.reaction("z0"), -force, rtol=0.0, atol=1e-10)
        assert abs(force[2]) > 2.0 * SIZE[0] * SIZE[1]  # the top has grown


def test_superlu_solves_without_symmetry_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    """The other factorisation gives the same state.

    Catches: the transpose factored.
    """
    model = _model([Pressure("z1", 2.0), Traction("z1", (1.0, 0.0, 0.0))], [Fix("z0")])
    usual = solve(model, settings=TIGHT)
    monkeypatch.setenv("FEM_BIOBOT_FACTORISATION", "superlu")
    other = solve(model, settings=TIGHT)
    assert other.linear_solver == "SuperLU (SciPy)"
    np.testing.assert_allclose(other.last.u, usual.last.u, rtol=0.0, atol=1e-11)


def test_both_triangles_are_made_of_the_two_parts() -> None:
    """The whole matrix has the symmetric part plus the skew part above, minus it below the diagonal.

    Catches: the sign on the wrong side, entries dropped because they are zero.
    """
    system = _model([]).system
    p, draw = system.pattern, generator(12)
    data = draw.normal(size=(2, len(p.columns)))
    data[0, 5] = data[1, 5] = 0.0
    data[1, p.starts[:-1]] = 0.0
    whole = Whole(p)
    assert len(whole.columns) == 2 * len(p.columns) - p.n_dofs
    rows = np.repeat(np.arange(p.n_dofs), np.diff(p.starts))
    dense = np.zeros((p.n_dofs, p.n_dofs))
    dense[p.columns, rows] = data[0] - data[1]
    dense[rows, p.columns] = data[0] + data[1]
    ours = np.zeros_like(dense)
    ours[np.repeat(np.arange(p.n_dofs), np.diff(whole.starts)), whole.columns] = whole.entries(data)
    np.testing.assert_array_equal(ours, dense)
    x = draw.normal(size=p.n_dofs)
    np.testing.assert_allclose(system.product(data, x), dense @ x, rtol=0.0, atol=1e-12 * np.abs(dense @ x).max())


# --- elastic foundation -----------------------------------------------------------------------------------------------


@every_element
def test_a_foundation_answers_along_and_across_its_normal(element: str) -> None:
    """A rigid shift of the surface is answered by minus (k_n along N, k_t across) times its reference area.

    Catches: stiffnesses exchanged, the load factor on a support.
    """
    model = _model([], [Foundation("y1", 7.0, 3.0), Fix("y0")], element=element)
    shift = np.array([0.2, -0.3, 0.5])
    u = np.tile(shift, (model.system.space.n_nodes, 1))
    area = SIZE[0] * SIZE[2]
    for load in (0.0, 1.0):
        force = model.system.external_force(u, load).sum(axis=0)
        np.testing.assert_allclose(force, -area * np.array([3.0, 7.0, 3.0]) * shift, rtol=0.0, atol=1e-13)


def test_a_body_on_a_foundation_sinks_by_its_load() -> None:
    """A bar pushed on top sinks at its foot by T over k, and its reaction there balances the push.

    Catches: a stiffness per current area, springs left out of the residual or the tangent.
    """
    T, k = -1.5, 6.0
    supports = [Foundation("z0", k), Symmetry("x0"), Symmetry("y0")]
    found = solve(_model([Traction("z1", (0.0, 0.0, T))], supports), settings=TIGHT)
    assert found.at((0.3, 0.2, 0.0))[2] == pytest.approx(T / k, abs=1e-11)
    springs = found.last.internal_force[2, np.abs(found.last.X[2]) < 1e-12].sum()
    assert springs == pytest.approx(-T * SIZE[0] * SIZE[1], abs=1e-11)


@pytest.mark.parametrize(
    ("supports", "free"),
    [
        ([Foundation("z0", 1.0)], 3),
        ([Foundation("z0", 1.0), Foundation("x0", 1.0)], 1),
        ([Foundation("z0", 0.0, 1.0)], 3),
        ([Foundation("z0", 0.0, 1.0), Foundation("x0", 0.0, 1.0)], 1),
        ([Foundation("z0", 1.0, 1.0)], 0),
        ([Foundation("z0", 1.0), Fix((0.0, 0.0, 0.0), "xy")], 1),
        ([Foundation("z0", 0.0, 0.0)], 6),
    ],
)
def test_springs_count_as_supports(supports: Sequence[object], free: int) -> None:
    """Motions that springs resist need no other support; those they do not are refused as before.

    Catches: a foundation that is asked for three points beside it, or taken to hold everything.
    """
    if not free:
        assert np.all(np.isfinite(solve(_model([Traction("z1", (0.2, 0.0, -0.1))], supports)).last.u))
        return
    with pytest.raises(ModelError, match="found none" if free == 6 else rf"found {free} rigid motion"):
        _model([], supports)


# --- refusals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("load", "word"),
    [
        (Pressure("roof", 1.0), "pressure: found no surface named 'roof'"),
        (Pressure("inner", 1.0), "surface inside the body"),
        (Pressure("z1", (1.0, 2.0)), "one number or a function"),  # type: ignore[arg-type]
        (Pressure("z1", "much"), "a finite number"),  # type: ignore[arg-type]
        (Pressure("z1", lambda X: X), "shape"),
        (Pressure("z1", lambda X: np.full(X.shape[1], np.nan)), "finite"),
    ],
)
def test_pressures_that_fit_nothing_are_refused(load: Pressure, word: str) -> None:
    """Unknown and inner surfaces, vectors, text, and functions of another shape are refused by name.

    Catches: a pressure on both sides of an inner surface, silent broadcasting.
    """
    face = MESH.cells[[0, 1, 2], :1]
    for triple in ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)):
        face = np.sort(MESH.cells[list(triple), :], axis=0)
        keys = (face[0] * 1000 + face[1]) * 1000 + face[2]
        outer = np.sort(np.concatenate(list(MESH.surfaces.values()), axis=1), axis=0)
        inside = ~np.isin(keys, (outer[0] * 1000 + outer[1]) * 1000 + outer[2])
        if inside.any():
            face = face[:, inside][:, :1]
            break
    mesh = BodyMesh(MESH.points, MESH.cells, MESH.regions, {**MESH.surfaces, "inner": face}, MESH.landmarks)
    with pytest.raises(ModelError, match=word):
        _model([load], mesh=mesh)


@pytest.mark.parametrize("stiffness", [-1.0, float("nan"), (1.0, 2.0), "soft"])
def test_foundations_that_are_none_are_refused(stiffness: object) -> None:
    """A negative, infinite or manifold stiffness, and an unknown surface, are refused.

    Catches: springs that push away, which make every body unstable.
    """
    with pytest.raises(ModelError, match="foundation, normal"):
        Foundation("z0", stiffness)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="foundation, tangential"):
        Foundation("z0", 1.0, stiffness)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="foundation: found no surface named 'floor'"):
        _model([], [Foundation("floor", 1.0, 1.0)])


def test_the_solution_of_a_model_with_surfaces_goes_on_from_itself() -> None:
    """Restarted from its own state a pressed model has nothing left to do.

    Catches: a residual of the start evaluated without the surface terms.
    """
    found: SolidSolution = solve(_model([Pressure("z1", 2.0)], [Foundation("z0", 20.0, 5.0)]))
    again = solve(found.last.model, [1.0], start=[found.last])
    assert again.newton_iterations == 0
