"""Graphs are whole PNG files that show what they were given, without matplotlib's global state."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib._pylab_helpers as pylab
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from fem_biobot.errors import FileError
from fem_biobot.view import graph, plots

TENSION = np.linspace(0.0, 14.0, 9)
FORCE = 0.1 * TENSION
CLOSING = 0.55 * FORCE**1.2


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that were saved, to look into."""
    kept: list[Figure] = []
    save = plots.save

    def keep(figure: Figure, path: Any, title: str) -> None:
        kept.append(figure)
        save(figure, path, title)

    monkeypatch.setattr(plots, "save", keep)
    return kept


def line(figure: Figure, label: str) -> tuple[np.ndarray, np.ndarray]:
    (found,) = [each for axes in figure.axes for each in axes.lines if each.get_label() == label]
    return np.asarray(found.get_xdata()), np.asarray(found.get_ydata())


def test_force_and_stroke_stand_beside_the_papers_points(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches: axes swapped, the paper's points in another order, an axis without its unit."""
    plots.force_stroke(tmp_path / "a.png", {"as moulded": (CLOSING, FORCE)}, marks={"passive": (0.2, 0.5)}, linear=0.5)
    axes = drawn[0].axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("tip closing [mm]", "muscle force [mN]")
    x, y = line(drawn[0], "as moulded")
    assert np.array_equal(x, CLOSING)
    assert np.array_equal(y, FORCE)
    x, y = line(drawn[0], "paper, simulated (text, approx.)")
    assert list(zip(x, y, strict=True)) == [(0.3, 0.5), (0.5, 1.0), (1.0, 1.4)]
    x, y = line(drawn[0], "linear theory")
    assert x[1] == pytest.approx(0.5 * y[1])
    assert "passive" in [text.get_text() for text in axes.texts]


def test_the_papers_points_are_left_out_where_they_do_not_belong(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches: the reference machine's points drawn over every machine."""
    plots.force_stroke(tmp_path / "a.png", {"other machine": (CLOSING, FORCE)}, paper=False)
    assert [each.get_label() for each in drawn[0].axes[0].lines] == ["other machine"]


def test_a_tension_path_has_one_graph_a_measure(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches: a measure under another's label, marks on one graph only."""
    plots.tension_path(
        tmp_path / "a.png", TENSION, fibre_stretch=1 - 0.03 * TENSION, tip_closing=CLOSING, marks={"passive": 9.09}
    )
    axes = drawn[0].axes
    assert [each.get_ylabel() for each in axes] == ["fibre stretch [1]", "tip closing [mm]"]
    assert [each.get_xlabel() for each in axes] == ["tension [kPa]"] * 2
    assert np.array_equal(np.asarray(axes[1].lines[0].get_ydata()), CLOSING)
    assert all(np.asarray(each.lines[1].get_xdata())[0] == 9.09 for each in axes)


def test_stress_starts_at_zero_and_residuals_are_logarithmic(tmp_path: Path, drawn: list[Figure]) -> None:
    """Catches: a stress axis cut off above zero, an exact zero residual breaking the logarithm."""
    plots.von_mises_path(tmp_path / "a.png", TENSION, {"ball average": 5.0 + TENSION})
    plots.newton_history(tmp_path / "b.png", [[1.0, 1e-3, 1e-9], [0.5, 0.0]], tolerance=1e-8)
    assert drawn[0].axes[0].get_ylim()[0] == 0.0
    assert drawn[1].axes[0].get_yscale() == "log"
    assert np.asarray(drawn[1].axes[0].lines[1].get_ydata())[1] > 0.0


def test_graphs_are_sharp_whole_and_leave_no_global_figure(tmp_path: Path) -> None:
    """Catches: pyplot's figures piling up, low resolution, bytes that change from run to run, temporary files."""
    for name in ("a.png", "b.png"):
        plots.force_stroke(tmp_path / name, {"x": (CLOSING, FORCE)})
    assert not pylab.Gcf.figs
    assert imread(tmp_path / "a.png").shape[1] >= 6.0 * 150
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "b.png"]


def test_rows_that_do_not_fit_are_refused_by_name(tmp_path: Path) -> None:
    """Catches: a graph of cut or not finite rows, an empty graph."""
    with pytest.raises(FileError, match=r"moulded.*as many as places"):
        plots.force_stroke(tmp_path / "a.png", {"moulded": (CLOSING, FORCE[1:])})
    with pytest.raises(FileError, match=r"ball.*not finite"):
        plots.von_mises_path(tmp_path / "a.png", TENSION, {"ball": np.full(9, np.nan)})
    with pytest.raises(FileError, match="at least one measure"):
        plots.tension_path(tmp_path / "a.png", TENSION)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("columns", [1, 2])
def test_no_legend_lies_over_a_curve(tmp_path: Path, columns: int) -> None:
    """Curves fill their axes.

    Catches: a legend left over them, one put over the axes' neighbour, or squeezing its own.
    """
    figure, all_axes = graph.side_by_side(columns, (3.4 * columns, 2.6))
    x = np.linspace(0.0, 1.0, 400)
    for axes in all_axes:
        for k in range(3):
            axes.plot(x, np.sin(60.0 * x + k), label=f"the whole of the axes, number {k}")
        graph.legend(axes)
    figure.draw_without_rendering()
    assert all(graph.covers(axes) for axes in all_axes)
    graph.save(figure, tmp_path / "a.png", "title")
    figure.draw_without_rendering()
    assert not any(graph.covers(axes) for axes in all_axes)
    boxes = [axes.get_legend().get_window_extent() for axes in all_axes]  # type: ignore[union-attr]
    for number, box in enumerate(boxes):
        assert all_axes[number].get_window_extent().width > 0.25 * figure.bbox.width
        assert not any(box.overlaps(axes.get_window_extent()) for axes in all_axes), number
        assert figure.bbox.x0 <= box.x0, number
        assert box.x1 <= figure.bbox.x1, number
