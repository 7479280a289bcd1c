"""Drag records, their lumps at the nodes, forces and exact derivatives; compiled and as plain Python."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fem_biobot.config import load_design
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.rod.arrays import Drags
from fem_biobot.rod.drag import kernels
from fem_biobot.rod.drag.linear import LinearDrag
from fem_biobot.rod.drag.record import Drag
from fem_biobot.rod.dynamics.integrate import Integrator, Settings, dynamics
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.modes import modes
from fem_biobot.rod.records import Body, Hold, Rigid, Rod
from fem_biobot.rod.reduce import reduce
from fem_biobot.rod.rotation.kernels import turn
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.statics import statics
from tests.helpers import generator, plain_python, taylor_slope
from tests.rods import arc, straight

Array = np.ndarray
NAMES = tuple(name for name, value in vars(kernels).items() if hasattr(value, "py_func"))
STEEL = RodMaterial(young=1e4, poisson=0.3, density=2e-6)


@pytest.fixture(params=["compiled", "plain"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run the kernels compiled, and as the Python they were compiled from."""
    with ExitStack() as stack:
        if request.param == "plain":
            stack.enter_context(plain_python(kernels, *NAMES))
        yield request.param


def lumps(axis: bool) -> Drags:
    """Three generic lumps on two nodes."""
    draw = generator(3)
    t = draw.normal(size=(3, 3))
    t = t / np.linalg.norm(t, axis=1)[:, None] if axis else 0.0 * t
    a, b, c, d, e = (np.array(row) for row in draw.uniform(0.2, 1.5, size=(5, 3)))
    return Drags(np.array([0, 1, 1]), draw.normal(size=(3, 3)), t, a, b, c, d, e, draw.normal(size=(3, 3)))


def state(seed: int = 8) -> tuple[Array, Array]:
    """Directors of two nodes and their velocities, generic."""
    draw = generator(seed)
    return Rotation.random(2, rng=draw).as_matrix(), draw.normal(size=(2, 6))


@pytest.mark.parametrize("axis", [True, False])
def test_tangents_are_the_derivatives_by_velocity_and_by_turn(mode: str, axis: bool) -> None:
    """At generic directors, velocities, arms, axes and coefficients, with a medium that moves.

    Catches: the change of the axis or of the arm left out, the quadratic part's second term, spin and tumble exchanged.
    """
    drags, (Q, v) = lumps(axis), state()
    push, spin = generator(4).normal(size=(2, 2, 6))
    blocks: Array = np.zeros((2, 2, 6, 6))
    none = np.zeros(2, dtype=np.int64)
    for out, by_velocity, by_turn in ((blocks[0], 0.7, 0.0), (blocks[1], 0.0, 1.3)):
        kernels.add_drag_tangents(drags, none, np.arange(2), Q, v, by_velocity, by_turn, out)

    def force(eps: float, by: Array, turned: Array) -> Array:
        Q1, out = np.empty_like(Q), np.zeros((2, 6))
        turn(Q, np.ascontiguousarray(eps * turned[:, 3:]), Q1)
        kernels.add_drag(drags, Q1, v + eps * by, out)
        return out.reshape(12, 1)

    by_velocity = -np.einsum("nij,nj->ni", blocks[0] / 0.7, push).reshape(12, 1)
    by_turn = -np.einsum("nij,nj->ni", blocks[1] / 1.3, spin).reshape(12, 1)
    np.testing.assert_allclose(taylor_slope(lambda e: force(e, push, 0.0 * spin), by_velocity), 2.0, atol=0.1)
    np.testing.assert_allclose(taylor_slope(lambda e: force(e, 0.0 * push, spin), by_turn), 2.0, atol=0.1)
    assert np.abs(blocks[1][:, :, :3]).max() == 0.0  # nothing depends on where it is


def test_held_nodes_get_no_tangent_and_rest_has_one() -> None:
    """Catches: a held node's block that is filled, a division by no velocity."""
    drags, (Q, v) = lumps(axis=True), state()
    drags = drags._replace(velocity=np.zeros((3, 3)))
    blocks: Array = np.zeros((2, 6, 6))
    kernels.add_drag_tangents(drags, np.array([0, 1]), np.arange(2), Q, 0.0 * v, 1.0, 1.0, blocks)
    assert np.isfinite(blocks).all()
    assert np.abs(blocks[0]).max() > 0.1
    assert np.abs(blocks[1]).max() == 0.0


def test_drag_takes_energy_and_its_largest_force_is_told(mode: str) -> None:
    """Power below zero in a medium at rest; the component returned is that of the largest force.

    Catches: a sign, a moment about another point than the node.
    """
    drags, (Q, v) = lumps(axis=True)._replace(velocity=np.zeros((3, 3))), state()
    force: Array = np.zeros((2, 6))
    largest = kernels.add_drag(drags, Q, v, force)
    assert float((force * v).sum()) < 0.0
    one: Array = np.zeros((2, 6))
    assert largest >= kernels.add_drag(drags._replace(node=drags.node[:1]), Q, v, one) == np.abs(one[0, :3]).max()


# ---- lumps of a model


def test_a_straight_rod_has_the_resistances_of_slender_body_theory() -> None:
    """Sums over the lumps: 2 pi mu L / ln(L/r) along, twice that across, rho C r L, and 4 pi mu r^2 L about the axis.

    Turning end over end meets ``c L^3 / 12``: cubics are integrated exactly.
    Catches: a diameter for a radius, an end lump of full size, a factor of two between along and across.
    """
    n, L, r, mu, rho = 6, 9.0, 0.25, 3e-5, 1.3e-6
    rod = Rod(straight(n, L, (2.0, -1.0, 0.5)), Section.circle(r), STEEL)
    model = RodModel([rod], loads=[Drag(mu, density=rho, rod_coefficient=0.9)])
    d = model.assembly.drag
    along = 2.0 * np.pi * mu * L / np.log(L / r)
    assert d.along.sum() == pytest.approx(along, rel=1e-12)
    assert d.across.sum() == pytest.approx(2.0 * along, rel=1e-12)
    assert d.quadratic.sum() == pytest.approx(rho * 0.9 * r * L, rel=1e-12)
    assert d.spin.sum() == pytest.approx(4.0 * np.pi * mu * r**2 * L, rel=1e-12)
    slow = d._replace(quadratic=np.zeros(n + 1))
    centre = model.built.x.mean(axis=0)
    w = np.cross([2.0, -1.0, 0.5], [0.3, 0.4, 1.0])  # across the rod
    v = np.concatenate([np.cross(w, model.built.x - centre), np.tile(w, (n + 1, 1))], axis=1)
    force: Array = np.zeros((n + 1, 6))
    kernels.add_drag(slow, model.drawn().Q, v, force)
    moment = (force[:, 3:] + np.cross(model.built.x - centre, force[:, :3])).sum(axis=0)
    np.testing.assert_allclose(moment, -2.0 * along / L * L**3 / 12.0 * w, rtol=1e-10)


def test_bodies_of_one_rigid_part_are_one_sphere_about_its_centre() -> None:
    """6 pi mu R, 8 pi mu R^3 and C pi R^2 rho / 2 of the common volume; a body without volume adds nothing.

    Catches: spheres added up, a radius of each, the centre of mass for that of volume.
    """
    bodies = [
        Body((1.0, 0.0, 0.0), 3.0, (1.0, 1.0, 1.0), "a", 5.0),
        Body((4.0, 1.0, 0.0), 1.0, (1.0, 1.0, 1.0), "b", 2.0),
        Body((0.0, 9.0, 0.0), 1.0, (1.0, 1.0, 1.0), "bare"),
    ]
    joints = [Rigid((x, b), (y, b)) for x, y, b in (("a", "b", (4.0, 1.0, 0.0)), ("a", "bare", (0.0, 9.0, 0.0)))]
    mu, rho = 2e-6, 1e-6
    model = RodModel(bodies=bodies, joints=joints, loads=[Drag(mu, density=rho)])  # type: ignore[arg-type]
    d = model.assembly.drag
    R = (3.0 * 7.0 / (4.0 * np.pi)) ** (1.0 / 3.0)
    assert len(d.node) == 1
    assert d.along[0] == d.across[0] == pytest.approx(6.0 * np.pi * mu * R)
    assert d.spin[0] == d.tumble[0] == pytest.approx(8.0 * np.pi * mu * R**3)
    assert d.quadratic[0] == pytest.approx(0.5 * rho * 0.44 * np.pi * R**2)
    np.testing.assert_allclose(d.offset[0] + model.built.x[0], [(5.0 * 1.0 + 2.0 * 4.0) / 7.0, 2.0 / 7.0, 0.0])
    assert not d.axis.any()


def test_a_rod_among_the_spheres_is_spread_over_its_length() -> None:
    """A curved rod as a sphere: sums of one sphere, shares of four elements, without axis and moment.

    Catches: a sphere at every node, the rod dragged as a slender body, too.
    """
    rod = Rod(arc(4, 3.0, 1.0), Section.rectangle(2.0, 0.6), STEEL, "plate")
    model = RodModel([rod], loads=[Drag(1e-6, spheres=["plate"])])
    d = model.assembly.drag
    R = (3.0 * 3.0 * 1.2 / (4.0 * np.pi)) ** (1.0 / 3.0)
    assert d.across.sum() == pytest.approx(6e-6 * np.pi * R)
    np.testing.assert_allclose(24.0 * d.across / d.across[2], np.array([9.0, 28.0, 22.0, 28.0, 9.0]) * 12.0 / 11.0)
    assert not d.spin.any()
    assert not d.axis.any()


# ---- refusals


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"viscosity": -1.0}, "drag: viscosity: found -1"),
        ({"viscosity": float("nan")}, "drag: viscosity"),
        ({"viscosity": 1.0, "density": -1.0}, "drag: density"),
        ({"viscosity": 1.0, "velocity": (0.0, 1.0)}, "drag: velocity"),
        ({"viscosity": 1.0, "radius": 0.0}, "drag: radius"),
        ({"viscosity": 1.0, "rod_coefficient": -1.0}, "drag: rod_coefficient"),
        ({"viscosity": 1.0, "sphere_coefficient": float("inf")}, "drag: sphere_coefficient"),
        ({"viscosity": 1.0, "rods": "rod"}, "drag: rods: found 'rod', expected a sequence"),
        ({"viscosity": 1.0, "spheres": [3]}, "drag: spheres"),
    ],
)
def test_wrong_records_are_named(arguments: dict[str, Any], word: str) -> None:
    """Catches: a value that is taken in silence."""
    with pytest.raises(ModelError, match=word):
        Drag(**arguments)


@pytest.mark.parametrize(
    ("loads", "word"),
    [
        ([Drag(1.0, rods=["tail"])], "drag: rods: no rod of the name 'tail'"),
        ([Drag(1.0, rods=(), spheres=["tail"])], "drag: spheres: no body or rod of the name 'tail'"),
        ([Drag(1.0, rods=(), spheres=["point"])], "drag: body point: found volume 0"),
        ([Drag(1.0), Drag(2.0)], "'rod' is dragged twice"),
        ([Drag(1.0, radius=0.5)], "drag: rod rod is 6 times as long as its radius, expected at least 10"),
    ],
)
def test_drag_that_does_not_fit_a_model_is_refused(loads: list[Drag], word: str) -> None:
    """Catches: a part that is not there or counted twice, a logarithm where it means nothing."""
    point = Body((0.0, 0.0, 0.0), 1.0, (1.0, 1.0, 1.0), "point")
    rod = Rod(straight(3, 3.0), Section.circle(0.1), STEEL)
    with pytest.raises(ModelError, match=word):
        RodModel([rod], [Rigid(("rod", 0), ("point", (0.0, 0.0, 0.0)))], [point], loads=loads)


def test_statics_and_modes_refuse_a_medium_that_moves_and_ignore_one_at_rest() -> None:
    """Catches: a stream that bends nothing in silence."""
    rod, hold = Rod(straight(4, 3.0), Section.circle(0.1), STEEL), Hold(("rod", 0))
    stream = RodModel([rod], supports=[hold], loads=[Drag(1e-6, velocity=(0.0, 1.0, 0.0))])
    for analysis in (statics, modes):
        with pytest.raises(ModelError, match="drag: velocity: found a medium that moves"):
            analysis(stream)
    still, none = (RodModel([rod], supports=[hold], loads=loads) for loads in ([Drag(1e-6)], []))
    np.testing.assert_array_equal(modes(still).frequencies, modes(none).frequencies)


def test_explicit_steps_beyond_what_drag_allows_are_refused() -> None:
    """A sphere alone: the step is limited to one over its rate, m / (6 pi mu R).

    Catches: a limit from stiffness alone; half or double the rate.
    """
    mu, R, m = 1e-4, 0.5, 2e-6
    body = Body((0.0, 0.0, 0.0), m, (1.0, 1.0, 1.0), "ball", 4.0 / 3.0 * np.pi * R**3)
    model = RodModel(bodies=[body], loads=[Drag(mu)])
    limit = m / (6.0 * np.pi * mu * R)
    settings = Settings(integrator=Integrator.explicit)
    with pytest.raises(ModelError, match=f"expected at most {limit:.3g} s"):
        dynamics(model, 10 * limit, 1.02 * limit, settings=settings)
    start = replace(model.drawn(), v=np.eye(1, 6))
    kept = dynamics(model, 400 * limit, 0.98 * limit, start=start, settings=settings)
    assert np.abs(kept.v[-1]).max() <= 1e-3
    assert kept.book[-1, 0] <= kept.book[0, 0]


# ---- the design


def test_a_design_with_viscosity_is_dragged_and_one_without_is_not() -> None:
    """Each pillar with its ring one sphere, each bay one; quadratic with the medium's density.

    Catches: a key without effect, drag in every submerged design, a ring counted beside its pillar.
    """
    wet = load_design("junction_bot", ["ground.immersion=submerged"])
    assert len(reduce(wet).assembly.drag.node) == 0
    dragged = reduce(load_design("junction_bot", ["ground.immersion=submerged", "ground.viscosity=0.7 mPa s"]))
    d = dragged.assembly.drag
    whole = [sum(b.volume for b in dragged.bodies if b.name.endswith(end)) for end in ("_short", "_long")]
    whole.append(7.0 * 7.0 * 0.68)
    radii = np.cbrt(0.75 * np.array(whole) / np.pi)
    assert d.across.sum() == pytest.approx(6.0 * np.pi * 0.7e-6 * radii.sum(), rel=1e-12)
    assert d.quadratic.sum() == pytest.approx(0.22 * np.pi * 1e-6 * (radii**2).sum(), rel=1e-12)


def test_viscosity_without_a_medium_is_refused() -> None:
    """Catches: a key that is ignored."""
    with pytest.raises(DesignError, match=r"ground\.viscosity: found 1 mPa s with ground\.immersion \"air\""):
        load_design("junction_bot", ["ground.viscosity=1 mPa s"])


def test_linear_drag_is_alike_in_all_directions() -> None:
    """Force and moment of a bent rod that moves rigidly are its length times the coefficients, against the motion.

    Catches: a rod's axis kept, moments of the lumps without the coefficient, halves at the ends counted whole.
    """
    rod = Rod(arc(40, 3.0, 1.2), Section.circle(0.1), STEEL)
    model = RodModel([rod], loads=[LinearDrag(["rod"], 0.3, 0.07)])
    D, n = model.assembly.drag, model.n_nodes
    length = 3.0 * 1.2
    for velocity, spin in (((0.4, -0.2, 0.9), (0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (0.3, 0.5, -0.2))):
        v, force = np.zeros((n, 6)), np.zeros((n, 6))
        v[:, :3], v[:, 3:] = velocity, spin
        kernels.add_drag(D, np.tile(np.eye(3), (n, 1, 1)), v, force)
        np.testing.assert_allclose(force[:, :3].sum(axis=0), -0.3 * length * np.array(velocity), rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(force[:, 3:].sum(axis=0), -0.07 * length * np.array(spin), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(
    ("loads", "word"),
    [
        (lambda: [LinearDrag(["rod"], -1.0)], "linear drag: force: found -1.0"),
        (lambda: [LinearDrag(["rod"], 1.0, np.nan)], "linear drag: moment: found nan"),
        (lambda: [LinearDrag("rod", 1.0)], "linear drag: rods: found 'rod', expected a sequence"),
        (lambda: [LinearDrag(["other"], 1.0)], "linear drag: no rod of the name 'other', expected one of: rod"),
        (lambda: [LinearDrag(["rod"], 1.0), Drag(1e-6)], "'rod' is dragged twice"),
        (lambda: [Drag(1e-6), LinearDrag(["rod"], 1.0)], "'rod' is dragged twice"),
    ],
)
def test_linear_drag_that_cannot_be_is_refused(loads: Any, word: str) -> None:
    """In one line.

    Catches: a rod of another name left out in silence, two drags added up.
    """
    with pytest.raises(ModelError, match=word):
        RodModel([Rod(straight(40, 9.0), Section.circle(0.1), STEEL)], loads=loads())
