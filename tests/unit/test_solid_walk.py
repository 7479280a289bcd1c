"""The solid that walks: how it stands, what a walk leaves, going on after an interruption, events, refusals."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot import orders
from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import DesignError, FileError, MeshError, ModelError, SolveError
from fem_biobot.friction.ground import Ground
from fem_biobot.friction.kernels import LIFTED, SLIP
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.rod.walk import walk
from fem_biobot.solid import standing
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.integrate import solid_dynamics
from fem_biobot.solid.dynamics.settings import DynamicsSettings
from fem_biobot.solid.gait import SolidWalk
from fem_biobot.solid.happenings import fall, happened, uprightness
from fem_biobot.solid.standing import FEET, Standing, stand
from fem_biobot.solid.walk import refuse_unwalkable, solid_ground, solid_walk, walking_body
from fem_biobot.study import solid_walking, together_files
from fem_biobot.study.reporter import Silent
from fem_biobot.study.solid_walking import walk_solid
from fem_biobot.study.walking import WalkPlan
from fem_biobot.view.together import Way, together

# a low standing tension, with which the feet slip; the coarsest mesh and few steps, for properties and no numbers
SETS = (
    "muscle.passive_tension=0.9 kPa", "muscle.active_tension=2.7 kPa", "numerics.step=10 ms", "mesh.size=14 mm",
)  # fmt: skip
PLAN = WalkPlan((4.0,), 0.5, 1.0)


@cache
def _design(*more: str) -> Design:
    return load_design("junction_bot", [*SETS, *more])


@cache
def _mesh() -> BodyMesh:
    return mesh_for(_design())[0]


@cache
def _body() -> MovingBody:
    return walking_body(_design(), _mesh())


@cache
def _standing() -> Standing:
    return stand(_design(), _body(), solid_ground(_design()))


class Stops(Silent):
    """A reporter that interrupts in the middle of the second stroke."""

    def advance(self, done: str = "") -> None:
        if done == "stroke 2":
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    out = tmp_path_factory.mktemp("solid_walk") / "out"
    return out, walk_solid(_design(), out, PLAN, rods=True)


def test_a_machine_stands_on_both_feet_with_its_weight() -> None:
    """At rest its feet bear weight and no more, touch the ground, and nothing is below it.

    Catches: gravity twice, a machine held by its old supports, one foot in the air, a tilt the wrong way.
    """
    found, body = _standing(), _body()
    touch = found.checkpoint.state.touch
    feet = standing.feet_of(body, FEET)
    loads = [touch.force[feet.owner == k, 0].sum() for k in range(2)]
    assert sum(loads) == pytest.approx(9810.0 * body.total_mass, rel=1e-6)
    assert min(loads) > 0.1 * max(loads)
    lowest = (body.system.space.points[2] + found.checkpoint.state.u[:, 2]).min()
    assert lowest == pytest.approx(0.0, abs=1e-9)
    assert not found.checkpoint.state.v.any()
    again = Standing.from_arrays(found.arrays())
    assert np.array_equal(again.checkpoint.state.u, found.checkpoint.state.u)
    assert again.tilt == found.tilt


def test_a_machine_walks_on_the_corners_of_its_soles() -> None:
    """Given the soles' corners alone it stands and walks on them, with all of its weight.

    Catches: feet that standing or walking forget, soles between the corners that still bear.
    """
    body = _body()
    whole = standing.feet_of(body, FEET)
    X = body.system.space.points[:, whole.nodes]
    corner = np.zeros(len(whole.nodes), dtype=bool)
    for k in range(2):
        own = whole.owner == k
        far = [
            np.isclose(np.abs(X[i] - np.mean([X[i, own].min(), X[i, own].max()])), np.ptp(X[i, own]) / 2)
            for i in (0, 1)
        ]
        corner |= own & far[0] & far[1]
    feet = whole.only(corner)
    assert len(feet.nodes) == 8
    found = solid_walk(_design(), body, frequency=4.0, duration=0.25, step=1e-2, feet=feet)
    assert len(found.start.checkpoint.state.touch.state) == 8
    assert found.motion.contact_force.shape[1] == 8
    assert found.foot_force[-1, :, 0].sum() == pytest.approx(9810.0 * body.total_mass, rel=0.2)


def test_a_walk_leaves_a_whole_result(result: tuple[Path, dict[str, Any]]) -> None:
    """Summary, tables of both models, series of body and contacts, and graphs are there, nothing unfinished.

    Catches: a file named and not written, one model's table over the other's.
    """
    out, summary = result
    assert json.loads((out / "summary.json").read_text()) == json.loads(json.dumps(summary))
    names = {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()}
    assert names >= {
        "solid.pvd", "solid_contacts.pvd", "rod.pvd", "report.html", "tables/walks.csv", "tables/walk_4Hz_air.csv",
        "tables/walk_4Hz_air_solid.csv", "figures/together_4Hz.png", "figures/feet_4Hz_air_solid.png",
        "figures/phase_4Hz.png", "figures/together_4Hz.gif",
    }  # fmt: skip
    assert not any(".unfinished" in n or ".tmp" in n for n in names)
    assert summary["mesh"]["unknowns_1"] == _body().system.n_dofs


def test_the_film_shows_both_machines_where_they_are(
    result: tuple[Path, dict[str, Any]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The solid's parts and the rods' lines at the samples of the solid: both on the ground, one over the other.

    Catches: rods at their own samples' times, offsets turned the wrong way, a line of the drawing.
    """
    kept = {}

    def keep(path: Path, times: np.ndarray, parts: Any, feet: Any, **more: Any) -> int:
        kept.update(times=times, parts=parts, lines=more["outlines"])
        return 1

    monkeypatch.setattr(together_files, "write_gait", keep)
    solid = solid_walk(_design(), _body(), frequency=4.0, duration=0.5, step=5e-3, start=_standing(), discard=1)
    rods = walk(_design(), frequency=4.0, duration=0.5, step=5e-3, discard=1)
    together_files.film(tmp_path / "a.gif", solid, rods)
    seen = [np.concatenate([each.points for each in kept[name]], axis=2) for name in ("parts", "lines")]
    assert all(len(points) == len(kept["times"]) for points in seen)
    # of one size, on one ground, about one place: to the thickness of a sole, and of the rods' beam without its plate
    for a, b in zip(*([p.min(axis=2), p.max(axis=2)] for p in seen), strict=True):
        np.testing.assert_allclose(a, b, atol=0.5)
    assert np.abs(seen[1][:, 1].min(axis=1)).max() < 0.05
    tall = [float(np.ptp(line.points[:, 1], axis=1).max()) for line in kept["lines"]]
    assert max(tall) > 2.5


def test_both_models_tell_of_a_walk_by_the_same_names(result: tuple[Path, dict[str, Any]]) -> None:
    """Every number of a walk of rods is there for the solid, under the same drive; the book closes.

    Catches: a key renamed, another amplitude, work that is not accounted for.
    """
    _, summary = result
    solid, rod = summary["walks"]
    assert (solid["model"], rod["model"]) == ("solid", "rod")
    assert set(rod) <= set(solid)
    for key in ("frequency_Hz", "amplitude_1", "active_force_mN", "strokes_1", "discarded_strokes_1", "immersion"):
        assert solid[key] == pytest.approx(rod[key]) if isinstance(rod[key], float) else solid[key] == rod[key], key
    assert solid["weight_mN"] == pytest.approx(rod["weight_mN"], rel=0.02)
    assert 0.5 < solid["stroke_mm"] / rod["stroke_mm"] < 1.5
    assert solid["energy_error_1"] < 1e-6
    assert solid["work_pillar_uJ"] > solid["work_friction_uJ"] > 0.0


def test_a_walk_goes_on_as_if_it_had_not_stopped(
    result: tuple[Path, dict[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Interrupted in its second stroke it is resumed from the first, and ends as the uninterrupted one, bit by bit.

    Catches: strokes made twice, a standing shape found anew, slip forgotten at a stroke's end.
    """
    out = tmp_path / "out"
    monkeypatch.setattr(solid_walking, "stand", lambda design, body, ground: _standing())
    with pytest.raises(KeyboardInterrupt):
        walk_solid(_design(), out, PLAN, reporter=Stops())
    monkeypatch.delattr(solid_walking, "stand")  # found once, it is kept
    left = json.loads((out / "summary.json").read_text())
    assert not left["complete"]
    assert left["reached"] == "0 of 1 walks of the solid"
    walk_solid(_design(), out, PLAN, resume=True)
    name = "tables/walk_4Hz_air_solid.csv"
    assert (out / name).read_text() == (result[0] / name).read_text()


def test_a_saved_shape_that_lacks_something_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One line with the folder, and what to do.

    Catches: a traceback for what an earlier version left.
    """
    arrays = {name: value for name, value in _standing().arrays().items() if name != "p"}
    monkeypatch.setattr(solid_walking.ResultFolder, "kept", lambda folder, key: arrays)
    with pytest.raises(FileError, match="the saved standing shape lacks 'p'; --force starts anew"):
        walk_solid(_design(), tmp_path / "out", PLAN)


def test_a_result_that_is_there_is_not_made_again(result: tuple[Path, dict[str, Any]]) -> None:
    """The same job gives the summary that is there; the walk of the solid alone is another job.

    Catches: a job whose identity lacks the models.
    """
    out, summary = result
    assert walk_solid(_design(), out, PLAN, rods=True) == json.loads(json.dumps(summary))
    with pytest.raises(FileError, match="another job"):
        walk_solid(_design(), out, PLAN)


def test_a_walk_that_fails_keeps_its_strokes() -> None:
    """A step that cannot be made ends the walk; what was walked before is in the failure.

    Catches: a failure without the walk, halvings that never end.
    """
    hard = DynamicsSettings(max_iterations=1, halvings=0)
    with pytest.raises(SolveError, match="walk: solid_dynamics: no step") as failure:
        solid_walk(_design(), _body(), duration=0.5, start=_standing(), settings=hard)
    assert len(failure.value.best.times) == 1


def _stroke(*more: str, amplitude: float = 1.0) -> SolidWalk:
    """A stroke of the solid at 4 Hz from where it stands."""
    design = _design(*more)
    body = walking_body(design, _mesh())
    return solid_walk(design, body, frequency=4.0, duration=0.25, amplitude=amplitude, start=_standing())


@pytest.mark.slow
def test_muscle_that_feels_its_velocity_closes_both_models_less() -> None:
    """A stroke of solid and of rods with a slow muscle, each over its own with a fast one: much smaller, roughly alike.

    The rods swing at 4 Hz without the curve, which the coarse solid does not.

    Catches: a curve that one of the two does not take from the design, one that acts on the standing tension.
    """
    slow = "muscle.force_velocity.fastest=0.5 1/s"
    ways = []
    for more in ((), (slow,)):
        rods = walk(_design(*more), frequency=4.0, duration=0.5)
        ways.append([float(np.ptp(found.tip_closing)) for found in (_stroke(*more), rods)])
    shares = np.array(ways[1]) / np.array(ways[0])
    assert shares.max() < 0.5
    assert abs(shares[0] - shares[1]) < 0.25


@pytest.mark.slow
def test_stimulation_in_space_and_time_multiplies_the_drive() -> None:
    """Half of it everywhere is half of the drive, to rounding; a half that is off moves the machine less.

    Catches: an activation at rest in a walk, one that scales the standing tension.
    """
    half, plain = (found.motion for found in (_stroke("muscle.activation.formula=0.5"), _stroke(amplitude=0.5)))
    np.testing.assert_allclose(half.u[-1], plain.u[-1], rtol=0.0, atol=1e-9)
    gone = _stroke("muscle.activation.formula=where(t > 0.1, 0, 1)").motion
    late = gone.times > 0.1
    assert np.abs(np.diff(gone.energy("muscle")[late])).sum() < 0.2 * np.abs(np.diff(gone.energy("muscle"))).sum()


def test_a_machine_that_does_not_come_to_rest_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Settling is given up after its slices, with what was reached.

    Catches: a machine that moves taken for one that stands.
    """
    monkeypatch.setattr(standing, "_SLICES", 1)
    with pytest.raises(SolveError, match="still moves with") as failure:
        stand(_design(), _body(), solid_ground(_design()))
    assert failure.value.best.time > 0.0


def test_what_happens_is_told() -> None:
    """A machine turned over, in the air, and with its beam in the ground: each is an event with its time.

    Catches: a fall that goes unseen, soles taken for buried parts.
    """
    motion = solid_dynamics(
        _body(), 0.02, 0.01, ground=Ground(0.4, 0.3), feet=FEET, start=_standing().checkpoint,
        drive=lambda t: motion_drive,
    )  # fmt: skip
    assert fall(motion) is None
    assert happened(motion) == ()
    X = motion.body.system.space.points
    over = np.diag([1.0, -1.0, -1.0]) @ X + np.array([[0.0], [0.0], [20.0]]) - X
    away = replace(
        motion, u=np.stack([motion.u[0], motion.u[1] + np.array([[0.0], [0.0], [-1.0]]), over]),
        contact_share=motion.contact_share * np.array([[0.0], [1.0], [0.0]]),
    )  # fmt: skip
    assert uprightness(away) == pytest.approx([1.0, 1.0, -1.0], abs=0.02)
    assert fall(away) == 2
    assert {e.name: e.time for e in happened(away)} == pytest.approx(
        {"overturned": 0.02, "flight": 0.02, "buried": 0.01}
    )


motion_drive = standing.tension_step(_design(), _design().tension(0.0))


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        (["muscle.reference=remodelled"], "muscle.reference: found remodelled"),
    ],
)
def test_designs_whose_solid_cannot_walk_are_refused(sets: list[str], words: str, tmp_path: Path) -> None:
    """One line with the key, before anything is written; of both models what the rods do not have, too.

    Catches: a walk that begins and fails inside.
    """
    with pytest.raises(DesignError, match=words):
        walk_solid(load_design("junction_bot", [*SETS, *sets]), tmp_path / "out", PLAN)
    with pytest.raises(ModelError, match=r"muscle\.convention: found cauchy, expected nominal for a rod model"):
        walk_solid(load_design("junction_bot", [*SETS, "muscle.convention=cauchy"]), tmp_path / "out", PLAN, rods=True)
    assert not (tmp_path / "out").exists()


def test_other_refusals_of_walks_name_what_is_wrong(tmp_path: Path) -> None:
    """Designs without feet, meshes without soles, times below zero.

    Catches: a strip that walks, a default in place of what was given.
    """
    with pytest.raises(DesignError, match="kind: found strip"):
        refuse_unwalkable(load_design("strip"))
    soles = {k: v for k, v in _mesh().surfaces.items() if k != "foot_long"}
    bare = BodyMesh(_mesh().points, _mesh().cells, _mesh().regions, soles, _mesh().landmarks)
    with pytest.raises(MeshError, match="foot_long: found no such surface"):
        walking_body(_design(), bare)
    with pytest.raises(DesignError, match="frequency: found -1"):
        solid_walk(_design(), _body(), frequency=-1.0, start=_standing())
    with pytest.raises(FileError, match="found no walk"):
        together(tmp_path / "a.png", {})
    with pytest.raises(FileError, match="expected"):
        together(tmp_path / "a.png", {"rods": Way([0.0, 1.0], [0.0], [0.0, 1.0], {})})


def test_options_of_models_that_do_not_fit_are_refused() -> None:
    """A model that there is not, and a mesh for rods, are refused with the option's name.

    Catches: an unknown model taken for the rods, a mesh size that is ignored.
    """
    with pytest.raises(DesignError, match=r"--model: found .cloth., expected rod, solid or both"):
        orders.walk_plan(orders.Order("junction_bot"), orders.WalkOrder(model="cloth"))
    with pytest.raises(DesignError, match="--size: found with --model rod"):
        orders.walk_plan(orders.Order("junction_bot", size="2 mm"), orders.WalkOrder())


def test_feet_are_told_apart_by_what_their_load_does() -> None:
    """The walk's feet slip and stick; a foot without load is lifted.

    Catches: shares of points in place of shares of load.
    """
    found = solid_walk(_design(), _body(), frequency=4.0, duration=0.25, start=_standing())
    assert SLIP in found.foot_state
    assert np.all((found.foot_slips >= 0.0) & (found.foot_slips <= 1.0))
    bare = replace(found, motion=replace(found.motion, contact_force=np.zeros_like(found.motion.contact_force)))
    assert np.all(bare.foot_state == LIFTED)
