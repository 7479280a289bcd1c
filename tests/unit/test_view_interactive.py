"""Interactive views say what their arrays say: packed and unpacked again they are the same to sixteen bits."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.errors import FileError
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Hold, Muscle, PointLoad, Rod
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.statics import RodStep, statics
from fem_biobot.rod.tube_stress import normal_stress
from fem_biobot.rod.tubes import pieces
from fem_biobot.study.views import rod_view
from fem_biobot.view.interactive import Coloured, Moving, figure
from fem_biobot.view.moving import machine_view, side_by_side
from fem_biobot.view.report import write_report
from tests.unit.test_view_machine import body, shape

GEL = RodMaterial(young=319.4, poisson=0.45, density=1.12e-6)


def unpacked(moving: Moving) -> dict[str, Any]:
    """What a browser reads."""
    found = re.search(r'<script type="application/json">(.*?)</script>', figure(moving), re.DOTALL)
    assert found
    return json.loads(found[1])


def array(text: str, kind: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), kind)


def triangle(**changes: Any) -> Moving:
    """Two triangles in two states; the last point belongs to nothing."""
    points = np.array([[0.0, 3.0, 0.5, 2.0, 9.0], [0.0, 0.3, 2.0, 1.7, 9.0], [1.0, 1.1, 1.2, 0.4, 9.0]])
    given: dict[str, Any] = {
        "title": "two",
        "points": np.array([points, points + 0.3]),
        "triangles": np.array([[0, 1], [1, 3], [2, 2]]),
        "part": np.array([0, 0, 0, 0, 1]),
        "parts": {"gel": "#b7c6d4", "muscle": "#c8473c"},
        "labels": ["a", "b"],
        "edges": np.array([[0], [3]]),
        "fields": [Coloured("stress [kPa]", np.array([[0.0, 1, 2, np.nan, 99], [3, 4, 5, np.nan, 99]]), (0.0, 4.0))],
        **changes,
    }
    return Moving(**given)


def test_a_browser_reads_the_positions_and_triangles_that_were_given() -> None:
    """To half a step of 16 bits of the extent; points of no triangle are not sent.

    Catches: axes swapped, states interleaved wrongly, triangles of the old numbers.
    """
    moving = triangle()
    data = unpacked(moving)
    low, high = np.array(data["low"]), np.array(data["high"])
    sent = low + array(data["positions"], "<u2").reshape(2, data["n"], 3) / 65535.0 * (high - low)
    assert data["n"] == 4
    corners = array(data["triangles"], "<u4").reshape(-1, 3)
    given = moving.points[:, :, moving.triangles].transpose(0, 3, 2, 1)  # state, triangle, corner, axis
    assert np.abs(sent[:, corners] - given).max() <= 0.5001 * (high - low).max() / 65535.0
    ends = array(data["edges"], "<u4")
    assert np.allclose(sent[1, ends], moving.points[1, :, [0, 3]], atol=1e-4, rtol=0.0)


def test_a_browser_reads_the_values_and_where_there_are_none() -> None:
    """Catches: a range of one state only, a missing value shown as zero, the limits taken for the range."""
    data = unpacked(triangle())
    (field,) = data["fields"]
    whole = array(field["values"], "<u2").reshape(2, 4).astype(float)
    assert (whole[:, 3] == 65535).all()
    low, high = field["range"]
    assert np.allclose(low + whole[:, :3] / 65534.0 * (high - low), [[0, 1, 2], [3, 4, 5]], atol=5.0 / 65534, rtol=0.0)
    assert field["limits"] == [0.0, 4.0]
    assert len(array(field["ramp"], "u1")) == 3 * 256


def test_text_in_a_view_is_never_taken_for_markup() -> None:
    """Catches: a label that ends the script, a title that is not escaped."""
    evil = "</script><script>x"
    text = figure(triangle(title=evil, caption=evil, labels=[evil, "b"]))
    assert text.count("</script>") == 1
    assert "<script>x" not in text


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"points": np.zeros((2, 5))}, "points"),
        ({"points": np.full((2, 3, 5), np.nan)}, "finite"),
        ({"triangles": np.array([[0], [1], [5]])}, "triangles"),
        ({"triangles": np.zeros((3, 0), dtype=np.int64)}, "triangles"),
        ({"part": np.array([0, 0, 0, 2, 1])}, "part"),
        ({"labels": ["a"]}, "labels"),
        ({"times": np.array([1.0, 1.0])}, "times"),
        ({"fields": [Coloured("s", np.zeros(4), (0.0, 1.0))]}, "field s"),
        ({"fields": [Coloured("s", np.zeros(5), (1.0, 1.0))]}, "limits"),
    ],
)
def test_a_view_that_does_not_fit_is_refused(changes: dict[str, Any], word: str) -> None:
    """Catches: a page that is written and shows nonsense."""
    with pytest.raises(FileError, match=word):
        figure(triangle(**changes))


def test_a_page_with_views_has_its_script_once_and_asks_for_nothing(tmp_path: Path) -> None:
    """Catches: a library from a network, the script left out or written with every view."""
    write_report(tmp_path / "a.html", {}, [], [], [], views=[triangle(), triangle()])
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert text.count("document.querySelectorAll") == 1
    assert text.count('<figure class="view3d">') == 2
    # the only address is the name of a kind of document, which nothing is fetched from
    assert set(re.findall(r"https?://[^\"'\s]*", text)) == {"http://www.w3.org/2000/svg"}


def test_a_body_moves_from_rest_and_shows_its_stress() -> None:
    """Catches: the rest state lost, stress of another state, displacement not of the points."""
    machine = body()
    states = [shape(machine, "rest", 0.0), shape(machine, "peak", 2.0)]
    view = machine_view(machine, states, title="box")
    assert np.array_equal(view.points[0], machine.placed(None))
    stress, moved, stretch = view.fields
    assert np.array_equal(stress.values[1], machine.nodal(np.asarray(states[1].von_mises)))
    assert np.allclose(moved.values, np.linalg.norm(view.points - view.points[0], axis=1))
    assert np.array_equal(np.isnan(stretch.values[0]), ~machine.of_muscle)
    # the parts are closed each: the wall between them is there twice
    assert view.triangles.shape[1] > machine.surface.shape[1]


def test_two_models_stand_behind_each_other_under_one_bar() -> None:
    """Catches: one drawn into the other, colours of one model's range, parts that hide those of the other."""
    stress = np.array([[0.0, 1, 2, 3, 4], [5, 6, 7, 8, 9]])
    one = triangle(fields=[Coloured("a", stress, (0.0, 9.0))])
    other = triangle(fields=[Coloured("b", 10.0 * stress, (0.0, 90.0))])
    both = side_by_side(one, other, title="both", words=("solid:", "rods:"), label="stress [kPa]")
    first, second = both.points[:, :, :5], both.points[:, :, 5:]
    assert np.array_equal(first, one.points)
    assert second[:, 1].min() - first[:, 1].max() == pytest.approx(0.2 * np.ptp(first[:, 1]))
    assert np.allclose(second[:, [0, 2]], other.points[:, [0, 2]])
    assert list(both.parts) == ["solid: gel", "solid: muscle", "rods: gel", "rods: muscle"]
    assert np.array_equal(both.part[5:], other.part + 2)
    assert np.array_equal(both.triangles[:, 2:], other.triangles + 5)
    assert both.fields[0].limits[1] > 80.0
    assert len(figure(both)) > 1000


def cantilever(force: tuple[float, float, float]) -> RodModel:
    points = np.linspace(0.0, 10.0, 21)[:, None] * np.array([1.0, 0.0, 0.0])
    rod = Rod(points, Section.rectangle(0.7, 2.1), GEL, name="beam")
    return RodModel([rod], supports=[Hold(("beam", 0))], loads=[PointLoad(("beam", -1), force)])


@pytest.mark.parametrize("force", [(0.3, 0.05, -0.08), (-0.02, -0.07, 0.03)])
def test_the_stress_of_a_rod_is_what_its_surface_is_stretched_by(force: tuple[float, float, float]) -> None:
    """Stress over Young's modulus is the elongation of the lines along the surface, seen in the positions alone.

    The middle of an element carries the mean of its sections; chords of the bent lines are shorter than arcs by
    (kappa h)^2 / 24, below 1e-4 of their strain here, sections turn by shear, of second order in 2e-3.
    Catches: the sign of a bending part, the moments of area swapped, a factor of two.
    """
    model = cantilever(force)
    state = statics(model, [RodStep(1.0, 1.0)]).states[-1]
    (piece,) = pieces(model, between=1)
    stress = normal_stress(state, [piece])
    at, drawn = (piece.points(s.x, s.Q)[:, : 21 * 4].reshape(3, 21, 4) for s in (state, model.drawn()))
    long, rest = (np.linalg.norm(np.diff(a, axis=1), axis=0) for a in (at, drawn))
    strain = long / rest - 1.0
    mean = 0.5 * (stress[: 21 * 4].reshape(21, 4)[1:] + stress[: 21 * 4].reshape(21, 4)[:-1])
    # the ends are one-sided: their mean is not the element's own
    error = np.abs(mean / 319.4 - strain)[1:-1].max()
    assert error < 0.02 * np.abs(strain).max()
    assert np.abs(strain).max() > 5e-3


def test_the_stress_of_a_muscle_is_force_over_its_present_section() -> None:
    """A muscle of 1.3 mm^2 stretched to 1.2 has 1.3 / 1.2 mm^2; a body has none.

    Catches: the section as moulded, a muscle without stress, zero in place of none.
    """
    bodies = [Body((x, 0.0, 0.0), 1e-6, 1e-6 * np.eye(3), name) for name, x in (("left", 0.0), ("right", 6.0))]
    muscle = Muscle(("left", (0.0, 0.0, 0.0)), ("right", (6.0, 0.0, 0.0)), area=1.3, young=10.0, passive=9.0)
    model = RodModel(bodies=bodies, members=[muscle])
    state = replace(model.drawn(), x=np.array([[0.0, 0.0, 0.0], [7.2, 0.0, 0.0]]))
    parts = pieces(model)
    stress = normal_stress(state, parts)
    counts = [piece.points(state.x, state.Q).shape[1] for piece in parts]
    assert [piece.kind for piece in parts] == ["body", "body", "muscle"]
    assert np.isnan(stress[: sum(counts[:2])]).all()
    assert np.allclose(stress[sum(counts[:2]) :], state.muscle_force("muscle") * 1.2 / 1.3, rtol=1e-12)


def test_rods_over_time_keep_their_times_and_their_ground_stays() -> None:
    """Catches: labels of states on times, the grid moved along, stress on the ground."""
    from fem_biobot.rod.ground import Ground

    model = cantilever((0.1, 0.0, -0.05))
    steps = [RodStep(share, 1.0) for share in (0.5, 1.0)]
    states = list(statics(model, steps).states)
    view = rod_view(states, title="beam", times=np.array([0.2, 0.7]), ground=Ground(0.5, 0.3, height=-1.5))
    data = unpacked(view)
    assert data["times"] == [0.2, 0.7]
    on_ground = view.part == list(view.parts).index("ground")
    assert np.allclose(view.points[:, 2, on_ground], -1.5)
    assert np.array_equal(view.points[0][:, on_ground], view.points[1][:, on_ground])
    assert np.isnan(view.fields[0].values[:, on_ground]).all()
    assert np.abs(view.points[1] - view.points[0])[:, ~on_ground].max() > 1e-3
