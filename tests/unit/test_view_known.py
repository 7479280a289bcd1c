"""Graphs of known answers beside ours show what they were given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from fem_biobot.errors import FileError
from fem_biobot.verification.records import Curve
from fem_biobot.view import known
from fem_biobot.view.known import known_and_ours

LINE = Curve("closed form", [1.0, 2.0, 4.0], [3.0, 5.0, 9.0], known=True)
MARKS = Curve("printed", [1.0, 4.0], [3.1, 8.9], known=True, joined=False)
OURS = Curve("ours", [2.0, 3.0], [5.1, 7.2])


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that were saved, to look into."""
    kept: list[Figure] = []
    save = known.save

    def keep(figure: Figure, path: Any, title: str) -> None:
        kept.append(figure)
        save(figure, path, title)

    monkeypatch.setattr(known, "save", keep)
    return kept


def test_known_answers_are_lines_and_ours_points_of_the_same_colour(tmp_path: Path, drawn: list[Figure]) -> None:
    """Each curve has its data, known lines no markers, ours no line, the printed marks neither's colour.

    Catches: known and ours exchanged, axes exchanged, a line through printed points.
    """
    known_and_ours(tmp_path / "a.png", [MARKS, LINE, OURS], x="x [mm]", y="y [1]", title="S0: told", logarithmic="x")
    (axes,) = drawn[0].axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [mm]", "y [1]")
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "linear")
    lines = {str(line.get_label()): line for line in axes.lines}
    for curve in (LINE, MARKS, OURS):
        np.testing.assert_array_equal(lines[curve.name].get_xdata(), curve.x)
        np.testing.assert_array_equal(lines[curve.name].get_ydata(), curve.y)
    assert (lines["closed form"].get_linestyle(), lines["closed form"].get_marker()) == ("-", "None")
    assert (lines["ours"].get_linestyle(), lines["ours"].get_marker()) == ("None", "o")
    assert (lines["printed"].get_linestyle(), lines["printed"].get_marker()) == ("None", "D")
    assert lines["closed form"].get_color() == lines["ours"].get_color() != lines["printed"].get_color()
    assert (tmp_path / "a.png").stat().st_size > 5000


def test_shapes_have_one_scale_and_many_names_stand_beside(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches: a circle drawn as an ellipse, a legend over the curves."""
    many = [Curve(f"{k}", [0.0, 1.0], [k, k + 1.0]) for k in range(8)]
    known_and_ours(tmp_path / "a.png", many, x="x", y="y", title="t", equal=True)
    (axes,) = drawn[0].axes
    assert axes.get_aspect() == 1.0
    assert axes.get_legend() is None
    assert [text.get_text() for text in drawn[0].legends[0].get_texts()] == [str(k) for k in range(8)]


@pytest.mark.parametrize(
    ("curves", "axes", "word"),
    [
        ([], "", "at least one"),
        ([Curve("a", [1.0, 2.0], [1.0])], "", "a: "),
        ([Curve("b", [1.0], [np.nan])], "", "b: "),
        ([Curve("c", [0.0], [1.0])], "x", "c: x"),
        ([Curve("d", [1.0], [-1.0])], "xy", "d: y"),
    ],
)
def test_what_cannot_be_drawn_is_refused(tmp_path: Path, curves: list[Curve], axes: str, word: str) -> None:
    """Catches: a point lost on a logarithmic axis, a picture of nothing."""
    with pytest.raises(FileError, match=word):
        known_and_ours(tmp_path / "a.png", curves, x="x", y="y", title="t", logarithmic=axes)
    assert list(tmp_path.iterdir()) == []
