"""Laws and ways of stating the tension in design files: what is accepted, refused, and reaches the solver."""

from __future__ import annotations

import tomllib
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.config import digest, load_design, to_toml
from fem_biobot.design import keys
from fem_biobot.design_kinds import FIBRE_LAWS, LAW_PARAMETERS
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.material import LAWS, Convention, Density, Dispersion, force_length, law_from
from fem_biobot.material.dispersion import RANDOM_SPREAD
from fem_biobot.material.force_length import FORCE_LENGTH
from fem_biobot.material.laws import has_fibres, parameters
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.from_design import model_from_design, tension_of, tension_unit
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import solve
from fem_biobot.study.compare import beside_closed_form, free_contraction
from fem_biobot.study.run import run
from tests.helpers import TIGHT, unit
from tests.oracles.free_muscle import incompressible_stretch
from tests.oracles.laws import PARAMETERS


def _changed(*overrides: str, preset: str = "strip"):
    return load_design(preset, overrides)


def test_designs_and_laws_know_the_same_names() -> None:
    """Laws, their parameters and units, fibre laws, conventions, curves and densities agree with the package's tables.

    Catches: a law, a parameter or a curve added on one side only.
    """
    assert keys()["muscle.material.law"].choices == tuple(LAWS)
    assert {name: tuple(parameters(name)) for name in LAWS} == LAW_PARAMETERS
    assert tuple(name for name in LAWS if has_fibres(name)) == FIBRE_LAWS
    assert keys()["muscle.convention"].choices == tuple(c.value for c in Convention)
    assert keys()["muscle.force_length"].choices == tuple(FORCE_LENGTH)
    assert keys()["muscle.spread_kind"].choices == tuple(d.value for d in Density)
    for name in LAWS:
        for own, unit_of in parameters(name).items():
            assert keys()[f"muscle.material.{own}"].quantity.unit == unit_of


@pytest.mark.parametrize("name", list(LAWS))
def test_ranges_of_a_design_are_those_of_the_law(name: str) -> None:
    """A parameter that a design accepts is one that the law accepts, and the other way round, at both ends.

    Catches: an interval copied with another end.
    """
    made = LAWS[name]
    for field in fields(made):
        if "range" not in field.metadata:
            continue
        law_range, quantity = field.metadata["range"], keys()[f"muscle.material.{field.name}"].quantity
        assert (law_range.low, law_range.high, law_range.low_open) == (quantity.low, quantity.high, quantity.low_open)


@pytest.mark.parametrize("name", list(LAWS))
def test_a_law_with_its_parameters_survives_the_file(name: str) -> None:
    """A design with the law's parameters reads back as itself, and its law has them.

    Catches: a parameter lost in the resolved file, a unit not converted.
    """
    own, units = PARAMETERS[name], parameters(name)
    shown = {key: f"{value * 1000:.12g} Pa" if units[key] == "kPa" else f"{value!r}" for key, value in own.items()}
    design = _changed(f"muscle.material.law={name}", *(f"muscle.material.{key}={text}" for key, text in shown.items()))
    for key, value in own.items():
        assert design.value(f"muscle.material.{key}") == pytest.approx(value, rel=1e-15)
    written = tomllib.loads(to_toml(design))["muscle"]["material"]
    assert set(own) <= set(written)
    assert not (set(written) & {key for keys_ in LAW_PARAMETERS.values() for key in keys_}) - set(own)


def test_parameters_left_out_change_no_digest_and_no_file() -> None:
    """A neo-Hookean design has none of the other laws' keys in its resolved file.

    Catches: every law's parameters written as empty keys.
    """
    text = to_toml(_changed())
    assert "chain_limit" not in text
    assert digest(_changed()) != digest(_changed("muscle.material.law=yeoh"))
    assert digest(_changed("muscle.material.law=yeoh")) != digest(
        _changed("muscle.material.law=yeoh", "muscle.material.c3=0.1 kPa")
    )


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            ("muscle.material.chain_limit=9",),
            "muscle.material.chain_limit: found 9, a parameter that the law neo_hooke does not have, expected none",
        ),
        (
            ("muscle.material.law=yeoh", "muscle.material.chain_limit=9"),
            "muscle.material.chain_limit: found 9, a parameter that the law yeoh does not have, expected one of c2, c3",
        ),
        (
            ("skeleton.material.law=guccione",),
            "skeleton.material.law: found guccione, expected a law without fibres for the hydrogel",
        ),
        (
            ("muscle.optimal_stretch=1.1",),
            "muscle.optimal_stretch: found 1.1, expected none without muscle.force_length",
        ),
        (
            ("muscle.transverse=0.1", "muscle.force_length=gordon_1966"),
            "muscle.transverse: found 0.1, expected 0 with muscle.force_length gordon_1966",
        ),
        (
            ("muscle.transverse=0.1", "muscle.force_velocity.fastest=5 1/s"),
            "muscle.transverse: found 0.1, expected 0 with muscle.force_velocity",
        ),
        (
            ("muscle.convention=active_strain", "muscle.force_velocity.fastest=5 1/s"),
            "muscle.force_velocity: found with muscle.convention active_strain, expected it with a tension only",
        ),
        (
            ("muscle.force_velocity.curvature=0.3",),
            'muscle.force_velocity.fastest: missing, expected a rate with its unit, such as "10 1/s"',
        ),
        (
            ("muscle.force_velocity.fastest=0 1/s",),
            "muscle.force_velocity.fastest: found 0 1/s, expected above 0 1/s",
        ),
        (
            ("muscle.force_velocity.fastest=5 1/s", "muscle.force_velocity.eccentric=1"),
            "muscle.force_velocity.eccentric: found 1, expected above 1",
        ),
        (
            ("muscle.convention=active_strain", "muscle.spread=10 deg"),
            "muscle.spread: found with muscle.convention active_strain, expected it with a tension only",
        ),
    ],
)
def test_what_does_not_fit_the_law_is_refused_in_one_line(overrides: tuple[str, ...], message: str) -> None:
    """Each refusal is one line with the key, what was found and what was expected.

    Catches: a key of another law kept and never used.
    """
    with pytest.raises(DesignError) as error:
        load_design("junction_bot", overrides)
    assert str(error.value) == message


def test_a_spread_reaches_up_to_random_fibres() -> None:
    """The largest spread of a design is one that the densities have, just below random.

    Catches: a range of the design wider than that of the dispersion.
    """
    limit = keys()["muscle.spread"].quantity.high
    assert 0.99 * RANDOM_SPREAD < limit < RANDOM_SPREAD
    assert Dispersion(limit, "solid").second_moment < 0.36


def test_every_way_of_stating_the_tension_reaches_the_muscle() -> None:
    """Convention, curve, optimal stretch, spread with its density, and transverse share arrive in the active tension.

    Catches: a key that is read and dropped.
    """
    design = _changed(
        "muscle.convention=kirchhoff",
        "muscle.force_length=blemker_2005",
        "muscle.optimal_stretch=1.1",
        "muscle.spread=20 deg",
        "muscle.spread_kind=solid",
    )
    muscle = tension_of(design, unit(1.0, 0.0, 0.0))
    assert muscle.convention is Convention.kirchhoff
    assert muscle.tension == tension_unit(design)
    np.testing.assert_allclose(muscle.force_length(1.3), force_length("blemker_2005", 1.1)(1.3), rtol=1e-15)
    assert (muscle.dispersion.spread, muscle.dispersion.density) == (pytest.approx(np.radians(20.0)), "solid")
    assert tension_of(_changed("muscle.transverse=0.2"), unit(1.0, 0.0, 0.0)).transverse == 0.2
    assert tension_of(_changed(), unit(1.0, 0.0, 0.0)).dispersion is None
    with pytest.raises(DesignError, match="muscle: found none"):
        tension_of(load_design("cantilever"), unit(1.0, 0.0, 0.0))


@pytest.mark.parametrize("name", FIBRE_LAWS)
def test_fibre_laws_take_the_muscles_own_fibres(name: str) -> None:
    """In a machine's model each muscle element has the law with the fibre of the active tension there.

    Catches: fibres in the order of the region used for all elements of the mesh, a constant direction in the rings.
    """
    design = load_design("junction_bot", [f"muscle.material.law={name}", "muscle.theta=70 deg"])
    mesh = committed_mesh(design, 2.0)
    assert mesh is not None
    model = model_from_design(design, mesh)
    muscle = mesh.regions["muscle"]
    np.testing.assert_array_equal(model.materials["muscle"].a0[:, muscle], model.active["muscle"].a0)
    assert np.ptp(model.materials["muscle"].a0[0, muscle]) > 0.5


@pytest.mark.parametrize("convention", ["second_piola", "cauchy", "active_strain"])
def test_a_strip_contracts_by_the_convention_of_its_design(convention: str) -> None:
    """The preset's strip, made nearly incompressible, shortens as the incompressible equation of its convention says.

    Catches: a design solved with nominal tension whatever it says.
    """
    design = _changed(f"muscle.convention={convention}", "muscle.material.poisson=0.49")
    mesh = committed_mesh(design, 1.0)
    assert mesh is not None
    model = model_from_design(design, mesh)
    state = solve(model, [0.5, 1.0]).last
    mu = design.value("muscle.material.young") / (2.0 * 1.49)
    known = convention if convention != "active_strain" else "nominal"
    expected = incompressible_stretch(tension_unit(design) / mu, known)
    measurer = Measurer(design, model)
    assert measurer.fibre_stretch(state) == pytest.approx(expected, rel=0.01)
    # what its tension works against: int T1 (s^2 - 1)/2 dV, none for the two without a proportional energy
    length = measurer.tension_length(state)
    if convention == "second_piola":
        volume = float(model.system.space.dV.sum())
        found = float(np.sum(0.5 * (state.stretch**2 - 1.0) * model.system.space.dV)) / volume
        assert length == pytest.approx(tension_unit(design) * volume * found, rel=1e-12)
    else:
        assert np.isnan(length)


def test_a_run_leaves_out_the_work_of_a_tension_without_energy(tmp_path: Path) -> None:
    """The summary of a strip with Cauchy's convention has no muscle work, and a note that says why.

    Catches: a work of another convention, a NaN in the summary.
    """
    summary = run(_changed("muscle.convention=cauchy"), tmp_path / "out", size=1.0, complete=False)
    states = summary["solid"]["states"]
    assert len(states) > 2
    assert {state["muscle_work_uJ"] for state in states} == {None}
    assert all(state["strain_energy_uJ"] is not None for state in states)
    assert [note for note in summary["notes"] if "muscle work: left out" in note and "cauchy" in note]


def test_closed_forms_stand_beside_what_they_speak_of_only() -> None:
    """Rows of a strip beside the free contraction of neo-Hooke appear for that law under plain nominal tension alone.

    Catches: another law's stretch shown as an error of the solver.
    """
    state = {"key": "peak", "tension_kPa": 5.0, "fibre_stretch_1": 0.8}
    assert len(beside_closed_form(_changed(), [state])) == 1
    for other in ("muscle.material.law=gent", "muscle.convention=cauchy", "muscle.spread=5 deg"):
        assert beside_closed_form(_changed(other), [state]) == []
    s, w = free_contraction(10.0, 0.5, 4.0)
    assert s == pytest.approx(incompressible_stretch(4.0 * 3.0 / 10.0), rel=1e-9)
    assert s * w * w == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize(
    "override",
    ["muscle.convention=cauchy", "muscle.spread=5 deg", "muscle.transverse=0.1"],
)
def test_rods_refuse_a_tension_that_they_do_not_have(override: str) -> None:
    """A rod model's members pull along one line by nominal tension: what else a design says is refused by its key.

    Catches: a walk of another muscle than the solid's.
    """
    with pytest.raises(ModelError, match=override.split("=")[0].replace(".", r"\.")):
        reduce(load_design("junction_bot", [override]))


def test_a_design_may_be_wholly_incompressible() -> None:
    """At a Poisson's ratio of 0.5 with the mixed element every law contracts the strip at constant volume.

    Catches: a law of the table that cannot be split when it comes from a design.
    """
    for name in ("mooney_rivlin", "blemker"):
        design = _changed(f"muscle.material.law={name}", "muscle.material.poisson=0.5", "mesh.element=P2-P1")
        mesh = committed_mesh(design, 1.0)
        assert mesh is not None
        state = solve(model_from_design(design, mesh), [0.5, 1.0], settings=TIGHT).last
        np.testing.assert_allclose(np.linalg.det(np.moveaxis(state.F, (0, 1), (-2, -1))), 1.0, rtol=0.0, atol=2e-3)
        assert law_from(name, 10.0, 0.5, unit(1.0, 0.0, 0.0)).split()[1].bulk == np.inf
