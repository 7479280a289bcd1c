"""From a design to rods: masses, moment arm, sections, standing shape, refusals."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.mesh.layout import layout
from fem_biobot.rod.reduce import GRAVITY, PlateFactor, Strands, ground_of, lump, pillar_names, reduce
from fem_biobot.rod.rest import contact_positions, floating, stance
from fem_biobot.rod.statics import statics
from fem_biobot.rod.walk import walk

EPS = np.finfo(float).eps


def bot(**values: object) -> Design:
    """A junction bot with generic numbers; keys with a double underscore for the dot."""
    generic = {
        "skeleton.short_pillar_height": 2.7,
        "skeleton.long_pillar_height": 3.5,
        "skeleton.pillar_width": 5.9,
        "muscle.gamma": 0.83,
        "muscle.theta": 1.2,
        "muscle.junction_height": 1.5,
        "muscle.material.density": 1.02e-6,
    }
    return load_design("junction_bot").with_values(generic | {k.replace("__", "."): v for k, v in values.items()})


DESIGNS = {
    "junction": bot(),
    "three pillars": bot(skeleton__pillar_count=3, skeleton__pillar_length=2.5),
    "ring": load_design("ring_bot"),
}


@pytest.mark.parametrize("name", DESIGNS)
def test_the_mass_is_that_of_the_body(name: str) -> None:
    """Gel and tissue weigh what the closed-form volumes of the machine weigh.

    Catches: tissue where a ring meets the junction counted twice, half a junction, a pillar up to the beam axis.
    """
    design = DESIGNS[name]
    volumes = layout(design).volumes
    wanted = volumes["skeleton"] * design.value("skeleton.material.density")
    wanted += volumes["muscle"] * design.value("muscle.material.density")
    assert reduce(design).mass == pytest.approx(wanted, rel=100 * EPS)


def test_buoyancy_takes_the_weight_of_the_displaced_medium() -> None:
    """Forces on a submerged machine add up to its weight less that of as much medium as its volume.

    Catches: buoyancy of the gel alone, a volume lost with the junction's half masses.
    """
    design = bot(ground__immersion="submerged", ground__medium_density=0.93e-6)
    model = reduce(design)
    lifted = model.assembly.loads.force.sum(axis=0)
    volume = sum(layout(design).volumes.values())
    np.testing.assert_allclose(lifted, [0.0, 0.0, 0.93e-6 * volume * GRAVITY], rtol=1e-13, atol=1e-15)
    assert len(reduce(bot()).assembly.loads.node) == 0


def test_a_lump_is_the_sum_of_its_small_pieces() -> None:
    """Mass, centre and inertia of a box with a hole are those of many small cubes, each with its own inertia.

    Catches: inertia about the origin, the hole added, products of inertia of the wrong sign.
    """
    cell = 0.5
    outer, hole = np.array([[-1.0, 0.5, 0.0], [1.5, 2.5, 1.0]]), np.array([[0.0, 1.5, 0.0], [1.5, 2.0, 0.5]])
    grid = itertools.product(*(np.arange(a + cell / 2, b, cell) for a, b in outer.T))
    cubes = [np.array(c) for c in grid if not ((hole[0] < c) & (c < hole[1])).all()]
    m, own = 3e-6 * cell**3, 3e-6 * cell**5 / 6.0 * np.eye(3)
    centre = np.mean(cubes, axis=0)
    arms = [c - centre for c in cubes]
    inertia = sum(own + m * (r @ r * np.eye(3) - np.outer(r, r)) for r in arms)
    size, gone = outer[1] - outer[0], hole[1] - hole[0]
    found = lump([(outer.mean(axis=0), size, float(size.prod())), (hole.mean(axis=0), gone, -float(gone.prod()))], 3e-6)
    assert found.mass == pytest.approx(m * len(cubes), rel=1e-13)
    np.testing.assert_allclose(found.centre, centre, rtol=1e-12)
    np.testing.assert_allclose(found.inertia, inertia, rtol=1e-11, atol=1e-11 * np.abs(inertia).max())
    assert np.abs(np.asarray(inertia)[0, 1]) > 1e-3 * np.abs(inertia).max()  # the case has products of inertia


def test_the_muscle_pulls_with_gamma_once() -> None:
    """Its force as drawn is the design's tension times section times sin(theta): Eq. 1 with gamma in it once.

    Catches: gamma squared, the sine left out, passive tension without gamma.
    """
    design = bot()
    model = reduce(design)
    for drive in (0.0, 0.7):
        wanted = design.tension(drive) * design.junction_section * np.sin(design.value("muscle.theta"))
        assert model.pull(drive).sum() == pytest.approx(wanted, rel=10 * EPS)
        assert wanted != pytest.approx(0.0)


def test_plate_factor_stiffens_bending_and_stretch_alone() -> None:
    """``E I`` of the closed form; under plane strain that over ``1 - nu^2``, with the shear stiffness unchanged.

    Catches: width and thickness exchanged, the factor on the shear modulus, the factor by default.
    """
    design = bot()
    plain, plate = (reduce(design, plate_factor=f).assembly.elements.section[0] for f in PlateFactor)
    young, nu = design.value("skeleton.material.young"), design.value("skeleton.material.poisson")
    assert plain[3] == pytest.approx(young * design.second_moment, rel=10 * EPS)
    ratio = plate / plain
    # GA1, GA2, EA, EI1, EI2, GJ
    stiffer = 1.0 / (1.0 - nu**2)
    np.testing.assert_allclose(ratio, [1.0, 1.0, stiffer, stiffer, stiffer, 1.0], rtol=1e-13)


def test_small_forces_close_the_pillars_as_in_beam_theory() -> None:
    """Force F at h below the axis: closing at that height ``F h^2 L / (E I) + F L / (E A)`` in the limit.

    Catches: the muscle at the wrong height, pillars that bend, a span that includes the beam above the pillars.
    """
    force = 1e-4  # mN: turns each pillar by 1e-5, so that what is left out is 1e-5 of the answer
    design = bot(muscle__passive_tension=0.0, muscle__material__young=1e-6)
    model = reduce(design)
    shape = floating(model, drive=force / model.pull(1.0)[0])
    L, h, E = design.span, design.moment_arm, design.value("skeleton.material.young")
    section = design.value("skeleton.beam_width") * design.value("skeleton.beam_thickness")
    wanted = force * (h**2 * L / (E * design.second_moment) + L / (E * section))
    assert L - shape.muscle_length("muscle") == pytest.approx(wanted, rel=1e-4)


def test_remodelled_tissue_is_free_of_stress_in_the_passive_shape() -> None:
    """With the rest length found, standing tension alone bends the machine to where the tissue has its rest length.

    Catches: the rest length of the shape with passive resistance, the drawn length kept.
    """
    design = bot(muscle__reference="remodelled", muscle__passive_tension=4.0)
    model = reduce(design)
    assert floating(model).stretch("muscle") == pytest.approx(1.0, abs=1e-8)
    assert model.assembly.members.length[0] < 0.9 * design.span


def test_bonded_strands_are_those_between_the_pillars() -> None:
    """A ring that slides is as long as the machine, a bonded one as a bay; both pull with the same force as drawn.

    Catches: the option without effect, both strands in one place.
    """
    design = load_design("ring_bot")
    slide, bonded = (reduce(design, strands=s) for s in Strands)
    np.testing.assert_allclose(slide.assembly.members.length, design.value("skeleton.beam_length"), rtol=1e-13)
    np.testing.assert_allclose(bonded.assembly.members.length, design.bay, rtol=1e-13)
    np.testing.assert_allclose(slide.pull(0.4), bonded.pull(0.4), rtol=1e-13)
    side = slide.assembly.members.offset[:, 0, 1]
    assert side[0] == -side[1] == pytest.approx(-(2.6 + 0.6) / 2)


def test_a_cantilever_bends_as_timoshenko_says() -> None:
    """Tip deflection ``F L^3 / (3 E I) + F L / (k G A)`` for a small force.

    Catches: the force at the wrong end, no clamp, shear left out.
    """
    design = load_design("cantilever").with_values({"load.tip_force": 1e-5})
    model = reduce(design, beam_elements=4)
    tip = statics(model).last.displacement(("beam", -1))[2]
    L, F, C = 14.0, 1e-5, model.assembly.elements.section[0]
    # turns of 1e-5 are small to their square
    assert tip == pytest.approx(F * L**3 / (3 * C[3]) + F * L / C[1], rel=1e-8)


def test_a_machine_stands_on_feet_at_both_ends_with_its_weight_on_them() -> None:
    """Standing, points of both outer feet are on the ground, none is inside it, and the ground carries the weight.

    Catches: a machine left in the air or pushed into the ground, a drawn pose that stands on one foot.
    """
    design = bot()
    model, ground = reduce(design), ground_of(design)
    standing = stance(model, ground)
    heights = contact_positions(model, standing.state.x, standing.state.Q)[:, 2].reshape(2, 4)
    assert heights.min() > -1e-9
    assert heights.min(axis=1) == pytest.approx([0.0, 0.0], abs=1e-9)
    still = walk(model, ground=ground, start=standing, amplitude=0.0, duration=0.5)
    # half a second with no drive: it does not move, and forces add up
    assert np.abs(still.position - still.position[0]).max() < 1e-6
    assert still.foot_force[-1, :, 0].sum() == pytest.approx(model.mass * GRAVITY, rel=1e-6)


def test_pillars_are_named_from_short_to_long() -> None:
    """Bodies are named by their place in the row.

    Catches: names in another order than the pillars.
    """
    assert pillar_names(4) == ["pillar_short", "pillar_middle_1", "pillar_middle_2", "pillar_long"]
    model = reduce(DESIGNS["three pillars"])
    assert [c.part for c in model.contacts] == pillar_names(3)
    assert [c.points[:, 2].max() for c in model.contacts] == pytest.approx([0.8, 0.4, 0.0])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: reduce(load_design("strip")), "kind: found strip"),
        (lambda: reduce(bot(), beam_elements=7), "beam_elements: found 7, expected an even number"),
        (lambda: reduce(bot(skeleton__material__density=0.0)), "skeleton.material.density: found 0"),
        (lambda: reduce(bot(muscle__material__density=0.0)), "muscle.material.density: found 0"),
    ],
)
def test_what_cannot_be_reduced_is_refused_in_one_line(make: object, words: str) -> None:
    """The message names the key or argument and what was expected.

    Catches: a strip that fails deep inside, an odd number of elements without a mid-span node.
    """
    with pytest.raises(ModelError) as error:
        make()  # type: ignore[operator]
    assert words in str(error.value)
    assert "\n" not in str(error.value)
    assert error.value.exit_code == 2
