"""The result folder: whose it is, when it is whole, what is kept to go on from."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fem_biobot.errors import FileError
from fem_biobot.solid.interface.state import Touch
from fem_biobot.solid.records import Step
from fem_biobot.study.folder import ResultFolder

JOB = {"kind": "run", "design_digest": "aaaa", "mesh": "generated"}
TOUCH = Touch(np.eye(3), np.array([0, 2, 1]), 0.1 * np.eye(3), np.array([4, -1]), np.ones((2, 3)))


def found(key: str, u: np.ndarray) -> SimpleNamespace:
    state = SimpleNamespace(
        u=u,
        step=Step(1.0, 0.37),
        residual=3e-11,
        newton_iterations=4,
        factorisations=2,
        cg_iterations=17,
        pressure=None if key == "passive" else u[0],
        touch=None if key == "passive" else TOUCH,
    )
    return SimpleNamespace(wanted=SimpleNamespace(key=key), state=state, natural_stretch=0.83)


def test_a_saved_state_reads_back_exactly(tmp_path: Path) -> None:
    """What was saved comes back bit for bit, with its step and its work.

    Catches: saving in single precision, swapping load and tension, a mixed state without its pressures, a sliding
    one without its contact.
    """
    folder = ResultFolder(tmp_path / "out", JOB)
    folder.open()
    u = np.random.default_rng(11).standard_normal((3, 7))
    folder.save(found("passive", u))  # type: ignore[arg-type]
    saved = folder.saved("passive")
    assert saved is not None
    assert np.array_equal(saved.u, u)
    assert saved.step == Step(1.0, 0.37)
    assert saved.natural_stretch == 0.83
    assert saved.work == {"residual": 3e-11, "newton": 4.0, "factorisations": 2.0, "cg": 17.0}
    assert saved.pressure is None
    assert saved.touch is None
    assert folder.saved("peak") is None
    folder.save(found("peak", u))  # type: ignore[arg-type]
    mixed = folder.saved("peak")
    assert mixed is not None
    assert mixed.pressure is not None
    assert np.array_equal(mixed.pressure, u[0])
    assert mixed.touch is not None
    for ours, theirs in zip(mixed.touch, TOUCH, strict=True):
        assert np.array_equal(ours, theirs)
        assert ours.dtype == theirs.dtype


def test_a_whole_result_is_found_again_and_an_unfinished_one_is_not(tmp_path: Path) -> None:
    """A folder counts as whole only after `close`, and only for the same job.

    Catches: reusing a partial summary, or the result of `solve` for `run`.
    """
    folder = ResultFolder(tmp_path / "out", JOB)
    assert folder.whole_result() is None
    folder.open()
    assert folder.whole_result() is None
    summary = {"complete": True, "job": JOB, "design_digest": "aaaa", "x": 1}
    folder.close(summary)
    assert folder.whole_result() == summary
    assert not folder.unfinished.exists()
    assert ResultFolder(tmp_path / "out", {**JOB, "kind": "solve"}).whole_result() is None


@pytest.mark.parametrize(
    ("other", "word"),
    [({"design_digest": "bbbb"}, "another design"), ({"mesh": "mine.msh 0123"}, "another mesh")],
)
def test_another_result_is_refused_and_left_alone(tmp_path: Path, other: dict[str, str], word: str) -> None:
    """A folder with another design's (or mesh's) result is refused in one line and stays as it is.

    Catches: comparing only that a summary exists.
    """
    path = tmp_path / "out"
    first = ResultFolder(path, JOB)
    first.open()
    first.close({"complete": True, "job": JOB, "design_digest": "aaaa"})
    before = {p: p.read_bytes() for p in path.rglob("*") if p.is_file()}
    with pytest.raises(FileError, match=word) as refusal:
        ResultFolder(path, {**JOB, **other}).whole_result()
    assert "\n" not in str(refusal.value)
    assert {p: p.read_bytes() for p in path.rglob("*") if p.is_file()} == before


def test_an_unfinished_result_of_another_design_is_refused(tmp_path: Path) -> None:
    """The beginnings of another design count as its result.

    Catches: looking at summary.json only.
    """
    ResultFolder(tmp_path / "out", JOB).open()
    with pytest.raises(FileError, match="another design"):
        ResultFolder(tmp_path / "out", {**JOB, "design_digest": "bbbb"}).whole_result()


def test_foreign_files_are_refused_also_by_force(tmp_path: Path) -> None:
    """A folder with files that are not ours is never written into, not even by force.

    Catches: clearing whatever folder is named.
    """
    (tmp_path / "thesis.txt").write_text("years of work")
    folder = ResultFolder(tmp_path, JOB)
    with pytest.raises(FileError, match="no result of this program"):
        folder.whole_result()
    with pytest.raises(FileError, match="no result of this program"):
        folder.clear()
    assert (tmp_path / "thesis.txt").read_text() == "years of work"


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    """A plain file where the folder should be is named.

    Catches: an OSError escaping from mkdir.
    """
    (tmp_path / "out").write_text("")
    with pytest.raises(FileError, match="expected a folder"):
        ResultFolder(tmp_path / "out", JOB).whole_result()


def test_states_of_another_job_are_not_gone_on_with(tmp_path: Path) -> None:
    """Opening a folder for another job (as --force does) drops the states of the one before.

    Catches: resuming `run` from states of another design.
    """
    folder = ResultFolder(tmp_path / "out", JOB)
    folder.open()
    folder.save(found("passive", np.zeros((3, 2))))  # type: ignore[arg-type]
    other = ResultFolder(tmp_path / "out", {**JOB, "design_digest": "bbbb"})
    other.open()
    assert other.saved("passive") is None


def test_damaged_files_of_ours_are_named(tmp_path: Path) -> None:
    """A state or a summary cut short is refused with its name and the way out.

    Catches: a traceback from the zip or JSON reader.
    """
    folder = ResultFolder(tmp_path / "out", JOB)
    folder.open()
    folder.save(found("passive", np.zeros((3, 20))))  # type: ignore[arg-type]
    state = folder.unfinished / "passive.npz"
    state.write_bytes(state.read_bytes()[:-40])
    with pytest.raises(FileError, match=r"passive\.npz.*--force"):
        folder.saved("passive")
    folder.close({"complete": True, "job": JOB})
    (folder.path / "summary.json").write_text(json.dumps(JOB)[:-4])
    with pytest.raises(FileError, match=r"summary\.json"):
        folder.whole_result()
