"""S8 beyond its rows in the table: the same problem turned, renumbered, or in other units.

Problem: two-region block with an oblique fibre, prescribed displacement along oblique axes, a symmetry plane, tractions
    and a body force; then mesh, fibres, supports and loads turned together by a generic rotation, the mesh renumbered,
    or lengths and stresses scaled by 10^3.
Exact answer: the same energies, turned displacements and reactions (principle of objectivity; no numbers involved).
Measured: strain energy, displacement of all nodes, reactions, fibre stretch.
Tolerance: 1e-10 of the largest value; rounding through a solve to 1e-13.
Cannot see: any error that turns with the problem.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.model import SolidState
from fem_biobot.verification.solid_fields import MESH, PLACES, SAME, Setting, two_region_block
from tests.helpers import generator, rotation


def _equal(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=SAME * np.abs(expected).max())


@pytest.fixture(scope="module", params=["P2", "P2-P1"])
def element(request: pytest.FixtureRequest) -> str:
    """Displacement and mixed form."""
    return request.param


@pytest.fixture(scope="module")
def plain(element: str) -> SolidState:
    """The problem as it is."""
    return two_region_block(Setting(), element)


def _equal_pressures(found: SolidState, expected: SolidState, factor: float = 1.0, order: object = slice(None)) -> None:
    assert (found.pressure is None) == (expected.pressure is None)
    if found.pressure is not None and expected.pressure is not None:
        _equal(found.pressure[order] / factor, expected.pressure)


def test_a_problem_turned_otherwise_has_the_turned_answer(plain: SolidState, element: str) -> None:
    """Energy is the same; displacements and reactions turn with the problem, wherever it stands.

    Catches: F for C, fibres or support axes left in the global frame, rows for columns of the axes.
    """
    Q = rotation(8)
    state = two_region_block(Setting(Q, (3.0, -2.0, 5.0)), element)
    assert state.energy == pytest.approx(plain.energy, rel=SAME)
    _equal(state.u, Q @ plain.u)
    _equal_pressures(state, plain)
    _equal(state.stretch[MESH.regions["muscle"]], plain.stretch[MESH.regions["muscle"]])
    for place in PLACES:
        _equal(state.reaction(place), Q @ plain.reaction(place))
    assert np.abs(plain.F - np.eye(3)[:, :, None, None]).max() > 0.3


def test_a_renumbered_mesh_has_the_same_answer(plain: SolidState, element: str) -> None:
    """Vertices, elements, and the vertices within elements and triangles in any other order change nothing.

    Catches: transposed blocks where the later node has the lower number, midpoints tied to a vertex order.
    """
    draw = generator(19)
    new = draw.permutation(MESH.n_vertices)  # old vertex -> new number
    order = draw.permutation(MESH.n_elements)  # new element -> old one
    back = np.argsort(order)
    points = MESH.points[:, np.argsort(new)]
    cells = new[MESH.cells[:, order]]
    even = np.array([[0, 1, 2, 3], [1, 2, 0, 3], [3, 1, 0, 2], [1, 0, 3, 2], [2, 3, 0, 1]])
    cells = np.take_along_axis(cells, even[draw.integers(0, len(even), MESH.n_elements)].T, axis=0)
    regions = {name: back[elements] for name, elements in MESH.regions.items()}
    surfaces = {name: np.roll(new[t], 1, axis=0)[:, ::-1] for name, t in MESH.surfaces.items()}
    landmarks = {name: int(new[v]) for name, v in MESH.landmarks.items()}
    mesh = BodyMesh(points, cells, regions, surfaces, landmarks).checked()
    state = two_region_block(Setting(), element, mesh)
    assert state.energy == pytest.approx(plain.energy, rel=SAME)
    _equal(state.u[:, new], plain.u[:, : MESH.n_vertices])
    if state.model.system.mixed is not None and plain.model.system.mixed is not None:
        renamed = new[plain.model.system.mixed.field.vertex]
        theirs = state.model.system.mixed.field.vertex
        half = len(renamed) // 2
        # each region's pressures are in the order of its vertices' numbers
        order = np.concatenate(
            [np.searchsorted(theirs[:half], renamed[:half]), half + np.searchsorted(theirs[half:], renamed[half:])]
        )
        _equal_pressures(state, plain, order=order)
    for place in PLACES:
        _equal(state.reaction(place), plain.reaction(place))


@pytest.mark.parametrize(("length", "stress"), [(1e3, 1e3), (1e-3, 1e-3), (1e3, 1.0), (1.0, 1e-6)])
def test_other_units_give_the_same_dimensionless_answer(
    plain: SolidState, element: str, length: float, stress: float
) -> None:
    """Lengths in micrometres, stresses in Pa and the like scale the answer and change nothing else, nor the work.

    Catches: any absolute tolerance or threshold.
    """
    state = two_region_block(Setting(length=length, stress=stress), element)
    assert state.energy == pytest.approx(plain.energy * stress * length**3, rel=SAME)
    _equal(state.u / length, plain.u)
    _equal_pressures(state, plain, stress)
    for place in PLACES:
        _equal(state.reaction(place) / (stress * length**2), plain.reaction(place))
    assert abs(state.newton_iterations - plain.newton_iterations) <= 1
    assert state.factorisations == plain.factorisations
