"""Limits read off sequences of meshes: constructed ones, smooth and singular, and the command on a small design."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.cli import main
from fem_biobot.errors import ModelError
from fem_biobot.solid.model import SolidModel, SolidState
from fem_biobot.solid.records import Step
from fem_biobot.study.convergence import energy_parts, energy_told
from fem_biobot.study.richardson import Verdict, limit
from tests.helpers import committed_bot, generator

SIZES = (1.0, 0.62, 0.4)  # of no common ratio


@pytest.mark.parametrize("order", [0.6, 1.0, 2.0, 3.9])
def test_a_smooth_quantity_is_extrapolated_exactly(order: float) -> None:
    """A limit with one power of the size: value and order to rounding, and the true error within the bar.

    Catches: a formula for equal ratios only, the coarse meshes taken for the fine ones.
    """
    values = [7.0 + 0.3 * h**order for h in SIZES]
    found = limit(SIZES, values, 1e-9)
    assert found.value == pytest.approx(7.0, rel=1e-9)
    assert found.order == pytest.approx(order, rel=1e-6)
    assert abs(values[-1] - 7.0) / values[-1] <= found.error <= 1.3 * abs(values[-1] - 7.0) / values[-1]
    assert found.verdict is Verdict.converging
    # at the size told the error is what was asked for
    wanted = 1e-3
    size = limit(SIZES, values, wanted).size
    assert 1.25 * 0.3 * size**order / values[-1] == pytest.approx(wanted, rel=1e-6)


def test_an_order_that_corners_do_not_allow_is_not_gone_on_with() -> None:
    """Errors ``0.1 h + 0.1 h^4``: changes are mostly the second's, what is left beyond the finest mesh is the first's.

    Going on with the order of three that is seen, the bar is two thirds of the true error; with the known one it holds.

    Catches: an order of coarse meshes trusted beyond the finest, the bound taken for the order of every quantity.
    """
    sizes, values = (1.0, 0.8, 0.64), [7.0 + 0.1 * (h + h**4) for h in (1.0, 0.8, 0.64)]
    true = (values[-1] - 7.0) / values[-1]
    trusting, careful = limit(sizes, values, 1e-3), limit(sizes, values, 1e-3, most=1.0)
    assert trusting.order == careful.order > 2.5
    assert trusting.error < 0.7 * true < true < careful.error
    slow = [7.0 + 0.3 * h**0.6 for h in SIZES]
    assert limit(SIZES, slow, 1e-3, most=1.0) == limit(SIZES, slow, 1e-3)


def test_the_energy_of_a_bot_is_that_of_its_parts() -> None:
    """All together it is the whole; where nothing but a junction's middle moves, it is the junction's.

    Catches: rings and junctions exchanged, elements of one region numbered in another.
    """
    design, mesh = committed_bot()
    model = SolidModel.from_design(design, mesh)
    x, _, z = model.system.space.points
    u = 0.002 * generator(3).normal(size=(3, x.size))
    parts = energy_parts(design, SolidState(model, Step(1.0, 0.0), u))
    assert sum(parts.values()) == pytest.approx(SolidState(model, Step(1.0, 0.0), u).energy, rel=1e-12)
    assert min(parts.values()) > 0.0
    middle = (np.abs(x) < 1.5) & (z < 2.0)
    parts = energy_parts(design, SolidState(model, Step(1.0, 0.0), u * middle))
    assert parts["junction_energy_uJ"] > 0.0
    assert parts["skeleton_energy_uJ"] == parts["ring_energy_uJ"] == 0.0


def test_energy_that_rings_move_is_told_with_theirs_left_out() -> None:
    """Rings go from 3.0 to 3.3 uJ and back to 3.0, the rest from 9.0 over 9.5 to 9.4: 1.1 % in place of 3.1 %.

    Catches: the first change for the last, the rings' own change told, other elements' rows, a line where all is well.
    """
    rings, rest = (3.0, 3.3, 3.0), (9.0, 9.5, 9.4)
    rows: list[dict[str, object]] = [
        {"element": "P2", "size_mm": h, "strain_energy_uJ": a + b, "ring_energy_uJ": a}
        for h, a, b in zip(SIZES, rings, rest, strict=True)
    ]
    rows.append({"element": "P1", "size_mm": 0.1, "strain_energy_uJ": 1.0, "ring_energy_uJ": 1.0})
    scattered = limit(SIZES, [a + b for a, b in zip(rings, rest, strict=True)], 0.01)
    settled = limit(SIZES, [12.4, 12.4, 12.4], 0.01)
    name = ("P2", "ring_energy_uJ")
    (told,) = energy_told(rows[::-1], {("P2", "strain_energy_uJ"): scattered, name: scattered}, "P2")
    assert told.startswith("P2, strain energy: 3 of 12.4 uJ are the rings'")
    assert told.endswith("its last change is 1.1 % in place of 3.1 %")
    assert energy_told(rows, {("P2", "strain_energy_uJ"): settled, name: scattered}, "P2") == []
    assert energy_told(rows, {("P2", "strain_energy_uJ"): scattered}, "P2") == []
    # what rings undo of the others' change is not theirs
    rows[2] |= {"strain_energy_uJ": 12.8, "ring_energy_uJ": 3.4}
    rows[1] |= {"strain_energy_uJ": 12.7, "ring_energy_uJ": 2.9}
    assert energy_told(rows, {("P2", "strain_energy_uJ"): scattered, name: scattered}, "P2") == []


def test_a_singular_stress_is_called_what_it_is() -> None:
    """Growing with the power of a re-entrant corner, and with the logarithm: neither has a limit.

    Catches: a limit made up from changes that do not shrink.
    """
    for values in ([h**-0.455 for h in SIZES], [-math.log(h) for h in (1.0, 0.5, 0.25)]):
        sizes = SIZES if values[0] == 1.0 else (1.0, 0.5, 0.25)
        found = limit(sizes, values, 0.01)
        assert found.verdict is Verdict.not_converging
        assert found.error == math.inf
        assert found.value == values[-1]


def test_alternating_values_get_a_wide_bar() -> None:
    """No order is read off them; the bar is three times the last change at first order.

    Catches: an order from changes of two signs, a bar of nothing.
    """
    found = limit((1.0, 0.5, 0.25), (1.0, 1.02, 1.01), 0.05)
    assert math.isnan(found.order)
    assert found.error == pytest.approx(3.0 * 0.01 / 1.01, rel=1e-9)
    assert found.verdict is Verdict.converged
    assert limit((1.0, 0.5, 0.25), (1.0, 1.02, 1.01), 0.02).verdict is Verdict.converging


def test_small_changes_that_do_not_shrink_decide_nothing() -> None:
    """Within twice the error asked for they may be the scatter of meshes: the bar is three times all of them, and no
    number is called diverging for it; beyond, it is.

    Catches: a number within a percent called worthless, the bar of one change, a slowly growing peak called converged.
    """
    found = limit((0.4532, 0.3524, 0.2682), (3.630, 3.656, 3.685), 0.01)
    assert found.verdict is Verdict.undecided
    assert found.error == pytest.approx(3.0 * 0.055 / 3.685, rel=1e-9)
    assert found.order < 0.25
    assert limit((0.4532, 0.3524, 0.2682), (3.630, 3.656, 3.685), 0.006).verdict is Verdict.not_converging
    assert limit((0.4532, 0.3524, 0.2682), (3.630, 3.656, 3.685), 0.05).verdict is Verdict.undecided


def test_meshes_too_much_alike_decide_nothing() -> None:
    """Three sizes within a factor of 1.5 tell no order, nor that anything diverges.

    Catches: the scatter of unstructured meshes taken for a singularity.
    """
    found = limit((1.0, 0.9, 0.8), (1.0, 1.01, 1.02), 0.01)
    assert found.verdict is Verdict.undecided
    assert math.isnan(found.order)
    assert limit((1.0, 0.9, 0.8), (1.0, 1.0, 1.0), 0.01).verdict is Verdict.converged
    # in the mean alone, as a graded mesh's are: where errors arise they differ by two
    read = limit((1.0, 0.9, 0.8), [1.0 + 0.1 * h**2 for h in (1.0, 0.9, 0.8)], 0.01, ratio=2.0)
    assert read.order == pytest.approx(2.0, rel=1e-6)
    assert limit((1.0, 0.5, 0.25), (1.0, 1.01, 1.012), 0.001, ratio=1.4).verdict is Verdict.undecided


@pytest.mark.parametrize(
    ("sizes", "values", "wanted"),
    [
        ((1.0, 0.5), (1.0, 1.0), 0.01),
        ((1.0, 0.5, 0.5), (1.0, 1.0, 1.0), 0.01),
        ((1.0, 0.5, 0.25), (1.0, np.nan, 1.0), 0.01),
        ((1.0, 0.5, 0.25), (1.0, 1.0, 1.0), 0.0),
    ],
)
def test_what_tells_nothing_is_refused(sizes: tuple[float, ...], values: tuple[float, ...], wanted: float) -> None:
    """Too few, sizes that do not fall, numbers that are none, no error asked for.

    Catches: a division by nothing.
    """
    with pytest.raises(ModelError, match="convergence: found"):
        limit(sizes, values, wanted)


def test_the_command_tells_what_each_number_tends_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A cantilever on three meshes: its deflection converges to the beam's, and the folder holds tables and a picture.

    Catches: the finest mesh first, an element that is asked for and not used.
    """
    out = tmp_path / "study"
    given = ["study", "convergence", "cantilever", "--sizes", "1.6,0.9,0.5", "--error", "0.03", "--out", str(out)]
    code = main(given)
    if code != 0 and "Gmsh" in capsys.readouterr().err:
        pytest.skip("Gmsh cannot start")
    assert code == 0
    found = json.loads((out / "summary.json").read_text())["convergence"]
    limits = {row["quantity"]: row for row in found["limits"]}
    assert limits["tip_deflection_mm"]["verdict"] in ("converged", "converging")
    assert limits["tip_deflection_mm"]["error_1"] < 0.1
    unknowns = [row["unknowns_1"] for row in found["rows"]]
    assert unknowns == sorted(unknowns)
    assert {row["element"] for row in found["rows"]} == {"P2"}
    for name in ("convergence_P2.png", "convergence_P2_local.png"):
        assert (out / "figures" / name).stat().st_size > 10_000
    assert '"labels":["at rest","P2 at 0.5 mm"]' in (out / "report.html").read_text(encoding="utf-8")
    assert main([*given, "--json"]) == 0


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--sizes", "1,0.5"], "three sizes"),
        (["--element", "Q2"], "P1, P2, P2-P1"),
        (["--error", "0"], "above 0"),
        (["--sizes", "1,x,2"], "--size"),
    ],
)
def test_bad_options_are_refused_in_one_line(
    options: list[str], word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, one line with what was expected, nothing written.

    Catches: a mesh made before the refusal.
    """
    assert main(["study", "convergence", "cantilever", "--out", str(tmp_path / "no"), *options]) == 2
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1
    assert word in told[0]
    assert not (tmp_path / "no").exists()
