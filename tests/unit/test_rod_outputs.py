"""Files of rods in motion are on the motion's times and hold its own values; a walk's pictures are all there."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import pyvista
from PIL import Image

from fem_biobot.errors import FileError
from fem_biobot.rod.dynamics.integrate import Motion, dynamics
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Gravity, Muscle, Rigid, Rod
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.walk import walk
from fem_biobot.study.rod_outputs import draw_gait, draw_walk, write_rod_series
from fem_biobot.study.walk_files import draw_walks

GEL = 1.12e-6  # kg/mm^3


def bot() -> RodModel:
    """A beam on a short and a long leg, pulled together by a muscle."""
    top, half = 3.4, 3.5
    points = np.stack([np.linspace(-half, half, 5), np.zeros(5), np.full(5, top)], axis=1)
    material = RodMaterial(young=319.4, poisson=0.45, density=GEL)
    beam = Rod(points, Section.rectangle(0.68, 7.0), material, "beam", normal=(0.0, 0.0, 1.0))
    bodies, joints, feet = [], [], []
    for name, x, height, end in (("short", -5.25, 2.8, 0), ("long", 5.25, 3.4, -1)):
        sole = top - height
        body = Body.box((x, 0.0, (top + sole) / 2), (3.5, 7.0, height), GEL, name)
        bodies.append(body)
        joints.append(Rigid(("beam", end), (name, body.centre)))
        feet.append(ContactPoints(name, [(x + a * 1.75, b * 3.5, sole) for a in (-1, 1) for b in (-1, 1)]))
    muscle = Muscle(
        ("short", (-half, 0.0, 1.4)),
        ("long", (half, 0.0, 1.4)),
        area=0.88,
        young=10.0,
        passive=0.9,
        active=2.7,
        mass=6e-6,
    )
    return RodModel(
        [beam], joints, bodies, loads=[Gravity()], members=[muscle], contacts=feet, damping_time=1e-4
    )  # fmt: skip


@cache
def walked() -> Walk:
    return walk(bot(), frequency=4.0, duration=1.1, ground=Ground(0.42, 0.3), discard=1)


@cache
def sliding() -> Motion:
    """The machine on a ground that slides away below it, much faster than it can follow."""
    return dynamics(bot(), 0.02, 1e-3, ground=Ground(0.4, velocity=(500.0, 200.0, 0.0)), sample_every=2)


def read(path: Path, time: float) -> pyvista.PolyData:
    reader = pyvista.get_reader(path)
    reader.set_active_time_value(time)  # type: ignore[attr-defined]
    found = reader.read()[0]
    assert isinstance(found, pyvista.PolyData)
    return found


def test_a_series_holds_the_motion_at_its_own_times(tmp_path: Path) -> None:
    """Catches: times by number, states shifted by one, samples skipped, names of parts in another order."""
    motion = sliding()
    files = write_rod_series(tmp_path, motion, 3)
    assert [file.name for file in files] == ["rod.pvd", "rod_lines.pvd", "rod_contacts.pvd"]
    kept = motion.times[::3]
    for file in files:
        assert pyvista.get_reader(file).time_values == kept.tolist()  # type: ignore[attr-defined]
    i, time = 6, float(kept[2])
    surface = read(files[0], time)
    state = motion.state(i)
    names = list(surface.field_data["part_names"])
    assert names == ["beam", "short", "long", "muscle"]
    assert surface.n_open_edges == 0
    # 7 x 0.68 x 7 of beam (near enough, bent), the boxes, and the muscle's polygon of 32 sides
    muscle = 0.88 * 7.0 * np.sin(2 * np.pi / 32) * 32 / (2 * np.pi)
    assert surface.volume == pytest.approx(33.32 + 3.5 * 7.0 * (2.8 + 3.4) + muscle, rel=1e-3)
    pulled = surface.cell_data["part"] == names.index("muscle")
    assert np.all(surface.cell_data["tension_mN"][pulled] == state.muscle_force("muscle"))
    body = surface.extract_cells(surface.cell_data["part"] == names.index("long"))
    assert np.allclose(body.points.mean(axis=0), state.at(("long", (5.25, 0.0, 1.7))), atol=1e-9)
    lines = read(files[1], time)
    assert np.allclose(lines.points[0], state.at(("beam", 0)), atol=1e-12)
    assert np.allclose(lines.point_data["director_1"][0], state.directors("beam")[0, 0], atol=1e-12)


def test_contact_forces_are_the_grounds_in_space(tmp_path: Path) -> None:
    """Friction follows the ground, which moves forward and to the left; the normal force points up.

    Catches: forces of another sample, tangents swapped, the machine's force on the ground.
    """
    motion = sliding()
    files = write_rod_series(tmp_path, motion, 1)
    last = read(files[2], float(motion.times[-1]))
    force, up = motion.contact_force[-1], last.point_data["normal_force_mN"]
    assert up[:, 2].sum() > 0.0
    assert np.allclose(up[:, 2], force[:, 0], rtol=1e-13)
    assert np.array_equal(up[:, :2], np.zeros((8, 2)))
    friction = last.point_data["friction_force_mN"]
    assert np.allclose(friction[:, :2], force[:, 1:], rtol=1e-13)
    assert np.all(friction.sum(axis=0)[:2] > 0.0)
    assert np.linalg.norm(friction.sum(axis=0)) == pytest.approx(0.4 * up[:, 2].sum(), rel=0.01)
    assert np.allclose(last.point_data["contact_force_mN"], up + friction, rtol=1e-13)
    assert last.point_data["foot"].tolist() == [0] * 4 + [1] * 4
    assert list(last.field_data["foot_names"]) == ["short", "long"]
    slips = last.point_data["touch"] == list(last.field_data["touch_names"]).index("slip")
    assert np.all(slips[up[:, 2] > 0.0])
    ground = pyvista.read(tmp_path / "rod" / "ground.vtp")
    assert isinstance(ground, pyvista.PolyData)
    assert np.all(ground.points[:, 2] == 0.0)
    assert ground.bounds[0] < last.points[:, 0].min() < last.points[:, 0].max() < ground.bounds[1]


def test_a_series_without_ground_or_rods_is_written_too(tmp_path: Path) -> None:
    """Catches: contacts asked of a motion without a ground, an assembly of one body that breaks the lines."""
    motion = dynamics(RodModel(bodies=[Body.box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), GEL)]), 0.01, 1e-3)
    files = write_rod_series(tmp_path, motion, name="block", most=3)
    assert [file.name for file in files] == ["block.pvd", "block_lines.pvd"]
    assert len(pyvista.get_reader(files[0]).time_values) == 3  # type: ignore[attr-defined]
    assert read(files[0], 0.0).volume == pytest.approx(6.0, rel=1e-12)
    assert not list((tmp_path / "block").glob("ground*"))


def test_series_are_refused_where_they_cannot_be(tmp_path: Path) -> None:
    """Catches: a step of zero that never ends, a folder's failure as a traceback."""
    with pytest.raises(FileError, match="every"):
        write_rod_series(tmp_path, sliding(), 0)
    with pytest.raises(FileError, match="missing"):
        write_rod_series(tmp_path / "missing", sliding())


def test_a_walk_is_drawn_whole(tmp_path: Path) -> None:
    """Catches: a figure announced and not written, an animation of another length than the strokes shown."""
    found = draw_walk(tmp_path, walked(), "4Hz")
    assert [path.name for path, _ in found] == ["walk_4Hz.png", "feet_4Hz.png", "energy_4Hz.png", "gait_4Hz.gif"]
    assert all(path.stat().st_size > 5000 and "4 Hz" in caption for path, caption in found)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(path.name for path, _ in found)
    with Image.open(found[-1][0]) as image:
        # four whole strokes are one second
        assert image.n_frames == 26  # type: ignore[attr-defined]


def test_the_camera_films_at_its_own_rate(tmp_path: Path) -> None:
    """Catches: frames a second that count the film's time instead of the machine's."""
    assert draw_gait(tmp_path / "a.gif", walked(), rate=6.0, slow=2.0, width=300) == 7


def test_several_frequencies_have_a_graph_of_their_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Catches: the graph left out, or drawn for one frequency; graphs of walks that are not to be shown."""
    other = walk(bot(), frequency=8.0, duration=0.6, ground=Ground(0.42, 0.3), start=walked().start)
    monkeypatch.setattr("fem_biobot.study.rod_outputs.draw_walk", lambda figures, walk, label: [(figures / label, "")])
    both = draw_walks(tmp_path, [walked(), other], [other])
    assert [path.name for path, _ in both] == ["steps.png", "8Hz"]
    assert (tmp_path / "figures" / "steps.png").is_file()
    assert [path.name for path, _ in draw_walks(tmp_path, [walked()], [walked()])] == ["4Hz"]


def test_a_walk_without_a_stroke_has_no_animation(tmp_path: Path) -> None:
    """Catches: a film of nothing, a period that is not there."""
    short = walk(bot(), frequency=4.0, duration=0.1, ground=Ground(0.42, 0.3), start=walked().start)
    assert [p.name for p, _ in draw_walk(tmp_path, short, "x")] == ["walk_x.png", "energy_x.png"]
    with pytest.raises(FileError, match="whole stroke"):
        draw_gait(tmp_path / "a.gif", short)
