"""Graphs of a walk show what they were given; the animation is a whole GIF on the machine's time."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib._pylab_helpers as pylab
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from fem_biobot.errors import FileError
from fem_biobot.view import gait
from fem_biobot.view import together as together_view
from fem_biobot.view.animation import Outline, Silhouette, Trail, write_gait
from fem_biobot.view.gait import Foot, energy_book, foot_forces, position, step_against_frequency
from fem_biobot.view.together import Way, phase_portrait

TIMES = np.linspace(0.0, 2.0, 81)
ADVANCE = 0.17 * TIMES + 0.03 * np.sin(7.0 * TIMES)
CLOSING = 0.4 * np.abs(np.sin(2.0 * np.pi * TIMES))
ENDS = np.arange(5) * 0.5
LEFT = Foot(1.2 + 0.1 * TIMES, 0.3 * np.cos(TIMES), np.arange(81) % 3)
RIGHT = Foot(0.9 - 0.1 * TIMES, -0.3 * np.cos(TIMES), np.ones(81))


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that were saved, to look into."""
    kept: list[Figure] = []
    save = gait.save

    def keep(figure: Figure, path: Any, title: str) -> None:
        kept.append(figure)
        save(figure, path, title)

    monkeypatch.setattr(gait, "save", keep)
    monkeypatch.setattr(together_view, "save", keep)
    return kept


def rows(axes: Any) -> list[tuple[list[float], list[float]]]:
    return [(np.asarray(l.get_xdata()).tolist(), np.asarray(l.get_ydata()).tolist()) for l in axes.lines]  # noqa: E741


def test_position_shows_the_path_and_the_mean_of_the_strokes_kept(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches: the transient counted into the mean, axes without units, the camera on the wrong graph."""
    seen = TIMES[::9], CLOSING[::9]
    position(tmp_path / "a.png", TIMES, ADVANCE, tip_closing=CLOSING, strokes=ENDS, discarded=1, camera=seen)
    top, below = drawn[0].axes
    assert (top.get_ylabel(), below.get_ylabel()) == ("centre of mass [mm]", "tip closing [mm]")
    assert below.get_xlabel() == "time [s]"
    assert (TIMES.tolist(), ADVANCE.tolist()) in rows(top)
    mean = [line for line in top.lines if "a stroke" in str(line.get_label())]
    # three strokes of 0.5 s from 0.5 s to 2 s
    step = (0.17 * 1.5 + 0.03 * (np.sin(14.0) - np.sin(3.5))) / 3.0
    assert mean[0].get_label() == f"mean of strokes 2 to 4: {step:.3g} mm a stroke"
    assert np.diff(np.asarray(mean[0].get_ydata()))[0] == pytest.approx(3.0 * step, rel=1e-9)
    assert (seen[0].tolist(), seen[1].tolist()) in rows(below)


def test_a_walk_without_strokes_has_no_mean(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches: an empty row of strokes that breaks the graph, a mean of nothing."""
    position(tmp_path / "a.png", TIMES, ADVANCE)
    assert len(drawn[0].axes) == 1
    assert rows(drawn[0].axes[0]) == [(TIMES.tolist(), ADVANCE.tolist())]


def test_feet_show_their_forces_and_states_over_the_period(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches: samples outside the period, normal force and friction swapped, a state in another's colour or time."""
    foot_forces(
        tmp_path / "a.png", TIMES, {"short": LEFT, "long": RIGHT}, period=(0.5, 1.0), friction=[0.3, 0.2], drive=CLOSING
    )
    normal, friction, states, drive = drawn[0].axes
    inside = (TIMES >= 0.5 - 1e-9) & (TIMES <= 1.0 + 1e-9)
    x = (TIMES[inside] - 0.5).tolist()
    assert rows(normal)[0] == (x, np.asarray(LEFT.normal)[inside].tolist())
    assert rows(friction)[0] == (x, np.asarray(LEFT.friction)[inside].tolist())
    assert rows(friction)[1] == (x, (0.3 * np.asarray(LEFT.normal)[inside]).tolist())
    assert rows(friction)[2] == (x, (-0.2 * np.asarray(LEFT.normal)[inside]).tolist())
    assert [text.get_text() for text in states.get_yticklabels()] == ["short", "long"]
    shown = np.asarray(states.collections[0].get_array()).reshape(2, -1)
    # a sample's state is that of the time since the sample before
    assert shown[0].tolist() == np.asarray(LEFT.state)[inside][1:].tolist()
    assert set(shown[1].tolist()) == {1.0}
    assert drive.get_ylabel() == "drive [1]"
    assert normal.get_ylim()[0] == 0.0


def test_the_book_of_energy_shows_every_entry_from_zero(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches: an entry left out of the legend, an offset kept, the rest hidden by its scale."""
    work = {name: k + (k - 2.5) * TIMES for k, name in enumerate(("muscle", "friction", "damping"))}
    energy_book(tmp_path / "a.png", TIMES, {"elastic": 3.0 + CLOSING}, work, 1e-7 * TIMES, strokes=ENDS)
    stored, done, rest = drawn[0].axes
    assert rows(stored)[0][1] == pytest.approx(CLOSING.tolist(), abs=1e-15)
    assert [line.get_label() for line in done.lines] == ["muscle", "friction", "damping"]
    assert all(row[1][0] == 0.0 for row in rows(done))
    assert rows(rest)[0][1] == (1e-7 * TIMES).tolist()
    assert rest.get_ylim()[1] < 1e-6


def test_steps_stand_over_their_frequencies_and_speed_is_their_product(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches: curves drawn in the order given, the speed without its frequency, spreads of another point."""
    step_against_frequency(
        tmp_path / "a.png",
        {"rod": ([2.0, 0.5, 1.0], [0.2, 0.1, 0.3], [0.02, 0.01, 0.03])},
        marks={"paper": ([1.0], [0.4])},
    )
    step, speed = drawn[0].axes
    assert ([0.5, 1.0, 2.0], [0.1, 0.3, 0.2]) in rows(step)
    assert ([0.5, 1.0, 2.0], [0.05, 0.3, 0.4]) in rows(speed)
    assert ([1.0], [0.4]) in rows(speed)
    ends = [np.ptp(s[:, 1]) for s in step.collections[0].get_segments()]  # type: ignore[attr-defined]
    assert ends == pytest.approx([0.02, 0.06, 0.04], rel=1e-9)


def test_graphs_leave_no_global_figure_and_no_temporary_file(tmp_path: Path) -> None:
    """Catches: pyplot's figures piling up, bytes that change from run to run."""
    for name in ("a.png", "b.png"):
        position(tmp_path / name, TIMES, ADVANCE, strokes=ENDS)
    assert not pylab.Gcf.figs
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "b.png"]


def test_rows_that_do_not_fit_a_graph_are_refused_by_name(tmp_path: Path) -> None:
    """Catches: cut or not finite rows drawn, an empty graph."""
    with pytest.raises(FileError, match=r"advance.*as many as places"):
        position(tmp_path / "a.png", TIMES, ADVANCE[1:])
    with pytest.raises(FileError, match="at least one"):
        foot_forces(tmp_path / "a.png", TIMES, {})
    with pytest.raises(FileError, match="samples from 7 to 8"):
        foot_forces(tmp_path / "a.png", TIMES, {"short": LEFT}, period=(7.0, 8.0))
    with pytest.raises(FileError, match=r"short: friction.*not finite"):
        foot_forces(tmp_path / "a.png", TIMES, {"short": Foot(LEFT.normal, np.full(81, np.nan), LEFT.state)})
    assert list(tmp_path.iterdir()) == []


# --- the animation ----------------------------------------------------------------------------------------------------

SQUARE = np.array([[0.0, 4.0, 4.0, 0.0], [0.0, 0.0, 2.0, 2.0]])
FACES = np.array([[0, 0], [1, 2], [2, 3]])


def sliding(times: np.ndarray, colour: str = "#c8473c") -> Silhouette:
    """A square of 4 x 2 mm that goes 3 mm forward a second."""
    way = np.stack([3.0 * times, 0.0 * times], axis=1)
    return Silhouette(SQUARE + way[:, :, None], FACES, colour)


def trail(times: np.ndarray) -> Trail:
    force = np.stack([0.2 * np.ones_like(times), np.ones_like(times)], axis=1)
    return Trail(np.stack([2.0 + 3.0 * times, 0.0 * times], axis=1), np.arange(len(times)) % 3, force)


def frames_of(path: Path) -> tuple[list[np.ndarray], list[int]]:
    with Image.open(path) as image:
        found, durations = [], []
        for k in range(image.n_frames):  # type: ignore[attr-defined]
            image.seek(k)
            found.append(np.asarray(image.convert("RGB")).astype(int))
            durations.append(int(image.info["duration"]))
    return found, durations


def red(frame: np.ndarray) -> tuple[np.ndarray, ...]:
    """Rows and columns of what is red."""
    return np.nonzero((frame[..., 0] > 170) & (frame[..., 1] < 110) & (frame[..., 2] < 110))


@pytest.mark.parametrize(("rate", "slow", "count"), [(6.0, 1.0, 7), (10.0, 2.5, 11)])
def test_frames_are_those_of_the_cameras_times(tmp_path: Path, rate: float, slow: float, count: int) -> None:
    """Catches: one frame a sample, the last frame lost, a film faster than life, positions of the sample before."""
    times = np.linspace(0.3, 1.3, 14)  # the camera's times lie between the samples
    written = write_gait(tmp_path / "a.gif", times, [sliding(times)], {}, rate=rate, slow=slow, width=400)
    found, durations = frames_of(tmp_path / "a.gif")
    assert written == len(found) == count
    # a hundredth of a second is the format's unit; the sum keeps in step
    assert sum(durations) == pytest.approx(1000.0 * slow * count / rate, abs=10.0)
    middle = [red(frame)[1].mean() for frame in found]
    assert np.diff(middle) == pytest.approx(np.full(count - 1, (middle[-1] - middle[0]) / (count - 1)), abs=1.0)
    assert np.array_equal(found[0][0, 0], [255, 255, 255])


def test_lengths_are_to_scale_in_both_directions(tmp_path: Path) -> None:
    """Catches: axes stretched to fill the picture."""
    times = np.linspace(0.0, 1.0, 5)
    write_gait(tmp_path / "a.gif", times, [sliding(times)], {"short": trail(times)}, rate=4.0, width=700)
    tall, wide = (np.ptp(places) + 1 for places in red(frames_of(tmp_path / "a.gif")[0][2]))
    assert wide / tall == pytest.approx(2.0, abs=4.0 / tall)


def test_feet_leave_their_ways_below_and_glow_shows_the_drive(tmp_path: Path) -> None:
    """Catches: ways drawn to the end from the first frame on, a glow that does not change the colour."""
    times = np.linspace(0.0, 1.0, 31)
    part = sliding(times)
    glowing = Silhouette(part.points, part.triangles, part.colour, glow=times)
    write_gait(
        tmp_path / "a.gif", times, [glowing], {"short": trail(times)}, rate=5.0, width=500, weight=3.0, title="A title"
    )
    found, _ = frames_of(tmp_path / "a.gif")
    half = found[0].shape[0] // 2
    slip = [np.count_nonzero(np.abs(f[half:] - [0xE6, 0x9F, 0x00]).sum(axis=2) < 40) for f in found]
    assert slip[0] == 0
    assert all(b > a for a, b in pairwise(slip))
    assert len(red(found[0])[0]) == 0 < len(red(found[-1])[0])


def test_outlines_move_over_the_parts_and_are_named_once(tmp_path: Path) -> None:
    """A red line over a grey part goes with its own points, and the picture is wide enough for it.

    Catches: a line that stays, one behind the parts, a frame cut to the parts alone.
    """
    times = np.linspace(0.0, 1.0, 5)
    line = np.stack([np.stack([np.full(2, 1.0 + 6.0 * t), np.array([0.2, 1.8])]) for t in times])
    lines = [Outline(line, "#c8473c", "rods"), Outline(line + np.array([[[0.1], [0.0]]]), "#c8473c", "rods")]
    write_gait(tmp_path / "a.gif", times, [sliding(times, "#808080")], {}, outlines=lines, rate=4.0, width=500)
    # left of the legend's own line
    middle = [np.median(red(frame)[1]) for frame in frames_of(tmp_path / "a.gif")[0]]
    assert np.diff(middle).min() > 20.0
    with pytest.raises(FileError, match="outline 0"):
        write_gait(
            tmp_path / "b.gif", times, [sliding(times)], {}, outlines=[Outline(line[:4], "red")], rate=4.0, width=300
        )


def test_the_phase_portrait_is_a_circle_of_a_swinging_tip(tmp_path: Path, drawn: list[Figure]) -> None:
    """Of a sine of 2 Hz: rates over positions on an ellipse with the ratio of the angular frequency, from `since` on.

    Catches: rates of the samples' numbers, the transient drawn, the position's rate on the left.
    """
    t = np.linspace(0.0, 2.0, 2001)
    w = 4.0 * np.pi
    way = Way(t, 0.3 * t, np.sin(w * t), {})
    phase_portrait(tmp_path / "a.png", {"rods": way}, since=1.0)
    (closing, rate), (again, speed) = (rows(axes)[0] for axes in drawn[-1].axes)
    np.testing.assert_allclose(np.array(closing) ** 2 + (np.array(rate) / w) ** 2, 1.0, atol=1e-3)
    assert len(closing) == len(again) == 1001
    np.testing.assert_allclose(speed, 0.3, rtol=1e-9)
    with pytest.raises(FileError, match="at least three"):
        phase_portrait(tmp_path / "b.png", {"rods": way}, since=5.0)
    with pytest.raises(FileError, match="found no walk"):
        phase_portrait(tmp_path / "b.png", {})


def test_the_animation_is_whole_the_same_and_alone(tmp_path: Path) -> None:
    """Catches: a temporary file left, bytes that change, inputs changed."""
    times = np.linspace(0.0, 1.0, 5)
    part = sliding(times)
    before = part.points.copy()
    for name in ("a.gif", "b.gif"):
        write_gait(tmp_path / name, times, [part], {"short": trail(times)}, rate=4.0, width=300)
    assert (tmp_path / "a.gif").read_bytes() == (tmp_path / "b.gif").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.gif", "b.gif"]
    assert np.array_equal(part.points, before)
    assert not pylab.Gcf.figs


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"rate": 0.0}, "rate"),
        ({"slow": float("nan")}, "slow"),
        ({"width": -1}, "width"),
        ({"rate": 0.5}, "at least two"),
        ({"times": np.zeros(5)}, "increase"),
        ({"parts": []}, "no part"),
        ({"parts": [Silhouette(SQUARE[None], FACES, "red")]}, "part 0"),
        ({"parts": [Silhouette(np.full((5, 2, 4), np.nan), FACES, "red")]}, "part 0: values that are not finite"),
        ({"parts": [Silhouette(np.zeros((5, 2, 4)), FACES, "red", glow=np.zeros(4))]}, "glow of part 0"),
        ({"feet": {"short": Trail(np.zeros((5, 3)), np.zeros(5))}}, "short"),
        ({"feet": {"short": Trail(np.zeros((5, 2)), np.zeros(5), force=np.zeros((4, 2)))}}, "short: force"),
    ],
)
def test_what_does_not_fit_an_animation_is_refused(tmp_path: Path, change: dict[str, Any], word: str) -> None:
    """Catches: a film of nothing, parts of another motion, a rate that divides by zero."""
    times = np.linspace(0.0, 1.0, 5)
    given: dict[str, Any] = {"times": times, "parts": [sliding(times)], "feet": {}, "rate": 4.0, "width": 300, **change}
    with pytest.raises(FileError, match=word):
        write_gait(tmp_path / "a.gif", given.pop("times"), given.pop("parts"), given.pop("feet"), **given)
    assert list(tmp_path.iterdir()) == []
