"""Calls in a process of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from fem_biobot.apart import Helper, ProcessDiedError
from fem_biobot.errors import MeshError
from tests.command import ROOT, environment


@pytest.fixture
def helper():
    """A helper that is ended after the test."""
    found = Helper()
    yield found
    found.close()


def test_answers_come_from_one_process_that_is_not_ours(helper: Helper) -> None:
    """The helper is another process, and the same at the next call.

    Catches: calls made in place, a process a call.
    """
    first, second = helper.call(os.getpid), helper.call(os.getpid)
    assert first == second != os.getpid()


def test_arrays_come_back_unchanged(helper: Helper) -> None:
    """A result survives the way through the pipe, more than a pipe holds.

    Catches: text mode, answers cut at the pipe's size.
    """
    given = np.random.default_rng(3).normal(size=(3, 50_000))
    assert np.array_equal(helper.call(np.negative, given), -given)


def refuses(text: str) -> None:
    """Raise what a mesh generator would."""
    raise MeshError(text)


def test_what_a_function_raises_is_raised(helper: Helper) -> None:
    """An error keeps its class and text, and the helper goes on.

    Catches: errors taken for deaths.
    """
    with pytest.raises(MeshError, match="no volume"):
        helper.call(refuses, "no volume")
    assert helper.call(abs, -3) == 3


def test_what_a_function_prints_is_no_answer(helper: Helper) -> None:
    """Printing does not get between the answers, not even from compiled code.

    Catches: answers on the standard output that libraries print to.
    """
    assert helper.call(os.write, 1, b"Info : meshing\n") == 15
    assert helper.call(print, "text") is None
    assert helper.call(abs, -3) == 3


@pytest.mark.parametrize(("end", "said"), [(os.abort, "SIGABRT"), (lambda: None, "")], ids=["signal", "lambda"])
def test_a_death_is_told_and_followed_by_another_helper(helper: Helper, end, said: str) -> None:
    """A process that dies is named by its signal; what cannot be sent is refused before one starts.

    Catches: a caller that waits for ever, a helper that stays dead.
    """
    if not said:
        with pytest.raises(Exception, match="pickle"):
            helper.call(end)
        return
    with pytest.raises(ProcessDiedError, match=said):
        helper.call(end)
    assert helper.call(abs, -3) == 3


def test_an_exit_is_a_death_with_its_status(helper: Helper) -> None:
    """A library that exits is told by its status.

    Catches: a status taken for a signal.
    """
    with pytest.raises(ProcessDiedError, match="exit status 7"):
        helper.call(os._exit, 7)


def test_threads_wait_for_each_other(helper: Helper) -> None:
    """Answers go to those who asked.

    Catches: two threads on one pipe.
    """
    found: dict[int, int] = {}

    def ask(number: int) -> None:
        for _ in range(20):
            found[number] = helper.call(abs, -number)

    threads = [threading.Thread(target=ask, args=(n,)) for n in range(1, 5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {n: n for n in range(1, 5)}


def test_a_script_without_a_guard_is_not_run_again(tmp_path) -> None:
    """A plain script, as in the README, calls apart once, and its helper ends with it.

    Catches: processes that import the caller's script and start over; helpers left behind.
    """
    script = tmp_path / "plain.py"
    script.write_text("import os\nfrom fem_biobot.apart import Helper\nprint(Helper().call(os.getpid))\n")
    done = subprocess.run(
        [sys.executable, str(script)], cwd=ROOT, env=environment(), capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.split()
    with pytest.raises(ProcessLookupError):
        os.kill(int(line), 0)
