"""Skeleton and muscle of a coarse mesh as members of rods: loads on them, their constants, their masses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.errors import MeshError, ModelError, SolveError
from fem_biobot.link import at_load, firm
from fem_biobot.link.alone import Pull
from fem_biobot.link.at_load import LoadedRods
from fem_biobot.link.firm import line_height, made_firm
from fem_biobot.link.masses import cloud, with_masses
from fem_biobot.link.parts import BONDS, balanced, part_of, wrench
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.sections import MeshSections, closed_forms, sections_from_mesh, with_sections
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.link.strip import STRIP, StripSections, stretches_of, strip_from_mesh, with_strip
from fem_biobot.link.twist import twist
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.from_design import law_of, supports
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.records import Step, Traction
from fem_biobot.study.reporter import Keeping, Silent
from tests.helpers import generator

DESIGN = load_design("junction_bot").with_values({"mesh.size": 2.0})
TENSION = 6.0
PULLS = [Pull(3.0, 0.8, 0.2), Pull(TENSION, 1.5, 0.37)]
Parts = tuple[MeshSections, StripSections]


@pytest.fixture(scope="module")
def mesh() -> BodyMesh:
    return mesh_for(DESIGN)[0]


@pytest.fixture(scope="module")
def parts(mesh: BodyMesh) -> Parts:
    """Constants with two pulls at large each."""
    return sections_from_mesh(DESIGN, mesh, [1.2, 2.6]), strip_from_mesh(DESIGN, mesh, PULLS)


def test_both_parts_make_up_the_machine(mesh: BodyMesh) -> None:
    """Volumes of skeleton and muscle add up to the mesh's, and they share the bonds.

    Catches: elements of the other region kept, a bond of one pillar given to the other.
    """
    skeleton, muscle = (part_of(mesh, region) for region in ("skeleton", "muscle"))
    assert skeleton.volumes.sum() + muscle.volumes.sum() == pytest.approx(mesh.volumes.sum(), rel=1e-12)
    for name, side in zip(BONDS, (-1.0, 1.0), strict=True):
        one, other = (
            np.unique(body.points[:, body.surfaces[name]].reshape(3, -1), axis=1) for body in (skeleton, muscle)
        )
        np.testing.assert_array_equal(one, other)
        assert (side * one[0] > 0.0).all()
    bare = BodyMesh(mesh.points, mesh.cells, mesh.regions)
    with pytest.raises(MeshError, match="interface"):
        part_of(bare, "skeleton")


def test_a_wrench_has_the_resultant_that_was_asked_for(mesh: BodyMesh) -> None:
    """Force and moment about a point far off the bond, from the nodal forces; the other bond has the opposite.

    Catches: the moment of the force about the point left out, an inertia of the corners alone.
    """
    body, draw = part_of(mesh, "skeleton"), generator(17)
    force, moment, about = draw.normal(size=3), draw.normal(size=3), np.array([0.3, -0.7, 4.0])
    loads = balanced(body, "both", force, moment, about)
    model = SolidModel(body, {"skeleton": law_of(DESIGN.value("skeleton.material"))}, {}, supports(DESIGN, body), loads)
    nodal = np.sum([f for _, f in model.system.dead_loads], axis=0)
    X = model.system.space.points.T
    for side in (1.0, -1.0):
        on = side * X[:, 0] > 0.0
        np.testing.assert_allclose(nodal[on].sum(axis=0), side * force, atol=1e-11)
        np.testing.assert_allclose(np.cross(X[on] - about, nodal[on]).sum(axis=0), side * moment, atol=1e-10)


def test_the_junction_is_that_of_its_closed_forms_in_the_middle(parts: Parts) -> None:
    """E A, and between E I of a beam and of a plate, there; stiffer in the ring; it pulls with T A everywhere nearly.

    A coarse mesh turns a thin strip by less than it should: 5 % above the plate.

    Catches: displacement and turn exchanged, a reaction of the wrong bond, tension of another unit.
    """
    strip = parts[1]
    m = DESIGN.value("muscle")
    EA = m.material.young * m.junction_width * m.junction_thickness
    EI = EA * m.junction_thickness**2 / 12.0
    middle = len(strip.EA) // 2
    assert strip.EA[middle] == pytest.approx(EA, rel=0.03)
    assert EI < strip.EI[middle] < 1.05 * EI / (1.0 - 0.47**2)
    assert strip.EA[0] > 1.5 * EA
    assert strip.EI[0] > 2.0 * EI
    np.testing.assert_allclose(strip.pull, EA / m.material.young, rtol=0.09)
    np.testing.assert_allclose(strip.EA, strip.EA[::-1], rtol=0.1)


def test_pulls_at_large_give_force_and_slope(parts: Parts) -> None:
    """The curve goes through what was measured, its slope is its derivative, at no strain that of unit loads.

    Catches: pulls in the wrong order, the slope of another stretch.
    """
    strip = parts[1]
    force, slope = strip.resistance(np.ones_like(strip.EA))
    np.testing.assert_allclose(force, 0.0, atol=1e-12)
    np.testing.assert_allclose(slope, strip.EA, rtol=1e-12)
    for s, passive in zip(strip.stretch, strip.passive, strict=True):
        np.testing.assert_allclose(strip.resistance(s)[0], passive, rtol=1e-12)
    at, h = 0.5 * (1.0 + strip.stretch[1]), 1e-5
    ahead, behind = strip.resistance(at + h)[0], strip.resistance(at - h)[0]
    np.testing.assert_allclose(strip.resistance(at)[1], (ahead - behind) / (2.0 * h), rtol=1e-6)
    # tissue resists shortening more than in proportion
    assert (strip.resistance(strip.stretch[1])[1] > strip.EA).all()
    bare = replace(strip, stretch=strip.stretch[:0], passive=strip.passive[:0])
    np.testing.assert_allclose(bare.resistance(at)[0], strip.EA * (at - 1.0), rtol=1e-12)


def test_bonds_that_do_not_come_together_tell_nothing_of_an_approach(parts: Parts) -> None:
    """Pulls without an approach are refused where one is asked for, by the line that names what was found.

    Catches: a division by no approach, a curve through points that do not rise.
    """
    still = replace(parts[1], approach=np.zeros_like(parts[1].approach))
    for ask in (still.stored, still.clamped):
        with pytest.raises(ModelError, match=r"found approaches .* expected some above 0 that rise"):
            ask(0.1)


def test_rods_that_stop_early_leave_a_note(mesh: BodyMesh, parts: Parts, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where rods by unit loads find no state further on, the junction is measured no further, and that is told.

    Catches: constants of the last pull used above it without a word.
    """
    monkeypatch.setattr(at_load, "sections_from_mesh", lambda *_: parts[0])
    monkeypatch.setattr(at_load, "strip_from_mesh", lambda *_: parts[1])
    monkeypatch.setattr(at_load, "pulled", lambda *_: parts[1])
    monkeypatch.setattr(at_load, "made_firm", lambda *_: parts[1])
    monkeypatch.setattr(LoadedRods, "pulls", lambda *_: PULLS[:1])
    reduced = reduce(DESIGN, beam_elements=16)
    seen, _ = RodSide(DESIGN, reduced).states([p.tension for p in PULLS], Silent())
    at_load.parts_of(DESIGN, mesh, reduced, seen, told := Keeping(Silent()))
    assert told.notes == [
        "junction: rods by unit loads find no state above 3 kPa; from there to 6 kPa its constants are those of its "
        "last pull: compare smaller tensions"
    ]


def test_the_muscle_stores_what_its_pulls_did(parts: Parts) -> None:
    """Through the pulls, as a spring of its stretches before them, and rising by the force that resists them.

    The bonds of these pulls turn, which the force's do not: some percent between the two.

    Catches: energy with that of unmoved bonds, a curve of the wrong power, the approach of one bond.
    """
    strip = parts[1]
    for pull, energy in zip(PULLS, strip.energy[1:], strict=True):
        assert strip.stored(pull.approach) == pytest.approx(energy, rel=1e-12)
    softness = float((np.diff(strip.x) / strip.EA).sum())
    assert strip.stored(1e-4) == pytest.approx(0.5e-8 / softness, rel=1e-3)
    slope = (strip.stored(0.801) - strip.stored(0.799)) / 0.002
    assert slope == pytest.approx(-strip.passive[0].mean(), rel=0.1)
    bare = replace(strip, approach=strip.approach[:1], energy=strip.energy[:1])
    assert bare.stored(0.3) == pytest.approx(0.5 * 0.09 / softness, rel=1e-12)


def test_energy_of_a_bent_beam_is_the_work_of_its_moment(parts: Parts) -> None:
    """Its derivative by the curvature is the moment, within the pulls and beyond them, in either sense.

    Catches: the energy of the tangent alone, an odd energy.
    """
    beam, h = parts[0], 1e-5
    for at in (0.6 * beam.curvatures[1], 0.8 * beam.curvatures[-1], 1.4 * beam.curvatures[-1]):
        slope = (beam.bending_energy(at * (1.0 + h)) - beam.bending_energy(at * (1.0 - h))) / (2.0 * h * at)
        np.testing.assert_allclose(slope, beam.bent(at)[0], rtol=1e-6)
        np.testing.assert_allclose(beam.bending_energy(-at), beam.bending_energy(at), rtol=1e-14)


def test_moments_of_a_bent_beam_are_odd_and_smooth(parts: Parts) -> None:
    """Through what was measured, opposite for opposite curvature, with its derivative, also beyond the last pull.

    Catches: an even curve, a slope that is that of the secant.
    """
    beam = parts[0]
    for k, M in zip(beam.curvatures[1:], beam.moments[1:], strict=True):
        np.testing.assert_allclose(beam.bent(k)[0], M, rtol=1e-12)
        np.testing.assert_allclose(beam.bent(-k)[0], -M, rtol=1e-12)
    for at in (0.7 * beam.curvatures[-1], 1.3 * beam.curvatures[-1]):
        slope = (beam.bent(1.0001 * at)[0] - beam.bent(0.9999 * at)[0]) / (0.0002 * at)
        np.testing.assert_allclose(beam.bent(at)[1], slope, rtol=1e-5)
    np.testing.assert_allclose(beam.bent(0.001 * beam.curvatures[1])[1], beam.mesh.EI_along, rtol=0.02)


def test_rods_at_load_have_the_moment_of_the_curve(parts: Parts) -> None:
    """Stiffness times what exceeds the natural curvature is the measured moment, with either sense of the director.

    Catches: natural curvature of the wrong sign or director, stiffness of the secant.
    """
    beam, reduced = parts[0], reduce(DESIGN)
    at = beam.curvatures[1]
    for sense in (1.0, -1.0):
        given = RodModel([replace(reduced.rods[0], normal=(0.0, sense, 0.0))])
        rod = with_sections(given, beam, curvature=at).rods[0]
        natural = np.asarray(rod.natural_curvature)[:, 0]
        EI = np.array([s.I1 for s in rod.sections]) * rod.material.young
        np.testing.assert_allclose(EI * (sense * at - natural), sense * beam.moments[1], rtol=1e-10)
    with pytest.raises(ModelError, match="expected 16, as stretches"):
        with_sections(reduce(DESIGN, beam_elements=8), beam)


def test_shear_of_a_beam_from_the_mesh_is_bounded(parts: Parts) -> None:
    """Upright at most ten times its closed form: corners that turn leave next to nothing for the beam's own shear.

    Catches: a negative stiffness where the corners' yield is all that is seen.
    """
    mesh, closed = parts[0].mesh, closed_forms(DESIGN)
    assert 0.2 * closed.GA < mesh.GA <= 10.0 * closed.GA * (1.0 + 1e-12)
    assert 0.2 * closed.GA_lateral < mesh.GA_lateral < closed.GA_lateral


def test_masses_of_the_mesh_are_those_of_its_boxes(mesh: BodyMesh, parts: Parts) -> None:
    """Without fillets every part is made of boxes: mass, centre, inertia of the whole agree to rounding.

    Catches: a rule that misses second moments, mass of the beam counted twice, the ring's tissue lost.
    """
    reduced = reduce(DESIGN)
    made = with_masses(with_strip(reduced, DESIGN, parts[1]), DESIGN, mesh)
    assert made.mass == pytest.approx(reduced.mass, rel=1e-12)
    for plain in reduced.bodies[:2]:
        body = next(b for b in made.bodies if b.name == plain.name)
        np.testing.assert_allclose(body.centre, plain.centre, atol=1e-12)
        np.testing.assert_allclose(body.inertia, plain.inertia, atol=1e-12 * plain.inertia.max())
    beam = [b for b in made.bodies if b.name.startswith("beam")]
    gel = DESIGN.value("skeleton.material.density") * 7.0 * 0.68
    assert sum(b.mass for b in beam) == pytest.approx(gel * 7.0, rel=1e-12)
    # about the rod's own line: of the plate, whatever the stiffness of its sections
    twist = sum(b.inertia[0, 0] + b.mass * (b.centre[1] ** 2 + (b.centre[2] - 3.4) ** 2) for b in beam)
    assert twist == pytest.approx(gel * 7.0 * (7.0**2 + 0.68**2) / 12.0, rel=1e-10)
    tissue = cloud(mesh, "muscle")
    free = tissue.volume[np.abs(tissue.X[0]) < 3.0].sum()
    assert free == pytest.approx(6.0 * 2.2 * 0.4, rel=1e-12)


def test_a_mesh_too_coarse_for_the_beams_nodes_is_refused(mesh: BodyMesh) -> None:
    """More nodes than there is gel beside: told before a body without mass is made.

    Catches: a node without mass that is passed on, gel of the pillars counted as the beam's.
    """
    with pytest.raises(ModelError, match=r"mesh: found no gel next to x = .* each of the 2001 nodes of beam"):
        with_masses(reduce(DESIGN, beam_elements=2000), DESIGN, mesh)


def test_a_clamped_junction_lifts_the_line_of_its_pull(parts: Parts, mesh: BodyMesh) -> None:
    """Its middle stands above the line between its ends, by more than the rings alone lift it.

    Catches: ends that are free to turn, a junction joined to the wrong pillar.
    """
    rods = LoadedRods(DESIGN, reduce(DESIGN), *parts, mesh)
    observed, states = rods.states([3.0, TENSION], at_load.Silent())
    state = states[-1]
    points = state.points(STRIP)
    middle = points[len(points) // 2]
    chord = 0.5 * (points[0] + points[-1])
    turned = np.deg2rad(observed[-1].numbers["pillar_rotation_deg"])
    ring = 0.5 * stretches_of(parts[1], points)[0]
    assert middle[2] - chord[2] > 0.5 * ring * np.sin(turned)
    assert middle[2] - chord[2] < 2.0 * ring * np.sin(turned)
    assert stretches_of(parts[1], points)[0] > stretches_of(parts[1], points)[5]


def test_rods_about_a_load_are_those_found_there(parts: Parts, mesh: BodyMesh) -> None:
    """The one model about a tension has the state that was found there; at another tension it has another.

    Catches: rods about the first tension, or by unit loads.
    """
    rods = LoadedRods(DESIGN, reduce(DESIGN), *parts, mesh)
    found = [each.numbers["tip_closing_mm"] for each in rods.states([3.0, TENSION], at_load.Silent())[0]]
    about = rods.about([3.0, TENSION]).states([3.0, TENSION], at_load.Silent())[0]
    closing = [each.numbers["tip_closing_mm"] for each in about]
    # what the constants settle to
    assert closing[1] == pytest.approx(found[1], rel=1e-6)
    assert abs(closing[0] / found[0] - 1.0) > 1e-3


def test_energy_at_load_begins_as_that_of_linear_rods(parts: Parts, mesh: BodyMesh) -> None:
    """At small tension, where rods are linear, that is what the rods themselves store, beam and muscle.

    Catches: the strip's shortening of one half alone, bending counted twice.
    """
    rods = LoadedRods(DESIGN, reduce(DESIGN), *parts, mesh)
    tensions = [0.02, 0.04, 0.06, 0.08]
    work = rods.states(tensions, at_load.Silent())[0][-1].numbers["strain_energy_uJ"]
    stored = rods.side().states(tensions, at_load.Silent())[0][-1].numbers["strain_energy_uJ"]
    assert work == pytest.approx(stored, rel=0.01)


def test_constants_that_do_not_settle_are_refused(
    parts: Parts, mesh: BodyMesh, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One round cannot tell whether the constants have settled; of one ring around both pillars there is no strip.

    Catches: a state taken as found because rounds ran out.
    """
    rods = LoadedRods(DESIGN, reduce(DESIGN), *parts, mesh)
    monkeypatch.setattr(at_load, "_MOST", 1)
    with pytest.raises(SolveError, match="constants at load"):
        rods.states([1.0], at_load.Silent())
    ring = load_design("ring_bot")
    with pytest.raises(ModelError, match="expected junction"):
        strip_from_mesh(ring, mesh)


@pytest.fixture(scope="module")
def firm_strip(parts: Parts) -> StripSections:
    """The junction with the factors that its pulls ask for."""
    return made_firm(DESIGN, reduce(DESIGN), parts[1], PULLS, Silent())


def _height(strip: StripSections, pull: Pull, firmness: float) -> float:
    drawn = np.full(len(strip.EA), 1.0 - pull.approach / DESIGN.span)
    return line_height(DESIGN, reduce(DESIGN), strip, pull, firmness, drawn)[0]


def test_turned_ends_lift_a_firm_junction_as_they_lift_the_muscle(parts: Parts, firm_strip: StripSections) -> None:
    """Its line of pull stands as high as the muscle's bonds say, to what is iterated to; by unit loads it is lower.

    Catches: bonds turned outwards, the couple of one bond, a factor on the bending across, ends that do not rise.
    """
    for pull, (still, turned), factor in zip(PULLS, parts[1].height, firm_strip.firmness, strict=True):
        assert _height(firm_strip, pull, factor) == pytest.approx(turned, rel=1e-3)
        assert still < _height(firm_strip, pull, 1.0) < 0.92 * turned
    # the rings are lower than the strip, so it is lifted where nothing turns; pillars of rigid rings would lift it more
    muscle = DESIGN.value("muscle")
    assert muscle.ring_offset < 0.0
    for pull, (still, turned) in zip(PULLS, parts[1].height, strict=True):
        assert 0.0 < still < 0.1 * turned
        assert turned < muscle.junction_thickness * pull.turn * 2.0


def test_constants_of_turned_ends_go_by_the_approach(firm_strip: StripSections) -> None:
    """Through each pull, between them in between, beyond them as there; without pulls those of unit loads.

    Catches: an approach of zero taken for a pull, extrapolation.
    """
    for pull, factor, (height, _) in zip(PULLS, firm_strip.firmness, firm_strip.height, strict=True):
        assert firm_strip.clamped(pull.approach) == pytest.approx((factor, height), rel=1e-12)
    assert firm_strip.clamped(0.0) == firm_strip.clamped(PULLS[0].approach)
    assert firm_strip.clamped(9.0) == firm_strip.clamped(PULLS[1].approach)
    low, middle, high = sorted([*firm_strip.height[:, 0], firm_strip.clamped(1.1)[1]])
    assert low < middle < high
    assert middle == firm_strip.clamped(1.1)[1]
    one = replace(
        firm_strip, approach=firm_strip.approach[:2], firmness=firm_strip.firmness[:1], height=firm_strip.height[:1]
    )
    assert one.clamped(0.3) == (firm_strip.firmness[0], firm_strip.height[0, 0])
    none = replace(
        firm_strip, approach=firm_strip.approach[:1], firmness=firm_strip.firmness[:0], height=firm_strip.height[:0]
    )
    assert none.clamped(0.3) == (1.0, 0.0)


def test_a_line_of_pull_that_no_bending_gives_is_told(parts: Parts, monkeypatch: pytest.MonkeyPatch) -> None:
    """Higher than shear lets it rise; a pull without a turn says nothing; one round cannot tell what has settled.

    Catches: the last factor tried taken as found, a division by no turn.
    """
    strip, reduced = parts[1], reduce(DESIGN)
    of_pulls = {name: getattr(strip, name)[:1] for name in ("stretch", "passive", "firmness")}
    from_none = {name: getattr(strip, name)[:2] for name in ("approach", "energy")}
    one = replace(strip, height=strip.height[:1] * np.array([1.0, 9.0]), **of_pulls, **from_none)
    made = made_firm(DESIGN, reduced, one, PULLS[:1], told := Keeping(Silent()))
    assert made.firmness == pytest.approx([10.0])
    assert "line of pull" in told.notes[0]
    assert made_firm(DESIGN, reduced, one, [PULLS[0]._replace(turn=0.0)], Silent()).firmness == [1.0]
    monkeypatch.setattr(firm, "_MOST", 1)
    with pytest.raises(SolveError, match="junction alone"):
        _height(parts[1], PULLS[0], 1.0)


def _bent_skeleton(mesh: BodyMesh, twisted: float = 0.0, of: SolidState | None = None) -> SolidState:
    """The skeleton under a pull of its bonds, and under small opposite couples on them as they lie in a state."""
    body, drawn = part_of(mesh, "skeleton"), np.array([0.0, 0.0, DESIGN.beam_axis_height])
    loads = list(balanced(body, "pull", -np.eye(3)[0], DESIGN.moment_arm * np.eye(3)[1], drawn))
    if of is not None:
        moved = BodyMesh(
            body.points + of.u[:, : body.points.shape[1]], body.cells, body.regions, body.surfaces, body.landmarks
        )
        for bond, sense in zip(BONDS, (-1.0, 1.0), strict=True):
            nodes = np.unique(body.surfaces[bond])
            centre = moved.points[:, nodes].mean(axis=1)
            field = wrench(moved, bond, np.zeros(3), sense * np.eye(3)[0], centre)
            before, after = body.points[:, nodes], moved.points[:, nodes]
            # as a rigid plate the bond has moved, to what gel yields
            fit = np.linalg.lstsq(np.vstack([before, np.ones(len(nodes))]).T, after.T, rcond=None)[0]
            loads.append(Traction(bond, lambda X, f=field, fit=fit: f(fit[:3].T @ X + fit[3][:, None]), name="twist"))
    law = law_of(DESIGN.value("skeleton.material"))
    model = SolidModel(body, {"skeleton": law}, {}, supports(DESIGN, body), loads)
    names = {"pull": 3.0, **({"twist": twisted} if of is not None else {})}
    return solve(model, [Step(load=0.0, tension=0.0, loads=names)]).last


def test_twist_about_a_bent_state_is_what_small_couples_do(mesh: BodyMesh) -> None:
    """Against the skeleton solved again with such tractions as well: its bonds turn against each other as much.

    The tractions have their couple on plane plates, to a thousandth; without the pull it is some percent more.

    Catches: couples of the same sense on both bonds, a couple about another axis, a tangent without the pull.
    """
    bent, couple = _bent_skeleton(mesh), 0.5
    ahead = _bent_skeleton(mesh, couple, bent)
    apart = (ahead.u - bent.u) / couple
    turns = []
    for bond in BONDS:
        nodes = np.unique(ahead.model.mesh.surfaces[bond])
        x = (bent.X + bent.u)[:, nodes]
        arm = x - x.mean(axis=1, keepdims=True)
        u = apart[:, nodes] - apart[:, nodes].mean(axis=1, keepdims=True)
        inertia = np.sum(arm**2) * np.eye(3) - arm @ arm.T
        turns.append(np.linalg.solve(inertia, np.cross(arm, u, axis=0).sum(axis=1))[0])
    assert twist(bent, np.eye(3)[0]) == pytest.approx(turns[1] - turns[0], rel=0.01)


def test_a_bent_plate_resists_twist_more_than_a_straight_one(parts: Parts) -> None:
    """Without a pull as by unit loads, and at a pull of 2.6 mN some percent more; rods at load have that.

    Catches: the slope of the arch against the chord left out, torsion of the last pull at every load.
    """
    beam = parts[0]
    assert beam.torsion[0] == pytest.approx(beam.mesh.GJ, rel=1e-4)
    assert 1.02 < beam.torsion[-1] / beam.mesh.GJ < 1.3
    for at, torsion in zip(beam.curvatures, beam.torsion, strict=True):
        assert beam.twisted(at) == pytest.approx(torsion, rel=1e-9)
    assert beam.twisted(3.0 * beam.curvatures[-1]) == beam.torsion[-1]
    rod = with_sections(reduce(DESIGN), beam, curvature=beam.curvatures[-1]).rods[0]
    assert rod.sections[3].J * rod.material.G == pytest.approx(beam.torsion[-1], rel=1e-12)


def test_roots_yield_apart_from_the_beam(parts: Parts) -> None:
    """Beam and roots together turn as the stretches did; without its roots the beam bends evenly, to a fifth.

    Catches: one root taken from both ends, turns of the last pull at every load, an odd sign.
    """
    beam, size = parts[0], np.full(16, DESIGN.span / 16.0)
    for at, roots in zip(beam.curvatures[1:], beam.roots[1:], strict=True):
        rest, found = beam.without_roots(at, size, at_load=True)
        np.testing.assert_allclose(found, roots, rtol=1e-10)
        assert rest @ size + found.sum() == pytest.approx(at @ size, rel=1e-12)
        np.testing.assert_array_equal(rest[1:-1], at[1:-1])
        np.testing.assert_allclose(rest[[0, -1]], rest[[1, -2]], rtol=0.2)
        assert at[0] > 1.3 * at[1]
        back, opposite = beam.without_roots(-at, size, at_load=True)
        np.testing.assert_allclose(np.append(back, opposite), -np.append(rest, found), rtol=1e-12)
    # by unit loads in proportion
    twice, once = (beam.without_roots(k * beam.curvatures[1], size, at_load=False)[1] for k in (2.0, 1.0))
    np.testing.assert_allclose(twice, 2.0 * once, rtol=1e-12)


def test_rings_alone_tell_how_far_they_are(mesh: BodyMesh) -> None:
    """A stage of as many parts as tensions, each told; what rings store grows with the square of a small tension.

    Catches: a stage without its parts, tensions told in another order.
    """
    told: list[tuple[str, int | None]] = []

    class Told(Silent):
        def stage(self, name: str, total: int | None = None) -> None:
            told.append((name, total))

        def advance(self, done: str = "") -> None:
            told.append((done, None))

    once, twice = (sum(each) for each in SolidSide(DESIGN, mesh).squeezed([0.02, 0.04], Told()))
    assert told == [("rings of the solid alone", 2), ("rings at 0.02 kPa", None), ("rings at 0.04 kPa", None)]
    assert twice == pytest.approx(4.0 * once, rel=0.02)
    told.clear()
    assert SolidSide(load_design("ring_bot"), mesh).squeezed([1.0], Told()) == [(0.0, 0.0)]
    assert not told
