"""The machine on its three committed meshes: what converges, and what must not be quoted because it does not."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.solid.from_design import model_from_design, tension_step
from fem_biobot.solid.measures import measures
from fem_biobot.solid.model import solve
from tests.helpers import committed_bot

TENSION = 4.0


@pytest.fixture(scope="module")
def table() -> dict[str, np.ndarray]:
    """Measures at 4 kPa, from the coarsest mesh to the finest, and the mesh sizes."""
    rows = []
    for size in (2.0, 0.9, 0.55):
        design, mesh = committed_bot(size)
        assert mesh.source["size_mm"] == size
        state = solve(model_from_design(design, mesh), [tension_step(design, TENSION)]).last
        rows.append({**measures(state, design), "size": size})
    return {key: np.array([row[key] for row in rows], dtype=float) for key in rows[0]}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "sign", "last"),
    [
        ("tip_closing_mm", 1, 0.005),
        ("sagitta_mm", 1, 0.0005),
        ("muscle_force_mN", -1, 0.002),
        ("fibre_stretch_1", -1, 0.0005),
    ],
)
def test_stroke_and_force_converge(table: dict[str, np.ndarray], key: str, sign: int, last: float) -> None:
    """Finer meshes are softer; the last change is below the stated share and less than half the one before.

    Catches: a probe point that moves with the mesh, a section or surface that gains elements with refinement.
    """
    change = np.diff(table[key]) / table[key][-1]
    assert np.all(sign * change > 0.0)
    assert abs(change[1]) < last
    assert abs(change[1]) < 0.5 * abs(change[0])


@pytest.mark.slow
def test_the_peak_at_a_sharp_corner_grows_with_refinement(table: dict[str, np.ndarray]) -> None:
    """The largest von Mises stress grows with every refinement, so it is no result; the ball average moves far less.

    Catches: a peak taken for a result; a ball that shrinks with the elements.
    """
    peak, average = table["max_von_mises_kPa"], table["ball_von_mises_kPa"]
    assert np.all(np.diff(peak) > 0.05 * peak[:-1])
    assert np.all(np.abs(np.diff(average)) < 0.025 * average[:-1])
