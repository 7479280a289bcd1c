"""Sliding contact of two parts of a body: doubled mesh, derivatives, patch test, stick and slip, what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot import BodyMesh, Fix, SolidModel, SolidState, Traction, load_design, solve
from fem_biobot.design_checks import refuse_unbonded
from fem_biobot.errors import DesignError, MeshError, ModelError, SolveError
from fem_biobot.material.law import Array
from fem_biobot.material.neo_hooke import NeoHooke
from fem_biobot.mesh.facets import facets
from fem_biobot.mesh.naming import interface
from fem_biobot.mesh.unbonded import unbonded
from fem_biobot.solid.adjoint import influence
from fem_biobot.solid.dynamics.body import moving_body
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.solid.interface.state import LIFTED, SLIP, STICK
from fem_biobot.solid.model import buckling
from fem_biobot.solid.modes import modes
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.records import Step
from fem_biobot.solid.touching import in_contact, touching_parts
from fem_biobot.solid.walk import refuse_unwalkable
from fem_biobot.study import walking
from fem_biobot.study.plan import wanted_states
from fem_biobot.study.reporter import Silent
from fem_biobot.study.run import run
from tests.helpers import box_mesh, generator

SIZE = (1.0, 1.2, 1.0)
EXACT = NewtonSettings(tolerance=1e-13)


def stack(n: tuple[int, int, int] = (2, 2, 2)) -> BodyMesh:
    """A muscle on a skeleton, with the surface between them named."""
    mesh = box_mesh(n, SIZE, layers=(0.5, 1.0), names=("skeleton", "muscle"))
    between = interface(facets(mesh.cells), mesh.region_of(), list(mesh.regions))
    return BodyMesh(mesh.points, mesh.cells, mesh.regions, {**mesh.surfaces, "interface": between})


def stacked(
    top: tuple[float, float, float], *, friction: float = 0.0, axial: float | None = None, element: str = "P2"
) -> SolidModel:
    """A soft block on a stiffer one of the same Poisson's ratio, pushed on its top; its sides do not bulge."""
    sides = [Fix(name, "xyz"[axis]) for name, axis in (("x0", 0), ("x1", 0), ("y0", 1), ("y1", 1), ("z0", 2))]
    if top[0]:
        sides = [Fix("z0"), Fix("y0", "y"), Fix("y1", "y")]
    laws = {"skeleton": NeoHooke(50.0, 0.3), "muscle": NeoHooke(10.0, 0.3)}
    loads = [Traction("z1", (top[0], 0.0, 0.0), name="pull"), Traction("z1", (0.0, top[1], top[2]), name="press")]
    sliding = Sliding(friction=friction, axial_friction=axial, axis=(0.0, 1.0, 0.0))
    return SolidModel(unbonded(stack()), laws, {}, sides, loads, element, sliding=sliding)


def test_doubled_mesh_keeps_elements_and_matches_node_by_node() -> None:
    """Volumes, order and places stay; the two parts share no vertex, their surfaces the positions.

    Catches: renumbering the skeleton's vertices instead of the muscle's.
    """
    mesh = stack()
    parted = unbonded(mesh)
    np.testing.assert_array_equal(parted.points[:, parted.cells], mesh.points[:, mesh.cells])
    np.testing.assert_array_equal(parted.cells[:, parted.regions["skeleton"]], mesh.cells[:, mesh.regions["skeleton"]])
    one, two = (np.unique(parted.cells[:, parted.regions[name]]) for name in ("skeleton", "muscle"))
    assert not np.intersect1d(one, two).size
    ours, theirs = parted.surfaces["interface"], parted.surfaces["interface_muscle"]
    np.testing.assert_array_equal(parted.points[:, ours], parted.points[:, theirs[::-1]])
    assert np.isin(parted.surfaces["z1"], two).all()


def test_mesh_without_an_interface_is_refused() -> None:
    """A body of one region has nothing to part.

    Catches: parting a mesh along nothing.
    """
    with pytest.raises(MeshError, match="interface"):
        unbonded(box_mesh(1))


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_uniform_pressure_passes_through_to_rounding(element: str) -> None:
    """Contact patch test: a uniform load gives a uniform traction and a homogeneous stress in each block.

    Catches: multipliers weighted with quadratic functions; the force applied to one side only.
    """
    state = solve(stacked((0.0, 0.0, -1.5), element=element), [1.0], settings=EXACT).last
    assert state.touch is not None
    # gaps are met to 1e-13 mm, which stiffnesses of some 100 kPa/mm make tractions of
    np.testing.assert_allclose(state.touch.traction[:, 0], 1.5, rtol=1e-10)
    for region, elements in state.model.mesh.regions.items():
        stress = state.points.S[2, elements]
        np.testing.assert_allclose(stress, stress.mean(), rtol=1e-10, err_msg=region)


def test_derivatives_of_forces_and_gaps_are_their_own() -> None:
    """Taylor's remainder of the contact force, the gaps and the slips falls with the square of the step.

    At a generic displacement and generic tractions, where places have slid. Catches: the turning of the normal or the
    sliding of the opposite place left out of the tangent.
    """
    slide = stacked((0.0, 0.0, -1.0), friction=0.4).slide
    assert slide is not None
    contact, draw = slide.contact, generator(5)
    n, c = len(contact.X), contact.count
    u = 0.02 * draw.normal(size=(n, 3))
    traction = draw.normal(size=(c, 3))
    pairing = contact.paired(u, contact.begun())
    way = draw.normal(size=(n, 3))
    pairing, lost = contact.moved(u, pairing)
    assert lost == 0
    terms = contact.terms(u, traction, pairing)
    nodes, nodes0, b = pairing.nodes, pairing.nodes0, len(pairing.nodes)
    df, dg = np.zeros((n, 3)), np.zeros((c, 3))
    moved, moved0 = way[nodes], way[nodes0]  # (2b, g, 3)
    for a in range(b):
        np.add.at(df, nodes[a], -np.einsum("gbij,bgj->gi", terms.K[:, a], moved))
    for corner in range(3):
        np.add.at(dg[:, 0], pairing.corners[corner], np.einsum("gai,agi->g", terms.D[:, corner], moved))
        for s in range(2):
            slip = np.einsum("gai,agi->g", terms.D0[:, corner, s], moved0)
            np.add.at(dg[:, s + 1], pairing.corners0[corner], slip)
    dg /= pairing.cover[:, None]

    def values(eps: float) -> tuple[Array, Array]:
        there, _ = contact.moved(u + eps * way, pairing)
        found = contact.terms(u + eps * way, traction, there, derive=False)
        return found.force, found.gaps

    steps = 2.0 ** -np.arange(9, 14)
    rest = np.array(
        [[np.linalg.norm(values(e)[k] - (terms.force, terms.gaps)[k] - e * (df, dg)[k]) for k in (0, 1)] for e in steps]
    )
    slopes = np.polyfit(np.log(steps), np.log(rest), 1)[0]
    np.testing.assert_allclose(slopes, 2.0, atol=0.1)
    by = draw.normal(size=(c, 3))
    linear = np.zeros((n, 3))
    for a in range(b):
        np.add.at(linear, nodes[a], np.einsum("gcsi,cgs->gi", terms.C[:, a], by[pairing.corners]))
    twice = contact.terms(u, traction + by, pairing, derive=False).force - terms.force
    np.testing.assert_allclose(linear, twice, atol=1e-13 * np.abs(twice).max())


def total(state: SolidState) -> Array:
    """Force of the contact on the muscle, (3,) [mN]."""
    slide, touch = state.model.slide, state.touch
    assert slide is not None
    assert touch is not None
    u = np.ascontiguousarray(state.u.T)
    pairing, _ = slide.contact.moved(u, slide.contact.paired(u, touch))
    force = slide.contact.terms(u, touch.traction, pairing, derive=False).force
    return force[slide.afloat].sum(axis=0)


def test_block_sticks_below_the_cone_and_slides_at_its_edge() -> None:
    """Pulled by less than friction times its load a block sticks to its place; friction never exceeds its cone.

    Catches: a cone of the wrong size; stick that creeps.
    """
    model = stacked((0.28, 0.0, -1.0), friction=0.4)
    states = solve(model, [Step(1.0, loads={"pull": pull}) for pull in (0.0, 0.5, 1.0)]).states
    for state in states:
        assert state.touch is not None
        t = state.touch.traction
        assert np.all(np.hypot(t[:, 1], t[:, 2]) <= 0.4 * t[:, 0] * (1 + 1e-7) + 1e-12)
        stuck = state.touch.state == STICK
        assert np.abs(state.touch.gaps[stuck][:, 1:]).max(initial=0.0) < 2e-9
    np.testing.assert_allclose(total(states[-1])[[0, 2]], [-0.28 * 1.2, 1.2], rtol=1e-7)
    assert states[-1].touch is not None
    assert {STICK, SLIP} == set(states[-1].touch.state) - {LIFTED}


def test_slip_that_turns_back_is_followed() -> None:
    """Pulled one way and then the other below the edge of sliding, a block whose foremost places slip is solved.

    Iterations that go half of the way where they go back and forth do not end here. Catches: half of the way tried
    before the whole one.
    """
    sides = [Fix("z0"), Fix("y0", "y"), Fix("y1", "y")]
    laws = {"skeleton": NeoHooke(50.0, 0.3), "muscle": NeoHooke(10.0, 0.3)}
    loads = [Traction("z1", (0.314, 0.0, 0.0), name="pull"), Traction("z1", (0.0, 0.0, -1.3), name="press")]
    sliding = Sliding(friction=0.34, axis=(0.0, 1.0, 0.0))
    model = SolidModel(unbonded(stack((2, 1, 2))), laws, {}, sides, loads, "P1", sliding=sliding)
    states = solve(model, [Step(1.0, loads={"pull": pull}) for pull in (0.0, 1.0, -0.5)]).states
    assert states[1].touch is not None
    assert SLIP in states[1].touch.state
    for state, pull in zip(states, (0.0, 1.0, -0.5), strict=True):
        np.testing.assert_allclose(total(state)[[0, 2]], [-0.314 * 1.2 * pull, 1.3 * 1.2], atol=1e-7)


def test_bad_records_are_refused() -> None:
    """Friction below zero, an axis without direction, surfaces that share nodes or do not touch.

    Catches: a record taken as it comes.
    """
    with pytest.raises(ModelError, match="axial_friction"):
        Sliding(axial_friction=-0.1)
    with pytest.raises(ModelError, match="friction"):
        Sliding(friction=float("nan"))
    with pytest.raises(ModelError, match="axis"):
        Sliding(axis=(0.0, 0.0, 0.0))
    parted, laws = unbonded(stack()), {"skeleton": NeoHooke(50.0, 0.3), "muscle": NeoHooke(10.0, 0.3)}
    for bearing, body, word in (("z0", "x0", "sharing"), ("z0", "z1", "touch")):
        model = SolidModel(parted, laws, {}, [Fix("z0")], sliding=Sliding(bearing, body))
        with pytest.raises(ModelError, match=word):
            solve(model)


def test_what_does_not_slide_yet_is_refused() -> None:
    """Pressures, nodes held in oblique axes, modes, buckling, influence, other laws.

    Catches: an answer for a body taken as bonded.
    """
    mixed = stacked((0.0, 0.0, -1.0), element="P2-P1")
    with pytest.raises(ModelError, match="P2-P1"):
        solve(mixed)
    s = np.sqrt(0.5)
    oblique = Fix("interface", "x", axes=((s, s, 0.0), (s, -s, 0.0), (0.0, 0.0, 1.0)))
    laws = {"skeleton": NeoHooke(50.0, 0.3), "muscle": NeoHooke(10.0, 0.3)}
    with pytest.raises(ModelError, match="axes"):
        solve(SolidModel(unbonded(stack()), laws, {}, [Fix("z0"), oblique], sliding=Sliding()))
    model = stacked((0.0, 0.0, -1.0), element="P1")
    state = SolidState(model, Step(0.0, 0.0), np.zeros((3, model.system.space.n_nodes)))
    densities = {"skeleton": 1e-6, "muscle": 1e-6}
    with pytest.raises(ModelError, match="P2-P1"):
        moving_body(mixed, densities)
    with pytest.raises(ModelError, match=r"modes: .*slide"):
        modes(state, densities)
    with pytest.raises(ModelError, match=r"buckling: .*slide"):
        buckling(state, 1.0)
    with pytest.raises(ModelError, match=r"influence: .*slide"):
        influence(state, np.zeros_like(state.u))
    with pytest.raises(ModelError, match=r"materials: .*slide"):
        model.with_materials(laws)


def test_block_without_a_load_that_holds_it_is_a_failure() -> None:
    """A block pulled off its bearing finds no equilibrium and says so.

    Catches: a muscle held by the small diagonal that steadies the iteration.
    """
    with pytest.raises(SolveError, match=r"no convergence|slid off"):
        solve(stacked((0.0, 0.0, 1.0), element="P1"), [1.0])


def test_designs_say_how_rings_lie_on_their_pillars() -> None:
    """Friction with bonded tissue, none with contact, tissue and elements that do not slide, rings that slide off.

    Catches: a key that is read by nobody; a frictionless ring that is left to slide off.
    """
    bot = load_design("junction_bot")
    contact = {"muscle.attachment": "contact", "muscle.pillar_friction": 0.3}
    refused = [
        ({"muscle.pillar_friction": 0.3}, "muscle.pillar_friction: found 0.3 with muscle.attachment bonded"),
        ({"muscle.attachment": "contact"}, "muscle.pillar_friction: missing"),
        ({**contact, "muscle.reference": "remodelled"}, "muscle.reference: found remodelled"),
        ({**contact, "mesh.element": "P2-P1"}, "mesh.element: found P2-P1"),
        ({**contact, "muscle.pillar_friction": 0.0}, "muscle.pillar_friction: found 0,"),
        ({**contact, "muscle.pillar_axial_friction": 0.0}, "muscle.pillar_axial_friction: found 0,"),
    ]
    for values, text in refused:
        with pytest.raises(DesignError, match=text):
            bot.with_values(values)
    with pytest.raises(DesignError, match=r"muscle.attachment: found contact with kind strip"):
        load_design("strip").with_values(contact)
    refuse_unwalkable(bot.with_values(contact))


def test_what_compares_with_rods_asks_for_bonded_tissue() -> None:
    """A job on rods and solid together refuses rings that slide.

    Catches: a comparison of two different machines.
    """
    bot = load_design("junction_bot")
    refuse_unbonded(bot, "compare it")
    with pytest.raises(DesignError, match=r"muscle.attachment: found contact, expected bonded to compare it"):
        refuse_unbonded(bot.with_values({"muscle.attachment": "contact", "muscle.pillar_friction": 0.3}), "compare it")


def test_surfaces_in_contact_are_no_touching_parts() -> None:
    """Vertices of the two surfaces that overlap each other are left to the contact; others are not.

    Catches: every sliding state told to run into itself; a block that sinks into another's inside unseen.
    """
    model = stacked((0.0, 0.0, -1.0), element="P1")
    mesh = model.mesh
    u = np.zeros((3, mesh.n_vertices))
    u[2, np.unique(mesh.cells[:, mesh.regions["muscle"]])] = -0.01
    u[:2, np.unique(mesh.cells[:, mesh.regions["muscle"]])] = 0.013
    assert "muscle against skeleton" in touching_parts(mesh, u)
    assert touching_parts(mesh, u, in_contact(model)) == ""
    assert not in_contact(SolidModel(stack(), model.materials, {}, model.supports)).size
    u[2, np.unique(mesh.cells[:, mesh.regions["muscle"]])] = -0.6
    assert "muscle against skeleton" in touching_parts(mesh, u, in_contact(model))


def test_states_of_sliding_rings_rise_along_one_path() -> None:
    """No state is met by trying tensions, none of remodelled tissue is asked for; the moulded ones stay.

    Catches: friction's history bent back and forth; a remodelled state of a body that has none.
    """
    bot = load_design("junction_bot")
    bonded = [each.key for each in wanted_states(bot)]
    sliding = wanted_states(bot.with_values({"muscle.attachment": "contact", "muscle.pillar_friction": 0.3}))
    assert [each.key for each in sliding] == [key for key in bonded if not key.startswith(("force", "remodelled"))]
    tensions = [each.tension for each in sliding if each.tension is not None]
    assert len(tensions) == len(sliding)
    assert tensions == sorted(tensions)


def test_walking_rods_say_that_their_muscle_is_bonded(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first thing that a walk of a design with sliding rings says.

    Catches: a walk told as that of the machine that was solved.
    """
    bot = load_design("junction_bot").with_values({"muscle.attachment": "contact", "muscle.pillar_friction": 0.3})
    notes: list[str] = []

    class EnoughError(Exception):
        pass

    def stop(_: object) -> None:
        raise EnoughError

    monkeypatch.setattr(walking, "compile_kernels", lambda _: None)
    monkeypatch.setattr(walking, "reduce", stop)
    nothing: Any = None
    with pytest.raises(EnoughError):
        next(walking.walks_of(bot, nothing, nothing, nothing, notes.append))
    assert any("bonded" in note for note in notes)


@pytest.mark.slow
def test_a_coarse_machine_solves_goes_on_and_balances(tmp_path: Path) -> None:
    """Interrupted after a state and resumed it ends as in one go; forces on both pillars balance and are the muscle's.

    The force through the junction's middle section is an integral of stresses, exact as its elements are in balance.
    Catches: a resumed state that forgot where it had slid from; contact forces of one side only.
    """
    design = load_design("junction_bot", ["mesh.size=3 mm"]).with_values(
        {"muscle.attachment": "contact", "muscle.pillar_friction": 0.3, "muscle.passive_tension": 1.0}
    )

    class Stop(Silent):
        def advance(self, done: str = "") -> None:
            if done.startswith("passive"):
                raise KeyboardInterrupt

    whole = run(design, tmp_path / "whole", complete=False)
    with pytest.raises(KeyboardInterrupt):
        run(design, tmp_path / "parts", complete=False, reporter=Stop())
    resumed = run(design, tmp_path / "parts", complete=False, resume=True)
    last, other = whole["solid"]["states"][-1], resumed["solid"]["states"][-1]
    assert other["tip_closing_mm"] == pytest.approx(last["tip_closing_mm"], rel=1e-7)
    force = last["contact_short_force_x_mN"]
    assert force > 0.0
    assert last["contact_long_force_x_mN"] == pytest.approx(-force, rel=1e-6)
    assert last["muscle_force_mN"] == pytest.approx(force, rel=1e-3)
    assert last["contact_short_slid_mm"] > 0.0
    assert (tmp_path / "whole" / "solid_contact.pvd").exists()
    assert (tmp_path / "whole" / "tables" / "contact.csv").exists()
