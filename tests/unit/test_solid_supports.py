"""Supports: what they hold, in which axes, how they combine, and what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.material import NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.records import Fix, Symmetry, Traction, components
from tests.helpers import TIGHT, box_mesh, on_three_corners, rotation, turned_about

SIZE = (1.2, 0.9, 1.0)
MESH = box_mesh(2, SIZE)
OBLIQUE = tuple(tuple(float(x) for x in row) for row in rotation(12))


def _model(*supports: object, loads: tuple = (), mesh: BodyMesh = MESH) -> SolidModel:
    return SolidModel(mesh, {"muscle": NeoHooke(10.0, 0.4)}, supports=supports, loads=loads)


def _solved(*supports: object, loads: tuple = (), mesh: BodyMesh = MESH) -> SolidState:
    return solve(_model(*supports, loads=loads, mesh=mesh), settings=TIGHT).last


def _X(state: SolidState) -> np.ndarray:
    """Reference positions of the nodes."""
    return state.model.system.space.points


@pytest.mark.parametrize(
    ("given", "expected"), [("xz", (0, 2)), ("y", (1,)), ((2, 0), (2, 0)), (("x", 1), (0, 1)), ([2], (2,))]
)
def test_components_come_as_letters_or_numbers(given: object, expected: tuple[int, ...]) -> None:
    """Letters and numbers name the same components, in the order given.

    Catches: components sorted (values would go to the wrong ones).
    """
    assert components(given) == expected


@pytest.mark.parametrize("given", ["q", "", "xx", (3,), (-1,), (0, 0), 5, ("x", None)])
def test_other_components_are_refused(given: object) -> None:
    """Unknown, repeated or no components are refused.

    Catches: -1 understood as the last axis.
    """
    with pytest.raises(ModelError, match="components"):
        Fix("x0", given)


@pytest.mark.parametrize(
    "axes",
    [
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0)),
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        (("1", "0", "0"), ("0", "1", "0"), ("0", "0", "1")),
    ],
)
def test_axes_must_be_orthonormal(axes: tuple) -> None:
    """Skew rows, or two of them, are refused.

    Catches: axes used as they come.
    """
    with pytest.raises(ModelError, match=r"axes: found .*(orthonormal|numbers)"):
        Fix("x0", "x", axes=axes)


def test_a_face_is_held_with_its_midpoints() -> None:
    """All nodes of the face keep still, vertices and midpoints, and no others do.

    Catches: midpoints left free.
    """
    state = _solved(Fix("z0"), loads=(Traction("z1", (0.5, 0.3, -0.4)),))
    still = np.all(state.u == 0.0, axis=0)
    np.testing.assert_array_equal(still, np.abs(_X(state)[2]) < 1e-12)


def test_each_component_takes_its_own_value_times_the_load_factor() -> None:
    """Values go to the components in the order given and scale with the load factor.

    Catches: values in the order x, y, z; the factor applied to loads only.
    """
    model = _model(Fix("z0"), Fix("z1", "zx", (0.1, -0.07)))
    for factor in (0.5, 1.0):
        u = solve(model, [factor], settings=TIGHT).last.u
        top = np.abs(model.system.space.points[2] - SIZE[2]) < 1e-12
        np.testing.assert_allclose(u[2, top], 0.1 * factor, rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(u[0, top], -0.07 * factor, rtol=0.0, atol=1e-14)


def test_values_may_depend_on_the_place() -> None:
    """A function of reference positions prescribes each node; components not named stay free.

    Catches: positions given as rows, deformed positions, all components taken.
    """

    def bulge(X: np.ndarray) -> np.ndarray:
        assert X.shape[0] == 3
        return np.stack([9.0 + 0 * X[0], 9.0 + 0 * X[0], 0.1 + 0.05 * X[0] * X[1]])

    state = _solved(Fix("z0"), Fix("z1", "z", bulge))
    X = _X(state)
    top = np.abs(X[2] - SIZE[2]) < 1e-12
    np.testing.assert_allclose(state.u[2, top], 0.1 + 0.05 * X[0, top] * X[1, top], rtol=0.0, atol=1e-14)
    assert np.abs(state.u[:2]).max() < 0.2


def test_oblique_axes_hold_along_themselves_only() -> None:
    """A face driven along one oblique axis has that displacement along it and no reaction across it.

    Catches: axes as columns, a value along a global axis, the turned unknown written back untransformed.
    """
    state = _solved(Fix("z0"), Fix("z1", "y", 0.12, axes=OBLIQUE))
    along = np.array(OBLIQUE[1])
    top = np.abs(_X(state)[2] - SIZE[2]) < 1e-12
    np.testing.assert_allclose(along @ state.u[:, top], 0.12, rtol=0.0, atol=1e-13)
    R = state.reaction("z1")
    np.testing.assert_allclose(R - (R @ along) * along, 0.0, atol=1e-11 * np.linalg.norm(R))
    assert R @ along > 0.1
    assert np.abs(np.cross(state.u[:, top], along, axis=0)).max() > 0.01


def test_supports_combine_at_a_node() -> None:
    """Nodes on an edge held by two faces, one of them obliquely, obey both.

    Catches: the later support replacing the earlier one; the two solved as if orthogonal.
    """
    oblique = np.array(OBLIQUE[2])

    def rising(direction: np.ndarray, size: float) -> Callable[[np.ndarray], np.ndarray]:
        return lambda X: size * np.outer(direction, X[2])

    sideways = Fix("x1", "x", rising(np.eye(3)[0], 0.05))
    state = _solved(Fix("z0"), sideways, Fix("y1", "z", rising(oblique, -0.04), axes=OBLIQUE))
    X = _X(state)
    side, back = (np.abs(X[axis] - SIZE[axis]) < 1e-12 for axis in (0, 1))
    assert np.sum(side & back) == 5
    np.testing.assert_allclose(state.u[0, side], 0.05 * X[2, side], rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(oblique @ state.u[:, back], -0.04 * X[2, back], rtol=0.0, atol=1e-13)


def test_the_same_value_given_twice_is_no_contradiction() -> None:
    """Faces that share an edge may prescribe the same there, also along the same oblique axis.

    Catches: any doubly held node refused.
    """
    _model(Fix("x0"), Fix("z0"), Fix("y0", "y", axes=OBLIQUE), Fix("y0", "y", axes=OBLIQUE))
    _model(Fix("x0", "x", 0.1), Fix("y0", "xz", (0.1, 0.0)), Fix("z0", "yz"))


@pytest.mark.parametrize(
    "second",
    [
        Fix("x0", "x", 0.1),
        Fix("z0", "x", -0.2),
        Fix("z0", "xyz", lambda X: 0.3 + 0 * X),
        Fix("x0", "xyz", 0.2, OBLIQUE),
    ],
)
def test_contradicting_values_are_refused(second: Fix) -> None:
    """Two values for one component at one node are refused, along global and oblique axes.

    Catches: the last value winning.
    """
    with pytest.raises(ModelError, match="contradicting"):
        _model(Fix("x0"), second)


@pytest.mark.parametrize("where", ["lid", (0.3, 0.1, 0.2), (5.0, 5.0, 5.0)])
def test_unknown_places_are_refused(where: object) -> None:
    """An unknown name, and a position without a vertex, are refused with what there is.

    Catches: the nearest vertex taken.
    """
    with pytest.raises(ModelError, match=r"found no (surface or point named 'lid', expected one of x0|vertex)"):
        _model(Fix("x0"), Fix(where))


def test_a_mesh_without_names_says_so() -> None:
    """The message for a mesh that names nothing does not end in an empty list.

    Catches: "expected one of ".
    """
    bare = BodyMesh(MESH.points, MESH.cells, MESH.regions)
    with pytest.raises(ModelError, match="names no surface"):
        _model(Fix("x0"), mesh=bare)
    with pytest.raises(ModelError, match="names no surface"):
        _model(Symmetry("x0"), mesh=bare)


@pytest.mark.parametrize(
    ("value", "word"),
    [
        ((0.1, 0.2), "one for each of 3"),
        (float("nan"), "finite"),
        (lambda X: X[:2], "shape"),
        (lambda X: np.full(X.shape, np.nan), "finite"),
        ("0.1", "found '0.1', expected one finite number"),
        ((0.1, "0.2", 0.3), "one finite number"),
        (True, "one finite number"),
        (None, "one finite number"),
        (((0.1, 0.2), 0.3), "one finite number"),
        (lambda X: np.full(X.shape, "0.1"), "found values that are no finite numbers, expected finite displacements"),
    ],
)
def test_values_that_fit_nothing_are_refused(value: object, word: str) -> None:
    """The wrong number of values, values that are no finite numbers, a function of the wrong shape are refused.

    Catches: silent broadcasting, NaN carried into the solve, text that reads like a number taken for one, a message of
    many lines.
    """
    with pytest.raises(ModelError, match=word) as caught:
        _model(Fix("x0"), Fix("x1", "xyz", value))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("where", [0.1, (0.0, 0.0), ("0", "0", "0"), (0.0, float("nan"), 0.0)])
def test_positions_are_three_numbers(where: object) -> None:
    """A support at what is neither a name nor a position is refused, also under `Symmetry`.

    Catches: an error of NumPy's, a nearest vertex to NaN, text taken for numbers.
    """
    for support in (Fix(where), Symmetry(where)):
        with pytest.raises(ModelError, match="three finite numbers"):
            _model(Fix("x0"), support)


@pytest.mark.parametrize(
    ("supports", "free"),
    [
        ((Fix("corner_000"),), 3),
        ((Fix("corner_000"), Fix("corner_100", "yz")), 1),
        ((Fix("x0", "x"),), 3),
        ((Symmetry("x0"), Symmetry("y0")), 1),
        ((Fix("corner_000"), Fix("corner_100", "yz"), Fix("corner_010", "x")), 1),
        ((Fix("corner_000", "x", axes=OBLIQUE),), 5),
    ],
)
def test_a_rigid_motion_left_free_is_refused(supports: tuple, free: int) -> None:
    """The number of motions left free is found, redundant supports and oblique axes included.

    Catches: counting held components; three points in a line; a singular matrix met in the solver.
    """
    with pytest.raises(ModelError, match=f"{free} rigid motion"):
        _model(*supports)


def test_a_body_without_supports_is_refused() -> None:
    """No supports at all have a message of their own.

    Catches: an empty rank computation that raises something else.
    """
    with pytest.raises(ModelError, match="supports: found none"):
        _model()


@pytest.mark.parametrize("length", [1e-6, 1e6])
def test_six_supports_are_enough_at_any_scale(length: float) -> None:
    """Three corners hold a body of any size; a place is found to 1e-6 of it, and not a thousandth of it away.

    Catches: an absolute tolerance in the rank or in the search for the vertex.
    """
    size = tuple(length * s for s in SIZE)
    mesh = box_mesh(2, size)
    supports = on_three_corners(size)
    _model(*supports, mesh=mesh)
    _model(*supports, Fix((1e-7 * length, 0.0, 0.0)), mesh=mesh)
    with pytest.raises(ModelError, match="found no vertex"):
        _model(*supports, Fix((1e-3 * length, 0.0, 0.0)), mesh=mesh)


def test_symmetry_holds_along_the_normal_of_an_oblique_plane() -> None:
    """On a turned cube pressed on the plane, nodes keep in it and the reaction is normal to it.

    Catches: the normal of the wrong singular vector, the plane held entirely.
    """
    Q = rotation(40)
    mesh = turned_about(MESH, Q)
    push = tuple(float(x) for x in Q @ [-1.0, 0.0, 0.0])
    supports = (Symmetry("x0"), Symmetry("y0"), Symmetry("z0"))
    state = _solved(*supports, loads=(Traction("x1", push),), mesh=mesh)
    normal = Q[:, 0]
    face = np.abs(normal @ _X(state)) < 1e-12
    np.testing.assert_allclose(normal @ state.u[:, face], 0.0, atol=1e-14)
    area = SIZE[1] * SIZE[2]
    np.testing.assert_allclose(state.reaction("x0"), area * normal, rtol=0.0, atol=1e-11)
    assert np.linalg.norm(state.u[:, face], axis=0).max() > 0.01


def test_symmetry_refuses_what_is_no_plane() -> None:
    """A surface around a corner, a point, or an unknown name cannot be a symmetry plane.

    Catches: a mean normal of a bent surface.
    """
    both = np.concatenate([MESH.surfaces["x0"], MESH.surfaces["y0"]], axis=1)
    mesh = BodyMesh(MESH.points, MESH.cells, MESH.regions, {**MESH.surfaces, "bent": both}, MESH.landmarks)
    with pytest.raises(ModelError, match="'bent' not plane"):
        _model(Symmetry("bent"), mesh=mesh)
    with pytest.raises(ModelError, match="symmetry: found no surface named 'corner_000'"):
        _model(Symmetry("corner_000"), mesh=mesh)
    with pytest.raises(ModelError, match="named 'lid', expected one of x0"):
        _model(Symmetry("lid"), mesh=mesh)


def test_a_surface_that_is_no_facet_is_refused() -> None:
    """A triangle across the body has sides that are no edges, so midpoints cannot be found.

    Catches: midpoints of another edge taken.
    """
    corners = [MESH.landmarks[f"corner_{name}"] for name in ("000", "111", "010")]
    mesh = BodyMesh(MESH.points, MESH.cells, MESH.regions, {"cut": np.array(corners)[:, None]}, MESH.landmarks)
    with pytest.raises(ModelError, match="no edge of the mesh"):
        _model(Fix("cut"), mesh=mesh)
