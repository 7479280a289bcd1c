"""Time steps of solids: derivatives, contact points, settings, checkpoints, failures and refusals."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.friction.ground import Ground
from fem_biobot.material import ActiveStress, ForceVelocity, NeoHooke
from fem_biobot.material.conventions import Convention
from fem_biobot.solid.dynamics.body import holding, moving_body
from fem_biobot.solid.dynamics.contact import untouched
from fem_biobot.solid.dynamics.feet import feet_of
from fem_biobot.solid.dynamics.integrate import rigid_velocity, solid_dynamics
from fem_biobot.solid.dynamics.motion import SolidCheckpoint, SolidMotionInterrupted, joined
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.dynamics.step import Interval, State, Stepper
from fem_biobot.solid.dynamics.strain import green_lagrange, stretch_of
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.records import Fix, Foundation, Pressure, Step, Symmetry
from tests.helpers import (
    TIGHT,
    box_mesh,
    generator,
    generic_gradients,
    on_three_corners,
    rotation,
    taylor_slope,
    turned_about,
)

SIZE = (1.0, 0.8, 0.5)
DENSITY = {"muscle": 1.1e-6}
DOWN = (0.0, 0.0, -9810.0)


def _model(element: str = "P1", **more: Any) -> SolidModel:
    given: dict[str, Any] = {
        "active": {"muscle": ActiveStress(3.0, np.array([0.6, 0.8, 0.0]))},
        "supports": on_three_corners(SIZE),
        **more,
    }
    return SolidModel(box_mesh((2, 1, 1), SIZE), {"muscle": NeoHooke(20.0, 0.3)}, element=element, **given)


def _fall(model: SolidModel | None = None, duration: float = 0.02, step: float = 1e-3, **more: Any) -> Any:
    given: dict[str, Any] = {"densities": DENSITY, "gravity": DOWN, "free": True, **more}
    return solid_dynamics(model or _model(), duration, step, **given)


@pytest.mark.parametrize("hill", [None, ForceVelocity(40.0, 0.3)])
def test_the_tangent_of_backward_euler_is_the_derivative(hill: ForceVelocity | None) -> None:
    """The remainder of the unbalanced force falls with the square: inertia, stress, muscle, viscosity, springs.

    With a muscle that feels the rate of its stretch, too. Catches: mass over h, viscosity that is not divided by the
    step, a stress of the geometric part without viscosity, the rate's slope left out.
    """
    fibres = ActiveStress(30.0, np.array([0.6, 0.8, 0.0]), force_velocity=hill)
    model = _model("P2", supports=[*on_three_corners(SIZE), Foundation("z0", 3.0, 1.0)], active={"muscle": fibres})
    body = moving_body(model, DENSITY, gravity=DOWN, damping_time=2e-3, free=True)
    stepper = Stepper(body, None, DynamicsSettings())
    draw = generator()
    n = model.system.space.n_nodes
    u0, u, direction = (scale * draw.normal(size=(n, 3)) for scale in (0.01, 0.012, 0.01))
    state = State(u0, draw.normal(size=(n, 3)), np.zeros((n, 3)), untouched(0), np.zeros(model.system.n_pressures))
    interval = Interval(3e-3, Step(tension=0.7), Step(tension=0.7))
    here = stepper.forces(state, u, interval)
    data = stepper._tangent(here, here.points.S, u, interval)
    along = body.system.product(data, direction.ravel())

    def force(eps: float) -> np.ndarray:
        return stepper.forces(state, u + eps * direction, interval).unbalanced[:, None]

    assert taylor_slope(force, along[:, None]) == pytest.approx(2.0, abs=0.1)


def test_forces_without_a_potential_have_the_symmetric_part_of_their_tangent() -> None:
    """``a . K b`` of the matrix is the mean of ``a . f'(b)`` and ``b . f'(a)``.

    Of tension per current area that feels its rate, and pressure on an open surface. And the force itself is not
    symmetric there. Catches: the skew part added, one of the two forces left out.
    """
    fibres = ActiveStress(30.0, np.array([0.6, 0.8, 0.0]), Convention.cauchy, force_velocity=ForceVelocity(40.0, 0.3))
    model = _model("P2", active={"muscle": fibres}, loads=[Pressure("x1", 8.0)])
    stepper = Stepper(moving_body(model, DENSITY, damping_time=2e-3, free=True), None, DynamicsSettings())
    draw = generator()
    n = model.system.space.n_nodes
    u0, u, a, b = (scale * draw.normal(size=(n, 3)) for scale in (0.01, 0.012, 1.0, 1.0))
    state = State(u0, draw.normal(size=(n, 3)), np.zeros((n, 3)), untouched(0), np.zeros(model.system.n_pressures))
    interval = Interval(3e-3, Step(tension=0.7), Step(tension=0.7))

    def by(direction: np.ndarray) -> np.ndarray:
        eps = 1e-6
        ends = [stepper.forces(state, u + s * eps * direction, interval).unbalanced for s in (1.0, -1.0)]
        return (ends[0] - ends[1]) / (2.0 * eps)

    here = stepper.forces(state, u, interval)
    data = stepper._tangent(here, here.points.S, u, interval)
    one, other = float(a.ravel() @ by(b)), float(b.ravel() @ by(a))
    found = float(a.ravel() @ stepper.body.system.product(data, b.ravel()))
    assert found == pytest.approx(0.5 * (one + other), rel=1e-6)
    assert abs(one - other) > 1e-3 * abs(found)


def test_tension_per_current_area_settles_where_the_static_solver_finds_it() -> None:
    """A damped block comes to rest in the equilibrium that the unsymmetric solver has; the book closes on the way.

    Catches: a residual of the symmetric part, a tension per reference area, work that is not entered.
    """
    fibres = ActiveStress(3.0, np.array([0.6, 0.8, 0.0]), Convention.cauchy)
    model = _model("P2", active={"muscle": fibres})
    found = _fall(
        model, 0.4, 0.02, free=False, damping_time=0.01, gravity=(0.0, 0.0, 0.0), drive=lambda t: 1.0,
        settings=DynamicsSettings(tolerance=1e-12),
    )  # fmt: skip
    wanted = solve(model, [0.5, 1.0], settings=TIGHT).states[-1]
    assert np.abs(wanted.u).max() > 0.02
    np.testing.assert_allclose(found.u[-1], wanted.u, atol=1e-8)
    assert np.abs(found.energy_error).max() <= 1e-8 * found.energy("muscle")[-1]
    assert found.halved == 0


def test_stimulation_differs_in_space_and_time() -> None:
    """A strip held at both ends, its halves stimulated in turn: at each instant two scalar equations.

    ``E/2 (s - 1/s) + T`` is the same in both halves, whose stretches add up to 2; tissue that weighs almost nothing.
    Catches: the activation at the step's beginning or at time 0, the standing tension stimulated.
    """
    young, standing, whole = 12.0, 1.0, 5.0
    share = lambda X, t: np.where(X[0] < 1.0, np.sin(30.0 * t) ** 2, np.cos(30.0 * t) ** 2)  # noqa: E731
    fibres = ActiveStress(whole, np.array([1.0, 0.0, 0.0]), standing=standing, activation=share)
    held = [Symmetry("x0"), Symmetry("x1"), Symmetry("y0"), Symmetry("z0")]
    mesh = box_mesh((2, 1, 1), (2.0, 0.8, 0.5))
    model = SolidModel(mesh, {"muscle": NeoHooke(young, 0.0)}, {"muscle": fibres}, held, element="P1")
    found = solid_dynamics(model, 0.05, 5e-3, densities={"muscle": 1e-12}, drive=lambda t: Step(tension=1.0, time=t))
    middle = int(np.argmin(np.abs(mesh.points[0] - 1.0)))
    seen = []
    for t, u in zip(found.times[1:], found.u[1:], strict=True):
        left, right = (standing + (whole - standing) * float(f(30.0 * t)) ** 2 for f in (np.sin, np.cos))

        def gap(s: float, left: float = left, right: float = right) -> float:
            one, two = (0.5 * young * (x - 1.0 / x) for x in (s, 2.0 - s))
            return one + left - two - right

        root: Any = brentq(gap, 0.5, 1.5, xtol=1e-14)
        s = float(root)
        assert u[0, middle] == pytest.approx(s - 1.0, abs=1e-6)
        seen.append(s)
    assert np.ptp(seen) > 0.1


def test_a_strain_is_that_of_its_upper_triangular_gradient() -> None:
    """``stretch_of`` gives a gradient of the same strain, also at large ones.

    Catches: a doubled shear, a transposed triangle.
    """
    E = green_lagrange(generic_gradients(10)[..., None])
    np.testing.assert_allclose(green_lagrange(stretch_of(E)), E, rtol=0.0, atol=1e-13 * np.abs(E).max())


def test_contact_points_stand_for_the_whole_sole() -> None:
    """Areas add up to the surfaces'; on quadratic facets the sides stand for it, on linear ones the corners.

    Catches: areas added once for nodes of several facets, sides and corners exchanged.
    """
    for element in ("P1", "P2"):
        feet = feet_of(moving_body(_model(element), DENSITY), ["z0", "z1"])
        for k in range(2):
            assert feet.area[feet.owner == k].sum() == pytest.approx(SIZE[0] * SIZE[1], rel=1e-12)
        corners = feet.nodes < box_mesh((2, 1, 1), SIZE).n_vertices
        assert np.all((feet.area > 0.0) == (corners if element == "P1" else ~corners))


def test_a_ground_stops_the_chosen_points_alone() -> None:
    """A block that falls on chosen points of its sole stands on those; the others bear nothing, and none is refused.

    Catches: a choice that is not passed on, owners or areas of other points, a foot left without any.
    """
    body = moving_body(_model("P2"), DENSITY, gravity=(0.0, 0.0, -9810.0), damping_time=1e-3, free=True)
    whole = feet_of(body, ["z0"])
    X = body.system.space.points[:, whole.nodes]
    chosen = (np.isclose(X[0], X[0].min()) | np.isclose(X[0], X[0].max())) & np.isclose(
        np.abs(X[1] - X[1].mean()), np.ptp(X[1]) / 2
    )
    feet = whole.only(chosen)
    assert len(feet.nodes) == 4
    assert np.array_equal(feet.area, whole.area[chosen])
    height = float(body.system.space.points[2].min())
    motion = solid_dynamics(body, 0.2, 2e-3, ground=Ground(0.4, 0.3, height=height), feet=feet, sample_every=50)
    assert motion.contact_force.shape[1] == 4
    assert motion.contact_force[-1, :, 0].sum() == pytest.approx(9810.0 * body.total_mass, rel=1e-3)
    with pytest.raises(ModelError, match="no point of 'z1' chosen"):
        feet_of(body, ["z0", "z1"]).only(np.arange(2 * len(whole.nodes)) < len(whole.nodes))


def test_unknowns_that_are_held_stay_and_the_others_move() -> None:
    """A shrinking block whose sole keeps its width moves on the sole lengthwise alone; its supports do no work.

    Catches: unknowns of another axis, a tangent without the rows taken out, a body that has supports already.
    """
    body = moving_body(_model("P2"), DENSITY, damping_time=1e-3, free=True)
    nodes = feet_of(body, ["z0"]).nodes
    still = holding(body, 3 * nodes + 1)
    motion = solid_dynamics(still, 0.02, 2e-3, drive=lambda t: 1.0)
    u = motion.u[-1]
    others = np.setdiff1d(np.arange(u.shape[1]), nodes)
    assert not u[1, nodes].any()
    assert np.abs(u[1, others]).max() > 1e-3
    assert np.abs(u[0, nodes]).max() > 1e-3
    assert np.abs(motion.energy("supports")).max() == 0.0
    assert np.abs(motion.energy_error).max() < 1e-6 * np.abs(motion.energy("muscle")).max()
    with pytest.raises(ModelError, match="found a body with supports"):
        holding(still, 3 * nodes)


def test_a_motion_goes_on_from_its_checkpoint() -> None:
    """Two runs in a row repeat a run of the same two parts from a file, bit by bit, and join into one.

    Catches: what slips forgotten, a clock that starts anew, the predictor's change lost.
    """
    more: dict[str, Any] = {"ground": Ground(0.4, 0.2), "feet": ["z0"], "drive": lambda t: 5.0 * t}
    first = _fall(velocity=(200.0, 0.0, 0.0), **more)
    second = _fall(start=first.final, **more)
    again = _fall(start=SolidCheckpoint.from_arrays(first.final.arrays()), **more)
    assert np.array_equal(again.u, second.u)
    assert np.array_equal(again.book, second.book)
    whole = joined([first, second])
    assert whole.steps == 40
    assert len(whole.times) == 41
    assert len(whole.drive) == 41
    assert whole.times[-1] == pytest.approx(0.04)
    assert np.abs(whole.energy_error).max() <= 1e-6 * whole.book[0, 0]


def test_a_step_that_fails_is_halved() -> None:
    """A step in which an element is turned inside out is made in parts, and the motion goes on.

    Catches: a step accepted as it is, halves of the wrong length.
    """
    n = _model().system.space.n_nodes
    v = 400.0 * generator().normal(size=(3, n))
    found = _fall(velocity=v, step=4e-3, duration=4e-3, gravity=(0.0, 0.0, 0.0))
    assert found.halved > 0
    assert found.steps > 1
    assert found.times[-1] == pytest.approx(4e-3, rel=1e-12)
    assert np.abs(found.energy_error).max() <= 1e-6 * found.book[0, 0]


def test_a_motion_that_cannot_go_on_keeps_what_was_reached() -> None:
    """Without halvings the failure names time and reason; its best is the motion up to there.

    Catches: an unconverged step accepted, samples lost with the failure.
    """
    v = 4000.0 * generator().normal(size=(3, _model().system.space.n_nodes))
    with pytest.raises(SolveError, match=r"no step of 0\.004 s at 0 s") as failure:
        _fall(velocity=v, step=4e-3, duration=8e-3, settings=DynamicsSettings(halvings=0, max_iterations=3))
    assert len(failure.value.best.times) == 1
    assert failure.value.why


def test_iterations_that_run_out_are_told() -> None:
    """One iteration is never enough for a step that is not linear.

    Catches: the last iterate taken for an answer.
    """
    with pytest.raises(SolveError, match="no convergence in 1 iterations"):
        _fall(drive=lambda t: 1.0, settings=DynamicsSettings(halvings=0, max_iterations=1))


def test_an_interrupt_keeps_the_samples() -> None:
    """The user stops a motion: what was sampled is there.

    Catches: an interrupt that loses the motion.
    """

    def stop(time: float) -> None:
        if time > 2.5e-3:
            raise KeyboardInterrupt

    with pytest.raises(SolidMotionInterrupted, match=r"interrupted after 0\.003 s") as stopped:
        _fall(listener=stop)
    assert len(stopped.value.best.times) == 4


def test_velocity_of_a_rigid_motion() -> None:
    """Points move about the centre with it: at rest on the axis, across the arm elsewhere.

    Catches: a cross product turned round.
    """
    model = _model()
    v = rigid_velocity(model, (1.0, 2.0, 3.0), (0.0, 0.0, 2.0), (0.0, 0.0, 0.0))
    corner = model.mesh.landmarks["corner_100"]
    assert v[:, corner] == pytest.approx([1.0, 4.0, 3.0])


@pytest.mark.parametrize("scheme", list(Scheme))
def test_supports_that_move_do_their_work(scheme: Scheme) -> None:
    """A held face lifted by its own drive: the work of the supports is in the book, which closes.

    Catches: reactions without inertia, prescribed motion that is left where it was, or taken inside the step.
    """
    model = SolidModel(
        box_mesh((1, 1, 2), SIZE), {"muscle": NeoHooke(20.0, 0.3)}, supports=[Fix("z0", "xyz", (0.0, 0.0, 0.2))]
    )
    found = solid_dynamics(
        model, 0.02, 1e-3, densities=DENSITY, gravity=DOWN, damping_time=1e-4,
        drive=lambda t: Step(load=np.sin(100.0 * t) ** 2, tension=0.0, time=t), settings=DynamicsSettings(scheme),
    )  # fmt: skip
    base = np.unique(model.mesh.surfaces["z0"])
    np.testing.assert_allclose(found.u[-1, 2, base], 0.2 * np.sin(2.0) ** 2, rtol=1e-12)
    assert found.energy("supports")[-1] > 0.0
    assert np.abs(found.energy_error).max() <= 1e-6 * np.abs(found.energy("supports")).max()


REFUSALS: list[tuple[dict[str, Any], str]] = [
    ({"duration": -1.0}, "duration: found -1.0"),
    ({"step": float("nan")}, "step: found nan"),
    ({"step": 1.0}, "step: found 1 s, expected at most the duration"),
    ({"sample_every": 0}, "sample_every: found 0"),
    ({"densities": None}, "densities: found none"),
    ({"densities": {}}, "densities: found none for region"),
    ({"gravity": (0.0, 1.0)}, "gravity: found"),
    ({"damping_time": -1.0}, "damping_time: found -1.0"),
    ({"medium_density": -1e-6}, "medium_density: found"),
    ({"ground": Ground()}, "feet: found none"),
    ({"ground": Ground(), "feet": ["sole"]}, "no surface named 'sole'"),
    ({"ground": Ground(), "feet": ["z0", "x0"]}, "sharing points"),
    ({"ground": Ground(height=0.1), "feet": ["z0"]}, "inside the ground"),
    ({"ground": Ground(velocity=(1.0, 0.0, 1.0)), "feet": ["z0"]}, "a part along the normal"),
    (
        {"ground": Ground(), "feet": ["z0"], "settings": DynamicsSettings(Scheme.energy_momentum)},
        "scheme: found energy_momentum on a ground",
    ),
    ({"velocity": (1.0, 2.0)}, "velocity: found shape"),
    ({"drive": lambda t: float("nan")}, "drive at 0 s"),
    ({"drive": lambda t: np.zeros(2)}, "several numbers"),
    ({"drive": lambda t: Step(loads={"wind": 1.0})}, "found 'wind'"),
]


@pytest.mark.parametrize(("more", "words"), REFUSALS, ids=[words for _, words in REFUSALS])
def test_what_cannot_move_is_refused(more: dict[str, Any], words: str) -> None:
    """Each refusal names the key, what was found and what was expected, in one line.

    Catches: nonsense that is integrated, a refusal that lost its key.
    """
    with pytest.raises(ModelError, match=words) as refusal:
        _fall(**more)
    assert "\n" not in str(refusal.value)


class _WithoutEnergy(NeoHooke):
    """Said to have none."""

    symmetric = False


def test_models_that_do_not_move_are_refused() -> None:
    """Pressures under a corrected stress, tissue without energy, feet in turned axes and starts of another body.

    Catches: a correction that knows no pressure, contact in the wrong axes, a checkpoint of another mesh.
    """
    with pytest.raises(ModelError, match="scheme: found energy_momentum with element P2-P1"):
        _fall(_model("P2-P1"), settings=DynamicsSettings(Scheme.energy_momentum))
    lossy = SolidModel(
        box_mesh((2, 1, 1), SIZE), {"muscle": _WithoutEnergy(20.0, 0.3)}, supports=on_three_corners(SIZE)
    )
    with pytest.raises(ModelError, match="found a passive law without an energy"):
        moving_body(lossy, DENSITY)
    mesh = turned_about(box_mesh((2, 1, 1), SIZE), rotation(4))
    held = SolidModel(mesh, {"muscle": NeoHooke(20.0, 0.3)}, supports=[Symmetry(s) for s in ("z0", "x0", "y0")])
    with pytest.raises(ModelError, match="held along axes of its own"):
        feet_of(moving_body(held, DENSITY), ["z0"])
    other = _fall(_model("P2"), duration=1e-3)
    with pytest.raises(ModelError, match="checkpoint of another body"):
        _fall(start=other.final)
    with pytest.raises(ModelError, match="found displacements of shape"):
        _fall(start=SolidState(_model(), Step(), np.zeros((3, 4))))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"scheme": "leapfrog"}, "scheme: found 'leapfrog'"),
        ({"tolerance": 1.0}, "tolerance: found 1.0"),
        ({"dissipation": -1.0}, "dissipation: found -1.0"),
        ({"max_iterations": 0}, "max_iterations: found 0"),
        ({"halvings": 1.5}, "halvings: found 1.5"),
    ],
)
def test_settings_refuse_what_makes_no_sense(given: dict[str, Any], words: str) -> None:
    """Settings name the key that is wrong.

    Catches: a limit that is not checked.
    """
    with pytest.raises(ModelError, match=words):
        replace(DynamicsSettings(), **given)
