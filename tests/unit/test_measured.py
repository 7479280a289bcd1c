"""Measured deflections: the file, and tension and modulus found in it, with intervals."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.cli import main
from fem_biobot.config import load_design
from fem_biobot.errors import FileError, ModelError
from fem_biobot.link import inverse
from fem_biobot.link.at_load import LoadedRods
from fem_biobot.link.inverse import Deflections, estimate, scaled
from fem_biobot.link.measured import Measured, read_measured
from fem_biobot.link.observed import Array
from fem_biobot.link.sections import MeshSections, closed_forms
from fem_biobot.link.valley import valley
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.muscle.waveforms import drive_function
from fem_biobot.rod.reduce import reduce
from fem_biobot.study.measured import sought
from tests.helpers import generator

DESIGN = load_design("junction_bot")
YOUNG = np.array([100.0, 150.0, 220.0, 330.0, 480.0, 700.0, 1000.0])
TENSION = np.linspace(2.0, 18.0, 9)


def _closing(young: Array | float, tension: Array) -> Array:
    """Two springs in parallel, and a tissue that stiffens: like the machine, in closed form."""
    return tension * 0.88 / (0.0065 * young + 1.26 + 0.08 * tension)


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch) -> Deflections:
    monkeypatch.setattr(inverse, "_DRAWS", 3)
    E, T = np.meshgrid(YOUNG, TENSION, indexing="ij")
    c = _closing(E, T)
    return Deflections(YOUNG, TENSION, c, 0.25 * c, 0.0065 * E * c)


def _file(folder: Path, text: str) -> Path:
    path = folder / "data.csv"
    path.write_text(text)
    return path


def test_units_and_separators_are_those_of_the_header(tmp_path: Path) -> None:
    """Micrometres, underscores, semicolons, percent; columns in any order.

    Catches: a unit that is read and not used, columns by position.
    """
    found = read_measured(_file(tmp_path, "sagitta_um;drive [%];deviation (um)\n250;50;10\n300;100;20\n"), DESIGN)
    assert found.quantity == "sagitta"
    np.testing.assert_allclose(found.value, [0.25, 0.3], rtol=1e-14)
    np.testing.assert_allclose(found.drive, [0.5, 1.0], rtol=1e-14)
    assert found.deviation is not None
    np.testing.assert_allclose(found.deviation, [0.01, 0.02], rtol=1e-14)
    forced = read_measured(_file(tmp_path, "drive,stroke [mm],force [uN]\n0.2,0.1,300\n"), DESIGN)
    assert forced.quantity == "stroke"
    assert forced.force is not None
    assert forced.force[0] == pytest.approx(0.3, rel=1e-14)
    assert forced.deviation is None


def test_times_become_drives_by_the_waveform(tmp_path: Path) -> None:
    """Milliseconds into the design's own drive.

    Catches: times taken for drives, another frequency.
    """
    found = read_measured(_file(tmp_path, "time [ms],closing [mm]\n0,1\n130,1.2\n"), DESIGN)
    drive = drive_function(DESIGN.drive)
    np.testing.assert_allclose(found.drive, [drive(0.0), drive(0.13)], rtol=1e-12)
    assert found.drive[1] == pytest.approx(abs(np.sin(np.pi * 2.0 * 0.13)), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "found nothing"),
        ("drive,closing [mm]\n", "header alone"),
        ("drive,closing\n0,1\n", "line 1, column closing"),
        ("drive,closing [kPa]\n0,1\n", "line 1, column closing"),
        ("drive,length [mm]\n0,1\n", "column 'length \\[mm\\]'"),
        ("drive,closing [mm],sagitta [mm]\n0,1,1\n", "found columns drive, closing, sagitta"),
        ("closing [mm]\n1\n", "found columns closing"),
        ("drive,drive,closing [mm]\n0,0,1\n", "two columns of drive"),
        ("drive,closing [mm]\n0,1\n0.5\n", "line 3: found 1 columns"),
        ("drive,closing [mm]\n0,1\n0.5,much\n", "line 3, closing"),
        ("drive,closing [mm]\n0,nan\n", "line 2, closing"),
        ("drive,closing [mm],deviation [mm]\n0,1,0\n", "line 2: found a deviation"),
        ("drive,closing [mm]\n0,1\n-0.5,1\n", "line 3: found a drive"),
        ("drive,closing [mm],forcedeviation [mN]\n0,1,1\n", "none else"),
        ("drive,closing [mm],deviation [mm],force [mN]\n0,1,1,1\n", "with force one of force too"),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path: Path, text: str, words: str) -> None:
    """Each with the file's name, the line, what was found and what was expected.

    Catches: a row that is skipped silently, a number without its unit.
    """
    with pytest.raises(FileError, match=words) as refused:
        read_measured(_file(tmp_path, text), DESIGN)
    assert "data.csv" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_that_cannot_be_read_is_told_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Missing, and of bytes that are no text, by the command, before anything is meshed; `--fit` alone too.

    Catches: a traceback, a folder left behind.
    """
    binary = tmp_path / "picture.csv"
    binary.write_bytes(b"\xff\xfe\x00drive")
    out = tmp_path / "out"
    for options, word in (
        (["--measured", str(tmp_path / "none.csv")], "cannot be read"),
        (["--measured", str(binary)], "no text"),
        (["--fit", "stiffness"], "--fit: found without --measured"),
    ):
        assert main(["crosscheck", "junction_bot", "--out", str(out), *options]) == 2
        told = capsys.readouterr().err.strip().splitlines()
        assert len(told) == 1
        assert word in told[0]
        assert not out.exists()
    large = tmp_path / "large.csv"
    large.write_text("drive,closing [mm]\n" + "0,1\n" * 1_300_000)
    with pytest.raises(FileError, match="at most"):
        read_measured(large, DESIGN)


@pytest.mark.parametrize("quantity", ["closing", "sagitta", "stroke"])
def test_what_data_were_made_with_is_found(table: Deflections, quantity: str) -> None:
    """Without noise, tension and modulus of data from the springs themselves, by each quantity with a force.

    The table is between its nodes a cubic: 1e-3 of a smooth curve on this grid.

    Catches: a stroke from the drawing, force and deflection exchanged, modulus and tension exchanged.
    """
    drive = np.array([0.0, 0.3, 0.6, 1.0])
    E, passive, active = 410.0, 7.7, 2.1
    T = passive + drive * active
    value = {"closing": _closing(E, T), "sagitta": 0.25 * _closing(E, T)}
    value["stroke"] = value["closing"] - _closing(E, np.array(passive))
    deviation = np.full(4, 1e-3)
    data = Measured(drive, quantity, value[quantity], deviation, 0.0065 * E * _closing(E, T), deviation)
    found = estimate(DESIGN, data, table, ("passive", "active", "stiffness"))
    np.testing.assert_allclose(found.value, [passive, active, E], rtol=2e-3)
    assert (found.passive, found.active, found.young) == tuple(found.value)


def test_intervals_hold_the_truth_as_often_as_they_say(table: Deflections) -> None:
    """Of 80 sets of data with noise, 95 % of both intervals, within what chance allows (three deviations: 7 %).

    Catches: a variance for a deviation, Student's t with the wrong freedom, a covariance of scaled parameters.
    """
    draw, drive = generator(29), np.linspace(0.0, 1.0, 6)
    truth = np.array([8.2, 1.6])
    clean = table.at("closing", 319.4, truth[0] + drive * truth[1])
    for given in (True, False):
        inside = np.zeros(2)
        for _ in range(80):
            noisy = clean + 0.01 * draw.normal(size=6)
            data = Measured(drive, "closing", noisy, np.full(6, 0.01) if given else None)
            found = estimate(DESIGN, data, table, ("passive", "active"))
            inside += (found.low <= truth) & (truth <= found.high)
        assert np.all(np.abs(inside / 80 - 0.95) < 0.07), f"{inside / 80}"


def test_draws_agree_with_the_covariance_where_the_model_is_straight(
    table: Deflections, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One parameter, small noise: percentiles of 200 refits, within what so many tell of a spread (15 %).

    Catches: draws about the data and not the fit, noise of another size.
    """
    monkeypatch.setattr(inverse, "_DRAWS", 200)
    drive = np.linspace(0.0, 1.0, 5)
    clean = table.at("closing", 350.0, 9.09 + 1.3 * drive)
    found = estimate(DESIGN, Measured(drive, "closing", clean, np.full(5, 0.01)), table, ("stiffness",))
    assert found.value[0] == pytest.approx(350.0, rel=1e-6)
    wide, drawn = found.high[0] - found.low[0], found.drawn[1, 0] - found.drawn[0, 0]
    assert drawn == pytest.approx(wide, rel=0.15)


def test_one_tension_keeps_the_ratio_of_the_design(table: Deflections) -> None:
    """Passive and active by one number, and what is told is the passive one.

    Catches: a tension that leaves the active one behind.
    """
    drive = np.array([0.0, 0.5, 1.0])
    clean = table.at("closing", 319.4, 0.8 * (9.09 + 1.30 * drive))
    found = estimate(DESIGN, Measured(drive, "closing", clean, np.full(3, 0.01)), table, ("tension",))
    assert found.value[0] == pytest.approx(0.8 * 9.09, rel=1e-6)
    assert found.active == pytest.approx(0.8 * 1.30, rel=1e-6)


def test_what_cannot_be_found_is_refused(table: Deflections) -> None:
    """Names that do not go together, too few rows, an estimate at the edge of the grid, drives that tell nothing.

    Catches: an interval from a singular matrix, an estimate that is a bound.
    """
    drive = np.array([0.0, 0.5, 1.0])
    data = Measured(drive, "closing", table.at("closing", 319.4, 9.09 + 1.3 * drive), np.full(3, 0.01))
    for names in ((), ("tension", "passive"), ("age",)):
        with pytest.raises(ModelError, match="fit: found"):
            estimate(DESIGN, data, table, names)
    with pytest.raises(ModelError, match="found 1 numbers, expected at least 2"):
        estimate(DESIGN, Measured(drive[:1], "closing", data.value[:1]), table, ("stiffness",))
    with pytest.raises(ModelError, match="fit: found stiffness"):
        estimate(DESIGN, Measured(drive, "closing", 5.0 * data.value, data.deviation), table, ("stiffness",))
    still = Measured(np.zeros(3), "closing", data.value[[0, 0, 0]], data.deviation)
    with pytest.raises(ModelError, match=r"do not tell passive and active apart|fit: found active"):
        estimate(DESIGN, still, table, ("passive", "active"))


def test_deflections_alone_determine_a_ratio(table: Deflections) -> None:
    """Of data from a gel 1.4 times as stiff: its tension over the power of its modulus is found with the design's.

    Two springs in parallel give the power: of ``T A = d (k_b + k_m)`` at one deflection, ``k_b / (k_b + k_m)``. Every
    modulus fits data with a tenth of noise; few fit precise data of springs that stiffen with the squared tension,
    which can be told from stiffer ones under more.

    Catches: the power of the inverse, an interval of the modulus from one tension, moduli that never drop out.
    """
    drive, E, passive, active = np.linspace(0.0, 1.0, 5), 1.4 * 319.4, 6.0, 1.5
    value = _closing(E, passive + drive * active)
    found = valley(DESIGN, Measured(drive, "closing", value, 0.1 * value), table, ("passive", "active"))
    k_b = 0.0065 * 1.2 * 319.4
    assert found.exponent == pytest.approx(k_b / (k_b + 1.26), abs=0.05)
    assert found.value * 1.4**found.exponent == pytest.approx(passive, rel=0.02)
    assert found.low < found.value < found.high
    assert found.fits.all()
    assert found.open == (True, True)
    far = np.linspace(0.0, 7.0, 12)

    def bending(young: Array | float, tension: Array) -> Array:
        return tension * 0.88 / (0.0065 * young + 1.26 + 0.02 * tension**2)

    grid = np.meshgrid(YOUNG, TENSION, indexing="ij")
    other = replace(table, closing=bending(grid[0], grid[1]))
    sharp = Measured(far, "closing", bending(E, 0.6 * (9.09 + far * 1.30)), np.full(12, 2e-3))
    narrow = valley(DESIGN, sharp, other, ("tension",))
    assert narrow.span[0] <= E <= narrow.span[1]
    assert narrow.open == (False, False)
    forced = Measured(drive, "closing", value, 0.1 * value, value, 0.1 * value)
    for data, names in ((forced, ("passive",)), (sharp, ("stiffness",))):
        with pytest.raises(ModelError, match="expected tensions from deflections alone"):
            valley(DESIGN, data, table, names)
    with pytest.raises(ModelError, match="fit: found"):
        valley(DESIGN, Measured(drive, "closing", 9.0 * value), table, ("passive",))


def test_what_is_sought_follows_from_the_data() -> None:
    """Everything with a force; else tensions and modulus each by itself; no active tension from one drive.

    Catches: a fit of more than data can tell.
    """
    many, one = np.array([0.0, 1.0]), np.zeros(2)
    assert sought(Measured(many, "closing", many)) == [("passive", "active"), ("stiffness",)]
    assert sought(Measured(one, "closing", many)) == [("passive",), ("stiffness",)]
    assert sought(Measured(many, "closing", many, force=many)) == [("passive", "active", "stiffness")]


def test_a_stiffer_gel_scales_every_section() -> None:
    """Moments and stiffnesses, not curvatures.

    Catches: a stiffness that keeps the old modulus.
    """
    closed = closed_forms(DESIGN)
    bent = np.linspace(0.0, 0.1, 3)[:, None] * np.ones(16)
    found = scaled(
        MeshSections(closed, closed, bent, 60.0 * bent, 0.1 * bent[:, :2], np.array([70.0, 71.0, 74.0])), 2.0
    )
    other = closed_forms(DESIGN.with_values({"skeleton.material.young": 2.0 * 319.4}))
    for name in ("EI", "EI_lateral", "GJ", "EA", "GA", "GA_lateral", "EI_along"):
        np.testing.assert_allclose(getattr(found.mesh, name), getattr(other, name), rtol=1e-12)
    np.testing.assert_array_equal(found.curvatures, bent)
    np.testing.assert_allclose(found.moments, 120.0 * bent)
    np.testing.assert_allclose(found.torsion, [140.0, 142.0, 148.0])
    np.testing.assert_array_equal(found.roots, 0.1 * bent[:, :2])


def test_rods_that_go_too_short_a_way_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three of eight tensions reached, where a cubic needs four.

    Catches: a table of a few states, an error from the interpolation.
    """
    closed = closed_forms(DESIGN)
    bent = np.linspace(0.0, 0.1, 3)[:, None] * np.ones(16)
    sections = MeshSections(closed, closed, bent, 60.0 * bent, 0.1 * bent[:, :2], np.full(3, 70.0))
    rods = LoadedRods(DESIGN, reduce(DESIGN), sections, None, mesh_for(DESIGN)[0])
    monkeypatch.setattr(LoadedRods, "states", lambda *_: ([None] * 3, []))
    with pytest.raises(ModelError, match="alone, expected more to fit with"):
        inverse.deflections(DESIGN, rods)


@pytest.mark.slow
def test_a_file_gives_tension_and_modulus_by_the_command(tmp_path: Path) -> None:
    """Closing of the machine's own solid at 10.39 and 9.09 kPa with the force: tension and modulus that it has, to 5 %.

    Catches: rods of another machine, deflections of another quantity, files that are not written.
    """
    from fem_biobot.link.solid_side import SolidSide
    from fem_biobot.study.reporter import Silent

    design = DESIGN.with_values({"mesh.size": 2.0})
    drive = (0.0, 0.5, 1.0)
    states = SolidSide(design, mesh_for(design)[0]).states([design.tension(d) for d in drive], Silent())[0]
    lines = [
        f"{d},{s.numbers['tip_closing_mm']:.6f},0.02,{s.numbers['muscle_force_mN']:.6f},0.05"
        for d, s in zip(drive, states, strict=True)
    ]
    file = _file(tmp_path, "\n".join(["drive,closing [mm],deviation [mm],force [mN],forcedeviation [mN]", *lines]))
    out = tmp_path / "out"
    options = ["--measured", str(file), "--fit", "tension", "--fit", "stiffness", "--out", str(out), "--quiet"]
    assert main(["crosscheck", "junction_bot", "--size", "2.0", *options]) == 0
    (answer,) = json.loads((out / "summary.json").read_text())["measured"]["answers"]
    assert answer["passive_tension_kPa"] == pytest.approx(9.09, rel=0.05)
    assert answer["young_kPa"] == pytest.approx(319.4, rel=0.05)
    assert (out / "figures" / "measured.png").stat().st_size > 10_000
    assert (out / "tables" / "measured.csv").is_file()
