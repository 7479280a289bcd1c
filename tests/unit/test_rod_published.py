"""The published walker: its numbers, its symmetry, and that each of its oddities changes what it says alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.rod.anatomy import anatomy
from fem_biobot.rod.guide import Guide
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.published.description import AS_PUBLISHED, CORRECTED, ElasticaWalker, Oddity, oddity_set
from fem_biobot.rod.published.machine import CONTACT_NODE, elastica_walker, ground_of
from fem_biobot.rod.records import Muscle, PointLoad, Rigid, Spherical
from fem_biobot.rod.touching.kernels import touch

G = 9810.0


def walker(*oddities: Oddity) -> RodModel:
    """A machine with some oddities alone."""
    return elastica_walker(ElasticaWalker(oddities=frozenset(oddities)))


def test_the_machine_weighs_what_the_code_says() -> None:
    """Beams with half of the mass of their thick radius, legs, cross rods, rings with their overlap, and fibres.

    Catches: the mass of the thin section in the flexible span, a factor on the wrong rods, an overlap left out.
    """
    gel, tissue = 1.12e-6, 1.06e-6
    beams = 2 * 0.5 * math.pi * 0.8786**2 * 14.0 * gel
    legs = 2 * math.pi * 1.75**2 * (2.8 + 3.4) * gel
    crosses = 4 * math.pi * 0.72**2 * 3.5 * gel
    rings = 4 * math.pi * 0.29**2 * (24.4 + 2 * 7.6 / 7) * tissue
    fibres = 4 * math.pi * 0.227**2 * 5.48 * tissue
    model = elastica_walker()
    assert model.mass == pytest.approx(beams + legs + crosses + rings + fibres, rel=1e-12)
    lifted = sum(load.force[2] for load in model.loads if isinstance(load, PointLoad))
    assert lifted == pytest.approx((rings + fibres) * G, rel=1e-12)
    assert model.mass * G - lifted == pytest.approx(1.934, abs=5e-4)
    swims = sum(load.force[2] for load in walker().loads if isinstance(load, PointLoad))
    once = rings * 24.4 / (24.4 + 2 * 7.6 / 7)
    assert swims == pytest.approx((once + fibres) / 1.06 * G, rel=1e-12)


def test_second_moment_areas_and_lengths_are_the_published_ones() -> None:
    """0.18296 mm^4 of both beams in the flexible span, 0.648 mm^2 of four fibres, 5.48 mm long, rings of 24.4 mm.

    Catches: the mass's radius in the bending stiffness, a fibre's section of the ring's radius, a ring that does not
    close.
    """
    model = elastica_walker()
    rods = {rod.name: rod for rod in model.rods}
    assert len(rods) == 18
    both = [rods[f"beam_{side}"].sections[8].I1 for side in ("right", "left")]
    assert sum(both) == pytest.approx(0.18296, abs=5e-6)
    fibres = [m for m in model.members if isinstance(m, Muscle) and m.name.startswith("fibre") and m.name.endswith("1")]
    assert sum(m.area for m in fibres) == pytest.approx(0.648, abs=5e-4)
    length = np.linalg.norm(np.diff(rods["fibre_3"].points, axis=0), axis=1).sum()
    assert length == pytest.approx(5.48, rel=1e-12)
    for name in ("ring_short_lower", "ring_long_upper"):
        points = rods[name].points
        assert np.linalg.norm(np.diff(points[:23], axis=0), axis=1).sum() == pytest.approx(24.4, rel=1e-12)
        np.testing.assert_array_equal(points[22:], points[:3])
        once = {rod.name: rod for rod in walker().rods}[name].points
        np.testing.assert_array_equal(once, points[:23])
    assert rods["leg_long_left"].points[-1, 2] == pytest.approx(0.1, rel=1e-12)
    assert rods["leg_short_left"].points[-1, 2] == pytest.approx(0.7, rel=1e-12)


def test_every_element_of_muscle_pulls_with_the_published_force() -> None:
    """0.2 mN at rest and 0.8 mN at full drive; 3.706 kPa of active stress in a fibre; none in a ring's overlap.

    Catches: micronewtons taken for millinewtons, the ring's area in the fibres' stress.
    """
    model = elastica_walker()
    rest, full = model.pull(0.0), model.pull(1.0)
    for k, member in enumerate(model.members):
        assert isinstance(member, Muscle)
        overlap = member.name.startswith("ring") and member.name.endswith(("_23", "_24"))
        wanted = (0.0, 0.0) if overlap else (0.2, 0.8)
        assert (rest[k], full[k]) == pytest.approx(wanted, rel=1e-12)
        if member.name.startswith("fibre"):
            assert member.active == pytest.approx(3.706, abs=2e-3)


def test_moment_arms_are_those_of_the_rings_or_of_the_legs_nodes() -> None:
    """2.0 and 2.6 mm below the beam's axis; in the code, where nodes 3 and 4 of the legs are.

    Catches: a ring that pulls at its own height in the published machine, nodes counted from the sole.
    """
    for model, wanted in (
        (walker(), {"short": (2.0, 2.6), "long": (2.0, 2.6)}),
        (walker(Oddity.leg_node_contact), {"short": (1.4, 5.6 / 3), "long": (1.7, 6.8 / 3)}),
    ):
        rods = {rod.name: rod for rod in model.rods}
        for pillar, arms in wanted.items():
            depth = 3.5 - rods[f"leg_{pillar}_right"].points[list(CONTACT_NODE.values()), 2]
            np.testing.assert_allclose(depth, arms, rtol=1e-12)


@pytest.mark.parametrize("oddities", [AS_PUBLISHED, CORRECTED])
def test_both_halves_are_mirror_images(oddities: frozenset[Oddity]) -> None:
    """Every rod has its like on the other side of the mid-plane; mass is off it by the rings' overlaps alone.

    Catches: a side with other nodes, a ring off the middle, a foot on one side.
    """
    model = elastica_walker(ElasticaWalker(oddities=oddities))
    rods = {rod.name: rod for rod in model.rods}
    for name, rod in rods.items():
        other = rods[name.replace("right", "~").replace("left", "right").replace("~", "left")]
        if name.startswith("fibre"):
            other = rods[f"fibre_{5 - int(name[-1])}"]
        mirrored = rod.points[:23] * [1.0, -1.0, 1.0]
        near = np.linalg.norm(mirrored[:, None] - other.points, axis=2).min(axis=1)
        np.testing.assert_allclose(near, 0.0, atol=1e-12)
    mass, x = model.assembly.inertia.mass, model.built.x
    overlap = math.pi * 0.29**2 * 1.06e-6 * 2 * 7.6 / 7
    off = 4 * overlap * (7.6 / 7 - 3.8) if Oddity.overlapping_ends in oddities else 0.0
    assert mass @ x[:, 1] == pytest.approx(off, rel=1e-9, abs=1e-18)
    feet = [np.asarray(group.points) for group in model.contacts]
    for right, left in ((0, 1), (3, 2)):
        np.testing.assert_allclose(feet[left], feet[right] * [1.0, -1.0, 1.0], atol=1e-12)


def rounded(values: Any) -> list[str]:
    """To eleven digits, so that what only rounding tells apart is equal."""
    return [f"{value:.11g}" for value in np.ravel(values).tolist()]


def aspects(model: RodModel, ground: Any) -> dict[str, Any]:
    """What a machine is made of, by name; equal for machines that are equal."""
    found: dict[str, Any] = {"ground": (ground.static_friction, ground.kinetic_friction)}
    assembly = model.assembly
    for rod in model.rods:
        begin, kind = model.elements_of(rod.name).start, rod.name.split("_")[0]
        # of a ring, once around
        part = slice(begin, begin + min(len(rod.sections), 22))
        C = assembly.elements.stiffness[part]
        for name, values in {
            "shear": C[:, :2], "stretch": C[:, 2], "bending": C[:, 3:5], "twist": C[:, 5],
            "damping": assembly.damping[part], "mass": rod.masses[:22], "radius": rod.sections[0].radius,
            "points": rod.points[2:-1][:20], "elements": len(rod.sections),
        }.items():  # fmt: skip
            found.setdefault(f"{name} of {kind}", []).append(rounded(values))
    for member in model.members:
        assert isinstance(member, Muscle)
        if member.name.endswith(("_23", "_24")):
            continue
        kind = member.name.split("_")[0]
        for key in ("area", "young", "passive", "active", "viscosity"):
            found.setdefault(f"{key} of {kind} members", []).append(rounded(getattr(member, key)))
    found["feet"] = [rounded(group.points) for group in model.contacts]
    found["reaction"] = rounded(assembly.contacts.acting - assembly.contacts.offset)
    found["buoyancy"] = rounded([load.force[2] for load in model.loads if isinstance(load, PointLoad)][2:20])
    found["drag"] = rounded(np.concatenate([assembly.drag.across, assembly.drag.tumble])[:120])
    for joint in (Rigid, Spherical):
        found[joint.__name__] = sum(isinstance(j, joint) for j in model.joints)
    for along in ("xy", "z"):
        found[f"{along} guides"] = sum(isinstance(j, Guide) and j.along == along for j in model.joints)
    return found


KINDS = ("beam", "leg", "cross", "ring", "fibre")
CHANGES = {
    Oddity.doubled_shear: {f"{what} of {kind}" for what in ("shear", "twist") for kind in KINDS},
    Oddity.halved_beam: {"mass of beam"},
    Oddity.smeared_step: {"bending of beam", "twist of beam"},
    Oddity.yielding_joints: {"bending of leg", "damping of leg"},
    Oddity.stiff_fibres: {
        "shear of fibre",
        "bending of fibre",
        "twist of fibre",
        "mass of fibre",
        "radius of fibre",
        "young of fibre members",
        # with which Kelvin-Voigt damping and a slender body's drag go
        "viscosity of fibre members",
        "drag",
    },
    Oddity.leg_node_contact: {"points of leg"},
    Oddity.centred_reaction: {"reaction"},
    Oddity.friction_twice: {"ground"},
    Oddity.absolute_damping: {
        "drag",
        *(f"damping of {kind}" for kind in KINDS),
        *(f"viscosity of {kind} members" for kind in ("ring", "fibre")),
    },
    Oddity.floating_muscle: {"buoyancy", "z guides"},
    # a longer slender body is dragged less per length
    Oddity.overlapping_ends: {"elements of ring", "Spherical", "Rigid", "drag"},
}


@pytest.mark.parametrize("oddity", list(Oddity))
def test_an_oddity_changes_what_it_says(oddity: Oddity) -> None:
    """Added to the corrected machine it changes its own aspects, each of them, and no other.

    Catches: an oddity without effect, one that another brings along.
    """
    with_it, without = (ElasticaWalker(oddities=frozenset(s)) for s in ((oddity,), ()))
    a, b = (aspects(elastica_walker(w), ground_of(w)) for w in (with_it, without))
    changed = {key for key in a if a[key] != b[key]}
    assert changed == CHANGES[oddity]
    more, less = (elastica_walker(w).mass for w in (with_it, without))
    heavier = oddity in (Oddity.halved_beam, Oddity.overlapping_ends)
    assert (more == pytest.approx(less, rel=1e-12)) == (not heavier)


def test_oddities_change_by_what_they_say() -> None:
    """Shear and twist twice as stiff, friction twice, joints of 140 and 170 uJ a radian, 6 % less compliance.

    Catches: a factor the other way round, an element's stiffness without its length.
    """
    plain, shear = walker(), walker(Oddity.doubled_shear)
    ratio = shear.assembly.elements.stiffness / plain.assembly.elements.stiffness.clip(1e-300)
    np.testing.assert_allclose(ratio[:, [0, 1, 5]], 2.0, rtol=1e-12)
    assert ground_of(ElasticaWalker(oddities=frozenset({Oddity.friction_twice}))).kinetic_friction == pytest.approx(0.6)
    yielding = walker(Oddity.yielding_joints)
    for name, wanted in (("leg_short_left", 140.0), ("leg_long_right", 170.0)):
        e = yielding.elements_of(name).start
        A = yielding.assembly
        assert A.elements.stiffness[e, 3] / A.elements.length[e] == pytest.approx(wanted, rel=1e-12)
        assert A.damping[e] * wanted == pytest.approx(5.0, rel=1e-12)
    centred = walker(Oddity.centred_reaction).assembly.contacts
    np.testing.assert_allclose(centred.acting[:, 0] - centred.offset[:, 0], [1.75, -1.75] * 4, rtol=1e-12)
    assert centred.elsewhere.all()
    between = slice(2, 14)
    compliance = [
        float((m.assembly.elements.length[between] / m.assembly.elements.stiffness[between, 3]).sum())
        for m in (plain, walker(Oddity.smeared_step))
    ]
    # by hand: 8 + 4 s thin elements against 6 and the harmonic means, s = (0.5842 / 0.8786)^4
    s = (0.5842 / 0.8786) ** 4
    mean = 0.5 * (1.0 + 1.0 / s)
    wanted = (6.0 + (1.0 + 1.0 / mean) + (s + 1.0 / mean) + 2.0 * s) / (8.0 + 4.0 * s)
    assert compliance[1] / compliance[0] == pytest.approx(wanted, rel=1e-12)
    assert wanted == pytest.approx(0.94, abs=0.005)


def test_measures_are_taken_on_the_right_hand_side() -> None:
    """Feet from the short to the long pillar, the beam's middle in the drawing's middle, four muscles of 5.48 mm.

    Catches: a chain that counts its elements as muscles, a beam that ends in a fibre.
    """
    model = elastica_walker()
    found = anatomy(model)
    assert [name.split("[")[0] for name in found.feet] == [
        "leg_short_right", "leg_short_left", "leg_long_left", "leg_long_right"
    ]  # fmt: skip
    assert found.crown is not None
    node, offset = found.crown
    np.testing.assert_allclose(model.built.x[node] + offset, [0.0, -1.75, 3.5], atol=1e-12)
    assert [len(chain) for chain in found.chains] == [4] * 4
    assert model.pull(1.0)[found.muscles].sum() == pytest.approx(3.2, rel=1e-12)


def test_what_is_no_oddity_is_refused() -> None:
    """By name, as are numbers that are none.

    Catches: a misspelt oddity left out in silence, a text taken letter by letter.
    """
    assert oddity_set(["halved_beam"]) == {Oddity.halved_beam}
    with pytest.raises(ModelError, match="oddities: found 'halved_beams', expected any of: doubled_shear"):
        ElasticaWalker(oddities=frozenset({"halved_beams"}))  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="oddities: found 'halved_beam', expected a set"):
        oddity_set("halved_beam")
    for key, value in (("young", -1.0), ("leg_radius", 0.0), ("active_force", float("nan"))):
        with pytest.raises(ModelError, match=f"elastica walker: {key}: found"):
            ElasticaWalker(**{key: value})  # type: ignore[arg-type]


def test_rings_stay_level_with_their_pillar_where_they_are_held() -> None:
    """Held at their height on the nearer leg where they can touch it; free of it in the published machine.

    Catches: a ring held to the other side's leg, heights held in the published machine.
    """
    guides = [j for j in walker().joints if isinstance(j, Guide) and j.along == "z"]
    assert len(guides) == 4 * (8 + 4 + 4)
    for guide in guides:
        (ring, i), (leg, node) = guide.a, guide.b
        assert leg.split("_")[1] == ring.split("_")[1]
        assert ("right" in leg) == (i in (0, 1, 2, 3, 18, 19, 20, 21))
        assert node == CONTACT_NODE[ring.split("_")[2]]


def test_rings_begin_free_of_their_pillars() -> None:
    """As drawn no ring touches: 0.06 and 0.04 mm at the outer sides, 0.01 mm at the lateral ones.

    Catches: a wall at the wrong pillar, heights counted in the distance, a ring that starts inside.
    """
    for model in (elastica_walker(), walker()):
        state, T = model.drawn(), model.assembly.touches
        rows, ends = np.zeros((3, 3, 6)), np.zeros(3, dtype=np.int64)
        gaps = [touch(T, k, state.x, state.Q, rows, ends) for k in range(len(T.node))]
        assert len(gaps) == 4 * 16
        for first, outer in ((0, 0.04), (32, 0.06)):
            np.testing.assert_allclose(gaps[first : first + 8], outer, atol=1e-12)
            np.testing.assert_allclose(gaps[first + 8 : first + 16], 0.01, atol=1e-12)
