"""From a design to a model: laws, fibres, tension, supports, loads, and tissue that has remodelled."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.errors import BiobotError, MeshError
from fem_biobot.material import NaturalState, NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.muscle.fibres import fibre_field, in_junction
from fem_biobot.solid.from_design import (
    densities,
    model_from_design,
    newton_settings,
    remodelled,
    tension_step,
    tension_unit,
)
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.records import Fix, Step, Traction
from tests.helpers import TIGHT, committed_bot
from tests.oracles.free_muscle import free_stretches


def test_each_region_has_its_law_and_the_muscle_its_tension() -> None:
    """Moduli, fibres, tension at full drive and element come from the keys of the design.

    Catches: moduli swapped, the passive tension left out, gamma applied twice.
    """
    design, mesh = committed_bot()
    model = SolidModel.from_design(design, mesh)
    assert model.materials == {"skeleton": NeoHooke(319.4, 0.45), "muscle": NeoHooke(10.0, 0.47)}
    assert model.active["muscle"].tension == pytest.approx(9.09 + 1.30)
    np.testing.assert_array_equal(model.active["muscle"].a0, fibre_field(design, mesh))
    assert model.loads == ()
    half = load_design("junction_bot", ["muscle.gamma=0.5", "drive.amplitude=0.6"])
    assert tension_unit(half) == pytest.approx(0.5 * (9.09 + 0.6 * 1.30))
    assert tension_step(half, 2.0) == Step(1.0, 2.0 / tension_unit(half))


def test_densities_are_those_of_the_parts() -> None:
    """Each part of the design gives its region's density, a part that is not there none.

    Catches: one density for gel and tissue.
    """
    bot = load_design("junction_bot", ["muscle.material.density=1.2 g/cm^3"])
    assert bot.skeleton is not None
    assert densities(bot) == {"skeleton": bot.skeleton.material.density, "muscle": pytest.approx(1.2e-6)}
    assert list(densities(load_design("strip"))) == ["muscle"]


def test_a_design_without_tension_counts_in_kilopascals() -> None:
    """Where the design has no tension a factor of 1 is 1 kPa, so that a path can be asked for.

    Catches: a division by zero.
    """
    design = load_design("junction_bot", ["muscle.passive_tension=0 kPa", "muscle.active_tension=0 kPa"])
    assert tension_unit(design) == 1.0
    assert tension_step(design, 3.0) == Step(1.0, 3.0)


def test_a_strip_contracts_freely_between_its_supports() -> None:
    """The strip of the preset has the stretches of the scalar equations all over, at its passive tension.

    Catches: supports that hold the strip's width, a fibre across, a strip that drifts.
    """
    design = load_design("strip")
    mesh = committed_mesh(design, 2.0)
    model = model_from_design(design, mesh)
    state = solve(model, [tension_step(design, 9.09)], settings=TIGHT).last
    muscle = model.materials["muscle"]
    s, t = free_stretches(9.09 / muscle.mu, muscle.poisson)
    np.testing.assert_allclose(state.stretch, s, rtol=0.0, atol=1e-8)
    end = np.unique(mesh.surfaces["end_minus"])
    assert not state.u[0, end].any()
    # the end stays at its height and breadth, apart from the contraction across
    centre = mesh.points[:, [mesh.landmarks["end_minus_centre"]]]
    expected = ((t - 1.0) * (mesh.points[:, end] - centre))[1:]
    np.testing.assert_allclose(state.u[1:, end], expected, rtol=0.0, atol=1e-8)
    assert np.abs(state.reaction("end_minus")).max() < 1e-9


def test_a_cantilever_carries_its_tip_force() -> None:
    """The clamp bears the tip force of the design, along z.

    Catches: the force as a stress, the sign, another face.
    """
    design = load_design("cantilever", ["load.tip_force=0.02 mN"])
    model = model_from_design(design, committed_mesh(design, 2.0))
    assert model.supports == (Fix("clamp"),)
    assert isinstance(model.loads[0], Traction)
    state = solve(model, settings=TIGHT).last
    np.testing.assert_allclose(state.reaction("clamp"), [0.0, 0.0, -0.02], rtol=0.0, atol=1e-10)
    assert state.at(design.landmarks()["tip_centre"])[2] > 0.0


def test_a_mesh_without_the_region_is_refused() -> None:
    """A strip's mesh cannot serve a machine: the missing region is named.

    Catches: a machine without its skeleton solved.
    """
    with pytest.raises(MeshError, match="skeleton: found no such region"):
        model_from_design(load_design("junction_bot"), committed_mesh(load_design("strip")))


@pytest.mark.parametrize("name", ["junction_bot", "strip", "cantilever"])
def test_a_mesh_without_names_is_used_or_refused_but_never_a_crash(name: str) -> None:
    """A stranger's mesh may name nothing: free supports find their vertices, or the error says what is missing.

    Catches: a bare KeyError.
    """
    design = load_design(name)
    whole = committed_mesh(design, 2.0)
    bare = BodyMesh(whole.points, whole.cells, whole.regions)
    if name == "junction_bot":
        assert model_from_design(design, bare).supports == model_from_design(design, whole).supports
        return
    with pytest.raises(BiobotError, match=r"end_minus|clamp"):
        model_from_design(design, bare)


def test_remodelled_tissue_is_free_of_passive_stress_in_its_natural_shape() -> None:
    """Only the junction's tissue gets a natural state, contracted along its fibres with its volume kept.

    Catches: the rings remodelled too, F0 in the order of the region, a contraction of the volume.
    """
    design, mesh = committed_bot()
    model = model_from_design(design, mesh)
    changed = remodelled(model, design, 0.8)
    law = changed.materials["muscle"]
    assert isinstance(law, NaturalState)
    assert changed.materials["skeleton"] is model.materials["skeleton"]
    muscle = mesh.regions["muscle"]
    block = muscle[in_junction(design, mesh.points[:, mesh.cells[:, muscle]].mean(axis=1))]
    others = np.setdiff1d(np.arange(mesh.n_elements), block)
    expected = np.diag([0.8, 0.8**-0.5, 0.8**-0.5])
    np.testing.assert_allclose(law.F0[:, :, block], np.repeat(expected[:, :, None], len(block), axis=2), atol=1e-14)
    np.testing.assert_array_equal(law.F0[:, :, others], np.repeat(np.eye(3)[:, :, None], len(others), axis=2))


def test_remodelled_tissue_gives_way_less() -> None:
    """At the same tension a muscle whose rest length is shorter pulls harder and closes the machine further.

    With no passive stress to overcome its force is the whole tension; as moulded a part of it presses the tissue.
    Catches: the natural state of the inverse stretch.
    """
    design, mesh = committed_bot()
    model = model_from_design(design, mesh)
    loose = NewtonSettings(tolerance=1e-7)
    measurer = Measurer(design, model)
    forces = []
    for machine in (model, remodelled(model, design, 0.96)):
        state = solve(machine, [tension_step(design, 4.0)], settings=loose).last
        forces.append(measurer.muscle_force(state))
    assert forces[1] > 1.03 * forces[0]


def test_the_settings_of_a_design_reach_the_solver() -> None:
    """Tolerance and the choice of the linear solver are those of `numerics`.

    Catches: a key that is read and forgotten.
    """
    design = load_design("junction_bot", ["numerics.tolerance=1e-7", 'numerics.linear="iterative"'])
    assert newton_settings(design) == NewtonSettings(tolerance=1e-7, linear="iterative")
    assert newton_settings(load_design("junction_bot")) == NewtonSettings()
