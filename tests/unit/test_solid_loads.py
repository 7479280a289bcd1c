"""Dead loads: total force, moments, region, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.material import NeoHooke
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import BodyForce, Fix, Traction
from tests.helpers import TIGHT, box_mesh

SIZE = (1.2, 0.9, 1.4)
MESH = box_mesh(2, SIZE, layers=(0.5, 1.0), names=("muscle", "skeleton"))
LAWS = {"muscle": NeoHooke(10.0, 0.4), "skeleton": NeoHooke(40.0, 0.3)}
VECTOR = np.array([0.7, -1.1, 0.4])

every_element = pytest.mark.parametrize("element", ["P2", "P1"])


def _model(*loads: object, element: str = "P2") -> SolidModel:
    return SolidModel(MESH, LAWS, supports=[Fix("z0")], loads=loads, element=element)


def _nodal(*loads: object, element: str = "P2") -> tuple[np.ndarray, np.ndarray]:
    """Nodal forces (3, n) and positions of the nodes."""
    system = _model(*loads, element=element).system
    return system.dead_load.T, system.space.points


@every_element
def test_a_traction_has_its_area_times_its_value(element: str) -> None:
    """Force and first moments of a constant traction are those of the rectangle; only its nodes are loaded.

    Catches: twice the area, corner weights on midpoints, a face numbered otherwise.
    """
    f, X = _nodal(Traction("x1", tuple(VECTOR)), element=element)
    area = SIZE[1] * SIZE[2]
    np.testing.assert_allclose(f.sum(axis=1), area * VECTOR, rtol=1e-13)
    centre = np.array([SIZE[0], SIZE[1] / 2, SIZE[2] / 2])
    np.testing.assert_allclose(f @ X.T, area * np.outer(VECTOR, centre), rtol=1e-13)
    assert not f[:, np.abs(X[0] - SIZE[0]) > 1e-12].any()


def test_a_traction_may_vary_and_keeps_its_moments() -> None:
    """A traction quadratic in the position does the work of its integral on a quadratic displacement.

    Catches: a function sampled at nodes, a rule of degree 2, positions given as rows.
    """

    def pull(X: np.ndarray) -> np.ndarray:
        return np.stack([X[1] ** 2, X[0] * X[2], X[2] - X[1]])

    f, X = _nodal(Traction("x1", pull))
    a, b, c = SIZE
    # int y^2 * z^2, int a z * y, int (z - y) * y z over the rectangle b x c
    expected = [b**3 / 3 * c**3 / 3, a * c**2 / 2 * b**2 / 2, b**2 / 2 * c**3 / 3 - b**3 / 3 * c**2 / 2]
    work = [f[0] @ X[2] ** 2, f[1] @ X[1], f[2] @ (X[1] * X[2])]
    np.testing.assert_allclose(work, expected, rtol=1e-12)


@every_element
@pytest.mark.parametrize(("region", "share", "middle"), [(None, 1.0, 0.5), ("muscle", 0.5, 0.25)])
def test_a_body_force_acts_on_its_region(element: str, region: str | None, share: float, middle: float) -> None:
    """Force and first moments are those of the region's box, all of it by default.

    Catches: the region ignored, six times the volume, lumping to vertices.
    """
    f, X = _nodal(BodyForce(tuple(VECTOR), region), element=element)
    volume = share * np.prod(SIZE)
    np.testing.assert_allclose(f.sum(axis=1), volume * VECTOR, rtol=1e-13)
    centre = np.array([SIZE[0] / 2, SIZE[1] / 2, middle * SIZE[2]])
    np.testing.assert_allclose(f @ X.T, volume * np.outer(VECTOR, centre), rtol=1e-12)


def test_a_body_force_may_vary() -> None:
    """A force quadratic in the position does the work of its integral on a quadratic displacement.

    Catches: a value per element, a rule of degree 2.
    """
    f, X = _nodal(BodyForce(lambda X: np.stack([X[0] * X[1], X[2] ** 2, 1.0 + X[0]])))
    a, b, c = SIZE
    expected = [a**3 / 3 * b**2 / 2 * c, c**5 / 5 * a * b, (b + 0.0) * c * (a**2 / 2 + a**3 / 3)]
    work = [f[0] @ X[0], f[1] @ X[2] ** 2, f[2] @ X[0]]
    np.testing.assert_allclose(work, expected, rtol=1e-12)


def test_loads_add_up_and_scale_with_the_step() -> None:
    """Reactions balance all loads, at each load factor.

    Catches: the last load kept only; the factor applied to displacements only.
    """
    loads = (Traction("x1", (0.3, 0.1, -0.2)), Traction("z1", (0.1, 0.0, 0.2)), BodyForce((0.0, -0.3, 0.1)))
    total = SIZE[1] * SIZE[2] * np.array([0.3, 0.1, -0.2]) + SIZE[0] * SIZE[1] * np.array([0.1, 0.0, 0.2])
    total = total + np.prod(SIZE) * np.array([0.0, -0.3, 0.1])
    model = _model(*loads)
    for state, factor in zip(solve(model, [0.3, 1.0], settings=TIGHT).states, (0.3, 1.0), strict=True):
        np.testing.assert_allclose(state.reaction("z0"), -factor * total, rtol=0.0, atol=1e-11)


def test_reactions_and_loads_balance_in_force_and_moment() -> None:
    """About the origin, in the DEFORMED positions, all forces and moments on the body sum to zero.

    Catches: dead loads following the surface, a reaction that leaves out the load on its own nodes.
    """
    state = solve(_model(Traction("x1", (2.0, 1.0, -1.5)), BodyForce((0.4, 0.5, 0.2))), settings=TIGHT).last
    system = state.model.system
    x = system.space.points + state.u
    f_ext = system.dead_load.T
    held = np.abs(system.space.points[2]) < 1e-12
    support = np.where(held, state.internal_force - f_ext, 0.0)
    np.testing.assert_allclose(support.sum(axis=1), state.reaction("z0"), rtol=1e-12)
    forces = support + f_ext
    size = np.abs(f_ext.sum(axis=1)).max()
    np.testing.assert_allclose(forces.sum(axis=1), 0.0, atol=1e-11 * size)
    np.testing.assert_allclose(np.cross(x, forces, axis=0).sum(axis=1), 0.0, atol=1e-11 * size)
    assert np.abs(np.cross(state.u, forces, axis=0).sum(axis=1)).max() > 0.1  # not so in the reference body


@pytest.mark.parametrize(
    ("load", "word"),
    [
        (Traction("lid", (1.0, 0.0, 0.0)), "no surface named 'lid', expected one of x0"),
        (Traction("corner_000", (1.0, 0.0, 0.0)), "no surface named 'corner_000'"),
        (Traction("x1", (1.0, 0.0)), "three numbers"),
        (Traction("x1", lambda X: X[:2]), "shape"),
        (Traction("x1", (1.0, float("nan"), 0.0)), "finite"),
        (Traction("x1", ("1", "0", "0")), "found .*'1'.*, expected a vector of three finite numbers"),
        (BodyForce("0.1"), "found '0.1', expected a vector of three finite numbers"),
        (BodyForce(lambda X: np.full(X.shape, "0.1")), "found values that are no finite numbers"),
        (BodyForce((1.0, 0.0, 0.0), "bone"), "region 'bone', expected one of muscle, skeleton"),
        (BodyForce(lambda X: X.T), "shape"),
        (BodyForce(lambda X: np.full(X.shape, np.inf)), "finite"),
        ("gravity", "expected Traction, Pressure or BodyForce"),
    ],
)
def test_loads_that_fit_nothing_are_refused(load: object, word: str) -> None:
    """Unknown places, vectors and functions of the wrong shape, values that are no numbers are refused by name.

    Catches: silent broadcasting; a load on nothing; text that reads like a number taken for one.
    """
    with pytest.raises(ModelError, match=word):
        _model(load)
