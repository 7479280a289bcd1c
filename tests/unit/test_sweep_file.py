"""Files of sweeps: which cases they make, and what is refused in them."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from fem_biobot.config import digest, load_design
from fem_biobot.errors import DesignError, FileError
from fem_biobot.study.sweep_file import SweepPlan, read_sweep
from tests.command import ROOT

HEAD = 'base = "junction_bot"\ntask = "walk"\n'


def plan(folder: Path, text: str, head: str = HEAD) -> SweepPlan:
    file = folder / "some.toml"
    file.write_text(head + text)
    return read_sweep(file)


def test_grid_rows_and_order(tmp_path: Path) -> None:
    """A grid is every pair, the last key fastest; a list is rows; together every pair with every row.

    Catches: lists multiplied out, the first key fastest, degrees taken for radians.
    """
    found = plan(
        tmp_path,
        """
        [grid]
        muscle.theta = ["70 deg", "80 deg"]
        drive.frequency = { from = "1 Hz", to = "2 Hz", count = 3 }
        [list]
        muscle.passive_tension = ["3 kPa", "4 kPa"]
        skeleton.beam_thickness = ["0.7 mm", "600 um"]
        """,
    )
    assert found.varied == (
        "muscle.theta", "drive.frequency", "muscle.passive_tension", "skeleton.beam_thickness",
    )  # fmt: skip
    rows = [tuple(case.values.values()) for case in found.cases]
    angles = [math.radians(70.0), math.radians(80.0)]
    expected = [(a, f, *row) for a in angles for f in (1.0, 1.5, 2.0) for row in ((3.0, 0.7), (4.0, 0.6))]
    assert [case.number for case in found.cases] == list(range(1, 13))
    for row, wanted in zip(rows, expected, strict=True):
        assert row == pytest.approx(wanted, rel=1e-14)


def test_a_case_is_the_design_that_the_same_texts_give(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its digest is that of `--set`, [set] included; its key differs with task and version and not with the name.

    Catches: values set behind the reader's back, [set] forgotten, results of two versions taken for one another.
    """
    text = '[set]\nmesh.size = "2 mm"\n[grid]\nmuscle.theta = ["70 deg"]\n'
    walked = plan(tmp_path, text).cases[0]
    solved = plan(tmp_path, text, 'base = "junction_bot"\nname = "other"\ntask = "solve"\n').cases[0]
    assert walked.design is not None
    assert digest(walked.design) == digest(load_design("junction_bot", ["mesh.size=2 mm", "muscle.theta=70 deg"]))
    assert walked.design == solved.design
    assert walked.key != solved.key
    assert plan(tmp_path, text, 'name = "new"\n' + HEAD).cases[0].key == walked.key
    monkeypatch.setattr("fem_biobot.__version__", "9.9")
    assert plan(tmp_path, text).cases[0].key != walked.key


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube"])
def test_samples_fill_their_ranges_and_come_again(method: str, tmp_path: Path) -> None:
    """Every eighth of every range has one of eight points, the same with the same seed and others with another.

    Catches: plain random numbers, a seed that is not used, one sequence for all keys.
    """

    def points(seed: int) -> list[tuple[float, float]]:
        text = f'[sample]\nmethod = "{method}"\nseed = {seed}\ncount = 8\n[sample.over]\n'
        text += 'skeleton.material.young = ["200 kPa", "400 kPa"]\nmuscle.theta = ["60 deg", "100 deg"]\n'
        cases = plan(tmp_path, text).cases
        return [(c.values["skeleton.material.young"], math.degrees(c.values["muscle.theta"])) for c in cases]

    found = points(11)
    assert sorted(int((young - 200.0) / 25.0) for young, _ in found) == list(range(8))
    assert sorted(int((theta - 60.0) / 5.0) for _, theta in found) == list(range(8))
    assert points(11) == found
    assert points(12) != found
    assert [young / 200.0 for young, _ in found] != pytest.approx([(theta - 20.0) / 40.0 for _, theta in found])


def test_a_design_that_cannot_be_is_a_case_with_the_reason(tmp_path: Path) -> None:
    """The others stand; equal designs have one key.

    Catches: a sweep that ends with its first bad corner.
    """
    found = plan(tmp_path, '[grid]\nskeleton.beam_thickness = ["0.68 mm", "9 mm", "0.068 cm"]\n')
    good, bad, again = found.cases
    assert bad.design is None
    assert "skeleton.short_pillar_height" in bad.refused
    assert good.key == again.key != bad.key


def test_a_base_beside_the_file(tmp_path: Path) -> None:
    """A base that is no preset is looked for beside the sweep's file.

    Catches: the current folder.
    """
    (tmp_path / "mine.toml").write_text('base = "junction_bot"\n[mesh]\nsize = "2.5 mm"\n')
    found = plan(tmp_path, '[grid]\nmuscle.theta = ["70 deg"]\n', 'base = "mine.toml"\ntask = "solve"\n')
    assert found.base.mesh.size == 2.5


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "grid: missing, expected a section"),
        ("speed = 1\n", "speed: unknown key of a sweep"),
        ("[grid]\nmuscle.thetta = ['1 deg']\n", "grid.muscle.thetta: unknown key; did you mean muscle.theta?"),
        ("[grid]\nmuscle.theta = [80]\n", "grid.muscle.theta: found 80 (no unit)"),
        ("[grid]\nmuscle.theta = '80 deg'\n", 'grid.muscle.theta: found "80 deg", expected a list of values'),
        ("[grid]\nmuscle.theta = []\n", "grid.muscle.theta: found a list, expected a list of values"),
        ("[grid]\nmuscle.theta = { from = '1 deg', to = '2 deg' }\n", "grid.muscle.theta: found from, to"),
        (
            "[grid]\nmuscle.theta = { from = '2 deg', to = '1 deg', count = 3 }\n",
            'grid.muscle.theta: found "2 deg" to "1 deg", expected a range that rises',
        ),
        (
            "[grid]\nmuscle.theta = { from = '1 deg', to = '2 deg', count = 1 }\n",
            "grid.muscle.theta.count: found 1, expected a whole number of at least 2",
        ),
        ("[grid]\nmuscle.reference = ['moulded']\n", 'grid.muscle.reference: found "moulded", expected one of'),
        (
            "[grid]\nmuscle.reference = { from = 'a', to = 'b', count = 2 }\n",
            "grid.muscle.reference: found a range, expected one of a quantity only",
        ),
        ("[grid]\nskeleton.pillar_count = ['2']\n", 'grid.skeleton.pillar_count: found "2", expected a whole number'),
        ("[grid]\nname = ['a']\n", "grid.name: unknown key"),
        ("grid = 3\n", "grid: found 3, expected a section"),
        (
            "[list]\nmuscle.theta = ['1 deg', '2 deg']\ndrive.frequency = ['1 Hz']\n",
            "list: found 2 of muscle.theta, 1 of drive.frequency, expected as many values",
        ),
        (
            "[set]\nmuscle.theta = '1 deg'\n[grid]\nmuscle.theta = ['2 deg']\n",
            "grid.muscle.theta: found in [set] too, expected it in one section",
        ),
        ("sample = 3\n", "sample: found 3, expected a section"),
        ("[sample]\nmode = 'sobol'\n", "sample.mode: unknown key of a sample"),
        ("[sample]\nmethod = 'random'\n", 'sample.method: found "random", expected one of: latin_hypercube, sobol'),
        ("[sample]\nmethod = 'sobol'\n", "sample.seed: missing, expected a whole number of at least 0"),
        ("[sample]\nmethod = 'sobol'\nseed = 3\ncount = 0\n", "sample.count: found 0"),
        ("[sample]\nmethod = 'sobol'\nseed = 3\ncount = 12\n", "sample.count: found 12 with method sobol"),
        ("[sample]\nmethod = 'latin_hypercube'\nseed = 3\ncount = 200000\n", "expected at most 100000"),
        ("[sample]\nmethod = 'sobol'\nseed = 3\ncount = 8\n", "sample.over: missing"),
        (
            "[sample]\nmethod = 'sobol'\nseed = 3\ncount = 8\n[sample.over]\nmuscle.theta = ['1 deg']\n",
            "sample.over.muscle.theta: found a list, expected the two ends",
        ),
        (
            "[grid]\nmuscle.theta = { from = '1 deg', to = '9 deg', count = 1000 }\n"
            "drive.frequency = { from = '1 Hz', to = '2 Hz', count = 1000 }\n",
            "grid: found 1000000 cases, expected at most 100000",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(text: str, words: str, tmp_path: Path) -> None:
    """Section and key, what was found, what was expected.

    Catches: a check left out, a bare number taken for millimetres, a misspelt key that sweeps nothing.
    """
    with pytest.raises(DesignError) as error:
        plan(tmp_path, text)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_heads_that_are_wrong(tmp_path: Path) -> None:
    """No base, no task, another task, no file.

    Catches: a default that nobody asked for.
    """
    body = "[grid]\nmuscle.theta = ['2 deg']\n"
    for head, words in (
        ('task = "walk"\n', "base: missing, expected a preset"),
        ('base = "junction_bot"\n', "task: missing, expected one of: solve, walk, crosscheck"),
        ('base = "junction_bot"\ntask = "run"\n', 'task: found "run"'),
        ('base = "junction_bot"\nname = ""\ntask = "walk"\n', 'name: found "", expected a text'),
    ):
        with pytest.raises(DesignError) as error:
            plan(tmp_path, body, head)
        assert words in str(error.value)
    with pytest.raises(FileError, match="no such file or preset"):
        plan(tmp_path, body, 'base = "nothing.toml"\ntask = "walk"\n')
    with pytest.raises(FileError, match="cannot be read"):
        read_sweep(tmp_path / "absent.toml")


def test_the_example_of_the_readme_is_a_sweep(tmp_path: Path) -> None:
    """Its cases are as many as the text says, and all are designs.

    Catches: documentation of keys that are no more.
    """
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    blocks = [block.partition("```")[0] for block in text.split("```toml\n")[1:]]
    (example,) = [block for block in blocks if "task = " in block]
    found = plan(tmp_path, example, "")
    assert "here to 8 x 2 x 8 cases" in text
    assert len(found.cases) == 8 * 2 * 8
    assert all(case.design is not None for case in found.cases)
