"""Measures of a machine on states whose answer is known: rigid motions, drawn shapes, blocked and free strips."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.errors import MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.solid.from_design import model_from_design, tension_step
from fem_biobot.solid.measures import BALL_RADIUS, Measurer, eq3_stiffness, measures, muscle_work
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.records import Fix, Step
from fem_biobot.solid.stress import von_mises
from tests.helpers import committed_bot, rotation
from tests.oracles.free_muscle import across, free_stretches
from tests.oracles.laws import ISOTROPIC, principal

DESIGN, MESH = committed_bot()
MODEL = model_from_design(DESIGN, MESH)


def _moved(x: np.ndarray, tension: float = 0.0) -> SolidState:
    """The state with nodes at x."""
    return SolidState(MODEL, Step(1.0, tension), np.ascontiguousarray(x - MODEL.system.space.points))


def _bent(X: np.ndarray, radius: float) -> np.ndarray:
    """The machine bent about the y axis, its beam's axis on a circle, sections staying plane."""
    z = DESIGN.beam_axis_height
    half = DESIGN.span / 2
    inside = np.clip(X[0], -half, half)
    angle, beyond = inside / radius, X[0] - inside
    down = X[2] - z
    return np.stack(
        [
            (radius + down) * np.sin(angle) + beyond * np.cos(angle),
            X[1],
            z - radius + (radius + down) * np.cos(angle) - beyond * np.sin(angle),
        ]
    )


@pytest.mark.parametrize("turned", [False, True])
def test_sagitta_and_closing_of_a_circle(turned: bool) -> None:
    """Bent to a radius the span's sagitta is R (1 - cos(L/2R)), and rigid pillars bring the soles together.

    Catches: the sagitta of the sole's chord, a closing of the feet's nearest points or along global x.
    """
    radius = 12.0
    X = MODEL.system.space.points
    x = _bent(X, radius)
    if turned:
        x = rotation(44) @ x + 3.0
    found = Measurer(DESIGN, MODEL)
    state = _moved(x)
    angle = DESIGN.span / 2 / radius
    assert found.sagitta(state) == pytest.approx(radius * (1.0 - np.cos(angle)), rel=1e-12)
    # sole centroids: 1.75 mm beyond the span's ends and 2.8 or 3.4 mm below the axis, on turned pillars
    apart = 2.0 * radius * np.sin(angle) + 3.5 * np.cos(angle) - (2.8 + 3.4) * np.sin(angle)
    assert found.tip_closing(state) == pytest.approx(7.0 + 3.5 - apart, rel=1e-12)


def test_a_rigid_motion_measures_nothing() -> None:
    """Turned and moved without strain: no closing, no sagitta, no force, no stress, no energy.

    Catches: any measure that feels the frame.
    """
    state = _moved(rotation(3) @ MODEL.system.space.points - 2.0)
    values = measures(state, DESIGN)
    assert values["tip_closing_mm"] == pytest.approx(0.0, abs=1e-12)
    for key in ("sagitta_mm", "muscle_force_mN", "eq3_force_mN", "max_von_mises_kPa", "strain_energy_uJ"):
        assert abs(values[key]) < 1e-10, key
    assert values["fibre_stretch_1"] == pytest.approx(1.0, rel=1e-13)
    assert values["smallest_volume_ratio_1"] == pytest.approx(1.0, rel=1e-12)


def test_the_muscle_force_of_a_stretched_strand_is_stress_times_area() -> None:
    """Stretched freely, contracting and turned in space, the muscle pulls with its stress on the reference section.

    Sides without traction, so that what one layer of elements passes on is the flux. Catches: a force along a global
    axis, the current area, the active or the passive part alone, gel counted in.
    """
    s, tension = 0.9, 0.5 * (9.09 + 1.30)
    t = across(s, 0.47)
    state = _moved(rotation(21) @ np.diag([s, t, t]) @ MODEL.system.space.points, 0.5)
    passive = ISOTROPIC["neo_hooke"](np.array([s, t, t]), 10.0, 0.47, {})[1][0]
    values = measures(state, DESIGN)
    assert values["muscle_force_mN"] == pytest.approx((passive + tension) * 2.2 * 0.4, rel=1e-10)
    assert values["tension_kPa"] == pytest.approx(tension)
    assert values["fibre_stretch_1"] == pytest.approx(s, rel=1e-12)
    assert Measurer(DESIGN, MODEL).passive_fibre_stress(state) == pytest.approx(passive, rel=1e-10)
    assert passive < -0.5


def test_the_two_strands_of_a_loop_are_counted_together() -> None:
    """A loop's force at rest is its tension times both strands' area.

    Catches: one strand; a section of the pillar's ring.
    """
    design = load_design("ring_bot")
    model = model_from_design(design, committed_mesh(design, 2.0))
    state = SolidState(model, tension_step(design, 5.0), np.zeros_like(model.system.space.points))
    area = 2.0 * design.value("muscle.ring_thickness") * design.value("muscle.ring_height")
    assert measures(state, design)["muscle_force_mN"] == pytest.approx(5.0 * area, rel=1e-10)


def test_stress_in_the_ball_and_its_largest_value() -> None:
    """In a homogeneous state ball average and maximum of gel are its von Mises stress; the ball is 0.3 mm in radius.

    Catches: a ball about another corner inside the muscle, an average over elements of any size.
    """
    F = np.array([[1.1, 0.05, 0.0], [0.0, 0.95, 0.04], [0.02, 0.0, 1.0]])
    state = _moved(F @ MODEL.system.space.points)
    sigma = principal("neo_hooke", F, 319.4, 0.45)[1] @ F.T / np.linalg.det(F)
    expected = float(von_mises(sigma))
    values = measures(state, DESIGN)
    assert values["ball_von_mises_kPa"] == pytest.approx(expected, rel=1e-9)
    assert values["max_von_mises_kPa"] == pytest.approx(expected, rel=1e-9)
    assert BALL_RADIUS == 0.3


def test_the_ball_lies_at_the_short_pillars_corner() -> None:
    """Under a stress that grows with the distance r from the corner line its average is that of r over a ball.

    Small strain: u_z = k dx^2/2 and u_y = k dz^2/2 give sqrt(3) mu k r; the mean of r over a ball of radius R is
    3 pi R / 16, the same in each quadrant. Catches: another corner or height, another radius.
    """
    dx, dz = MODEL.system.space.points[0] + 3.5, MODEL.system.space.points[2] - (3.4 - 0.34)
    k, mu = 1e-5, 319.4 / 2.9
    u = 0.5 * k * np.stack([0 * dx, dz**2, dx**2])
    average = measures(SolidState(MODEL, Step(1.0, 0.0), u), DESIGN)["ball_von_mises_kPa"]
    assert average == pytest.approx(np.sqrt(3.0) * mu * k * 3.0 * np.pi * 0.3 / 16.0, rel=0.02)


def test_eq3_is_the_sagitta_times_eight_EI_over_l_L_squared() -> None:
    """k = 8 E I / (l L^2) with the preset's numbers, and the inferred force is k times the sagitta.

    Catches: the cube of the span, twice the arm, I of the other axis.
    """
    k = 8.0 * 319.4 * (7.0 * 0.68**3 / 12.0) / (2.0 * 7.0**2)
    assert eq3_stiffness(DESIGN) == pytest.approx(k, rel=1e-12)
    values = measures(_moved(_bent(MODEL.system.space.points, 12.0)), DESIGN)
    assert values["eq3_force_mN"] == pytest.approx(k * values["sagitta_mm"], rel=1e-12)


def test_a_strip_measures_its_shortening_and_no_beam() -> None:
    """A free strip closes by (1 - s) times its length, pulls with nothing, and has no sagitta.

    Catches: keys of a machine reported as zero for a strip.
    """
    design = load_design("strip")
    model = model_from_design(design, committed_mesh(design, 2.0))
    values = measures(solve(model, [tension_step(design, 5.0)]).last, design)
    muscle = model.materials["muscle"]
    s, _ = free_stretches(5.0 / muscle.mu, muscle.poisson)
    assert values["tip_closing_mm"] == pytest.approx(7.0 * (1.0 - s), rel=1e-6)
    assert values["fibre_stretch_1"] == pytest.approx(s, rel=1e-6)
    assert abs(values["muscle_force_mN"]) < 1e-6
    assert values["sagitta_mm"] is values["eq3_force_mN"] is values["ball_von_mises_kPa"] is None


def test_a_blocked_strip_pulls_with_tension_times_section() -> None:
    """Held at its ends and sides free of load, a strip along its length pulls with T A less what its sides give way.

    Here all its surface is held, so exactly T A sin^2(theta). Catches: the section's normal for the fibre.
    """
    design = load_design("strip", ["muscle.theta=65 deg"])
    mesh = committed_mesh(design, 2.0)
    base = model_from_design(design, mesh)
    model = SolidModel(mesh, base.materials, base.active, [Fix("end_minus"), Fix("end_plus")])
    state = SolidState(model, tension_step(design, 5.0), np.zeros_like(model.system.space.points))
    expected = 5.0 * 2.2 * 0.4 * np.sin(np.radians(65.0)) ** 2
    assert measures(state, design)["muscle_force_mN"] == pytest.approx(expected, rel=1e-10)


def test_a_cantilever_measures_its_tip() -> None:
    """A cantilever's deflection is the mean over its tip face; it has no muscle and no sagitta.

    Catches: the deflection of one node, None for a number.
    """
    design = load_design("cantilever")
    model = model_from_design(design, committed_mesh(design, 2.0))
    X = model.system.space.points
    u = np.stack([0 * X[0], 0 * X[0], 0.01 * X[0] ** 2 * (1.0 + 0.3 * X[1] ** 2)])
    values = measures(SolidState(model, Step(), u), design)
    # mean of y^2 over a width of 7 mm is 49/12
    assert values["tip_deflection_mm"] == pytest.approx(0.01 * 14.0**2 * (1.0 + 0.3 * 49.0 / 12.0), rel=1e-10)
    assert values["muscle_force_mN"] is values["tension_kPa"] is values["sagitta_mm"] is None


def test_the_muscles_work_is_the_energy_stored() -> None:
    """Along the path to 9 kPa the work of the tension equals the strain energy at every state, to the spline's error.

    Catches: work of the force at full drive, the passive energy counted twice, the path's start left out.
    """
    path = np.linspace(0.0, 9.0, 10)[1:]
    solution = solve(MODEL, [tension_step(DESIGN, T) for T in path], settings=NewtonSettings(tolerance=1e-8))
    measurer = Measurer(DESIGN, MODEL)
    lengths = [measurer.tension_length(state) for state in solution.states]
    work = muscle_work([state.step.tension for state in solution.states], lengths)
    energy = [state.energy for state in solution.states]
    np.testing.assert_allclose(work, energy, rtol=0.0, atol=1e-4 * energy[-1])
    assert work[-1] > 0.0


def test_work_of_a_known_path() -> None:
    """L = -s^2 gives 2/3 s^3, by the spline; a path that turns back is summed by trapezoids and undone.

    Catches: the sign, the start at a tension of zero left out.
    """
    s = np.linspace(0.0, 2.0, 9)[1:]
    np.testing.assert_allclose(muscle_work(s, -(s**2)), 2.0 / 3.0 * s**3, rtol=1e-12)
    back = muscle_work([1.0, 2.0, 1.0, 0.0], [-1.0, -2.0, -1.0, 0.0])
    np.testing.assert_allclose(back, [0.5, 2.0, 0.5, 0.0], atol=1e-14)


def test_landmarks_that_a_mesh_does_not_name_are_interpolated() -> None:
    """A mesh without named points measures the same.

    Catches: the nearest vertex taken.
    """
    bare = BodyMesh(MESH.points, MESH.cells, MESH.regions, MESH.surfaces)
    model = model_from_design(DESIGN, bare)
    x = _bent(MODEL.system.space.points, 12.0)
    state = SolidState(model, Step(1.0, 0.0), x - model.system.space.points)
    assert Measurer(DESIGN, model).sagitta(state) == pytest.approx(12.0 * (1.0 - np.cos(3.5 / 12.0)), rel=1e-9)


def test_what_a_mesh_lacks_is_named() -> None:
    """Without sole surfaces, without tissue across the mid-section or in the middle fifth, the measure says so.

    Catches: an average over nothing.
    """
    bare = model_from_design(DESIGN, BodyMesh(MESH.points, MESH.cells, MESH.regions))
    state = SolidState(bare, Step(1.0, 0.0), np.zeros_like(bare.system.space.points))
    with pytest.raises(MeshError, match="foot_short: found no such surface"):
        Measurer(DESIGN, bare).tip_closing(state)
    X = MESH.points[0, MESH.cells].mean(axis=0)
    muscle = MESH.regions["muscle"]
    away = np.abs(X[muscle]) > 2.0
    regions = {
        "skeleton": np.sort(np.concatenate([MESH.regions["skeleton"], muscle[~away]])),
        "muscle": muscle[away],
    }
    # the smooth fibres of a bot would ask for tissue from end to end
    design = DESIGN.with_values({"muscle.fibres": "piecewise"})
    torn = model_from_design(design, BodyMesh(MESH.points, MESH.cells, regions, MESH.surfaces, MESH.landmarks))
    state = SolidState(torn, Step(1.0, 0.0), np.zeros_like(torn.system.space.points))
    with pytest.raises(MeshError, match="no tissue across x = 0"):
        Measurer(DESIGN, torn).muscle_force(state)
    with pytest.raises(MeshError, match="middle fifth"):
        Measurer(DESIGN, torn).fibre_stretch(state)
