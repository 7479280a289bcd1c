"""Assemblies: what joins what, where masses go, what states say; what does not fit is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.rod.ground import ContactPoints
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import (
    Body,
    DistributedLoad,
    Gravity,
    Hinge,
    Hold,
    Muscle,
    PointLoad,
    Rigid,
    Rod,
    Spherical,
    Spring,
)
from fem_biobot.rod.section import RodMaterial, Section
from tests.helpers import rotation
from tests.rods import rod_of, straight

STIFF = (40.0, 50.0, 70.0, 3.0, 2.0, 1.0)
ROD = rod_of(straight(4, 2.0), STIFF)
FOOT = Body((2.0, 0.0, -1.0), 2.0, (1.0, 2.0, 3.0), "foot")
AT_FOOT = ("foot", (2.0, 0.0, 0.0))
JOIN = Rigid(("rod", -1), AT_FOOT)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: RodModel(), "neither rods nor bodies"),
        (lambda: RodModel([ROD], damping_time=-1.0), "damping_time"),
        (lambda: RodModel([ROD, ROD]), "name 'rod': given to 2 parts"),
        (lambda: RodModel([ROD], members=[Muscle(("rod", 0), ("rod", 1), 1.0, 1.0, name="rod")]), "name 'rod'"),
        (lambda: RodModel([ROD], supports=[Hold("rod")]), "place: found 'rod', expected a pair"),  # type: ignore[arg-type]
        (lambda: RodModel([ROD], supports=[Hold(("rod", 5))]), "expected the number of one of its 5 nodes"),
        (lambda: RodModel([ROD], supports=[Hold(("rod", (0, 0, 0)))]), "expected the number of one of its 5 nodes"),
        (
            lambda: RodModel([ROD], supports=[Hold(("beam", 0))]),
            "no rod or body of the name 'beam', expected one of: rod",
        ),
        (lambda: RodModel([ROD], [JOIN], [FOOT], [Hold(("foot", 0))]), "place on body foot"),
        (lambda: RodModel([ROD], [Spherical(("rod", 0), AT_FOOT)], [FOOT]), "drawn 2 mm apart"),
        (lambda: RodModel([ROD], [JOIN, Hinge(("rod", -1), AT_FOOT, (0, 1, 0))], [FOOT]), "one rigid part already"),
        (lambda: RodModel([ROD], bodies=[FOOT]), "'rod' and 'foot' are not connected"),
        (lambda: RodModel([ROD], members=[Spring(("rod", 1), (0.5, 0.0, 0.0), 1.0)]), "drawn at one point"),
        (lambda: RodModel([ROD], loads=[DistributedLoad("beam")]), "no rod of the name 'beam'"),
        (lambda: RodModel([ROD], contacts=[ContactPoints("hand", [[0, 0, 0]])]), "no body of the name 'hand'"),
        (
            lambda: RodModel([rod_of(straight(4), STIFF, natural_curvature=np.zeros((3, 3)))]),
            "natural_curvature: found shape",
        ),
        (lambda: RodModel([rod_of(straight(4), STIFF, natural_curvature=(0, 0, np.nan))]), "natural_curvature: found"),
        (lambda: RodModel([rod_of(straight(4), STIFF, normal=(1, 0, 0))]), "normal"),
        (lambda: RodModel([ROD]).elements_of("beam"), "no rod of the name 'beam'"),
        (lambda: RodModel([ROD]).drawn().stretch("arm"), "no muscle of the name 'arm', expected one of: none"),
    ],
)
def test_what_does_not_fit_is_refused(make: Callable[[], object], word: str) -> None:
    """By the name of the part, in one line.

    Catches: a part left hanging in the air, a place that is silently another.
    """
    with pytest.raises(ModelError, match=word) as refusal:
        make()
    assert "\n" not in str(refusal.value)


def test_rigidly_joined_parts_are_one_node_at_their_centre_of_mass() -> None:
    """Mass, centre and inertia of a rod's end and a body together, by Steiner's theorem.

    Catches: inertia about the wrong point, a node at the place of the joint, mass counted twice.
    """
    rod = Rod(straight(2, 2.0), Section.rectangle(1.0, 2.0), RodMaterial(young=1.0, density=0.5, poisson=0.3))
    model = RodModel([rod], [JOIN], [FOOT])
    assert model.n_nodes == 3
    node = model.atlas.node_of["foot", 0]
    assert model.atlas.node_of["rod", 2] == node
    # a third of an element of volume 2 and density 0.5: Simpson's rule
    end = 1.0 / 3.0
    np.testing.assert_allclose(model.assembly.inertia.mass[node], 2.0 + end, rtol=1e-15)
    np.testing.assert_allclose(model.atlas.centre[node], [2.0, 0.0, -2.0 / (2.0 + end)], rtol=1e-15)
    reduced = 2.0 * end / (2.0 + end)
    I1, I2 = (8.0 / 12, 2.0 / 12)
    # the rod's directors: 3 along x, 1 some axis across, about which I1 counts; density times a third, 1 / 6
    own = 0.5 / 3.0 * np.array([I1 + I2, *((I1, I2) if model.atlas.frames["rod"][0, 0, 1] else (I2, I1))])
    expected = np.diag([1.0, 2.0, 3.0] + own + reduced * np.array([1.0, 1.0, 0.0]))
    np.testing.assert_allclose(model.assembly.inertia.J[node], expected, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(model.mass, 2.0 + 0.5 * 4.0, rtol=1e-15)


def test_each_element_has_its_own_factor_of_mass() -> None:
    """Nodes carry half of their two elements' mass; the factors change nothing else.

    Catches: one factor for all, a factor on the stiffness.
    """
    section, material = Section.circle(0.3), RodMaterial(young=1.0, density=0.5, poisson=0.3)
    plain = RodModel([Rod(straight(3, 3.0), section, material)]).assembly
    uneven = RodModel([Rod(straight(3, 3.0), section, material, mass=[2.0, 0.0, 0.5])]).assembly
    half = 0.5 * 0.5 * section.area
    np.testing.assert_allclose(uneven.inertia.mass, half * np.array([2.0, 2.0, 0.5, 0.5]), rtol=1e-14)
    np.testing.assert_array_equal(uneven.elements.stiffness, plain.elements.stiffness)


def test_a_drawn_model_is_free_of_stress() -> None:
    """However it is curved, joined and turned in space.

    Catches: natural strains of the chord, offsets in the wrong frame.
    """
    R = rotation(7)
    angle = np.array([0.0, 0.3, 0.4, 0.9])
    points = 2.0 * np.stack([np.sin(angle), 1 - np.cos(angle), 0.1 * angle], axis=1) @ R.T
    other = np.stack([points[1], points[1] + R @ [0.0, 0.3, 1.0]])
    model = RodModel([rod_of(points, STIFF), rod_of(other, STIFF, name="other")], [Rigid(("rod", 1), ("other", 0))])
    state = model.drawn()
    for name in ("rod", "other"):
        np.testing.assert_allclose(np.hstack(state.strain(name)), 0.0, atol=1e-14)
        np.testing.assert_allclose(np.hstack(state.resultants(name)), 0.0, atol=1e-12)
    np.testing.assert_allclose(state.points("rod"), points, rtol=0.0, atol=1e-15)
    assert state.energy < 1e-25
    assert state.kinetic_energy == 0.0


def test_states_speak_of_places() -> None:
    """A turned and moved state: positions, displacements, velocities, directors.

    Catches: an offset added unturned, the spin about the wrong point, rows for columns.
    """
    muscle = Muscle(("rod", 0), AT_FOOT, 0.5, 4.0, 1.0, 2.0, rest_length=1.6)
    model = RodModel([ROD], [JOIN], [FOOT], members=[muscle])
    R, shift = rotation(8), np.array([1.0, -2.0, 3.0])
    n = model.n_nodes
    spin, speed = np.array([0.3, 0.1, -0.2]), np.array([1.0, 2.0, 3.0])
    x = model.built.x @ R.T + shift
    v = np.hstack([speed + np.cross(spin, x), np.tile(spin, (n, 1))])
    state = RodState(model, x, np.tile(R.T, (n, 1, 1)), v, drive=0.5)
    at = R @ [2.0, 0.0, 0.0] + shift
    np.testing.assert_allclose(state.at(AT_FOOT), at, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(state.displacement(AT_FOOT), at - [2.0, 0.0, 0.0], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(state.velocity(AT_FOOT), speed + np.cross(spin, at), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(state.directors("rod")[:, 2], np.tile(R[:, 0], (5, 1)), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(state.muscle_length("muscle"), 2.0, rtol=1e-14)
    np.testing.assert_allclose(state.stretch("muscle"), 2.0 / 1.6, rtol=1e-14)
    # Eq. 2: area (passive + drive active + E (s - 1) / s)
    np.testing.assert_allclose(state.muscle_force("muscle"), 0.5 * (1.0 + 0.5 * 2.0 + 4.0 * 0.25 / 1.25), rtol=1e-14)
    np.testing.assert_allclose(state.centre_of_mass, R @ model.drawn().centre_of_mass + shift, rtol=1e-13)
    mass, J = model.assembly.inertia.mass, model.assembly.inertia.J
    expected = 0.5 * sum(
        m * w[:3] @ w[:3] + (R.T @ spin) @ j @ (R.T @ spin) for m, w, j in zip(mass, v, J, strict=True)
    )
    np.testing.assert_allclose(state.kinetic_energy, expected, rtol=1e-13)


def test_loads_go_where_they_are_put() -> None:
    """Resultant of distributed load and buoyancy; histories factor the loads of their own.

    Catches: an end that gets a whole element's share, lift with the weight's sign, histories shifted by a load.
    """
    rod = Rod(straight(4, 2.0), Section.rectangle(1.0, 2.0), RodMaterial(young=1.0, density=0.5, poisson=0.3))
    loads = [
        Gravity((0.0, 0.0, -10.0), 0.2),
        DistributedLoad("rod", (0.0, 3.0, 0.0)),
        PointLoad(("rod", 1), (7.0, 0.0, 0.0), history=lambda t: 2.0 * t),
    ]
    model = RodModel([rod], loads=loads, supports=[Hold(("rod", 0))])
    table = model.assembly.loads
    np.testing.assert_allclose(table.force.sum(axis=0), [7.0, 6.0, 0.2 * 4.0 * 10.0], rtol=1e-14)
    np.testing.assert_allclose(model.assembly.gravity, [0.0, 0.0, -10.0], rtol=0.0)
    np.testing.assert_allclose(model.load_factors(3.0), [*[1.0] * (len(table.node) - 1), 6.0], rtol=0.0)


def test_muscles_pull_by_drive_gamma_and_angle() -> None:
    """``area gamma sin(theta) (passive + drive active)``; springs do not.

    Catches: drive on the passive part, gamma left out, the cosine.
    """
    muscle = Muscle(("rod", 0), ("rod", -1), 0.5, 4.0, 1.0, 2.0, 0.8, 1.1)
    model = RodModel([ROD], members=[Spring(("rod", 0), ("rod", 2), 1.0), muscle])
    np.testing.assert_allclose(model.pull(0.7), [0.0, 0.5 * 0.8 * np.sin(1.1) * 2.4], rtol=1e-15)
    assert dict(model.muscles) == {"muscle": 1}
