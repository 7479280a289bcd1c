"""Calls in a Python process of their own, for libraries that may bring down the one they run in.

Gmsh now and then ends its process by a signal (a broken heap, a failed assertion); nothing in Python can catch that.
Here only a helper dies, and the caller is told. The helper is started at the first call and serves all later ones. It
is given the caller's module path, not the caller's script, so that scripts need no ``if __name__ == "__main__"``.
"""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import weakref
from collections.abc import Callable
from typing import IO, Any, TypeVar

Result = TypeVar("Result")

_START = "import sys, json; sys.path[:] = json.loads(sys.argv[1]); from fem_biobot.apart import serve; serve()"
_PATIENCE = 5.0  # seconds for a helper that stopped answering to end by itself


class ProcessDiedError(Exception):
    """The helper ended in the middle of a call; the text says how."""


class Helper:
    """A process that calls functions for us, one at a time.

    Functions must be found by name in a module, and arguments and results must be picklable. What a function raises
    is raised here.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._said: IO[bytes] | None = None
        self._owner = 0

    def call(self, function: Callable[..., Result], *arguments: object) -> Result:
        """``function(*arguments)``, computed by the helper.

        Raises
        ------
        ProcessDiedError
            The helper died; the next call starts another.
        """
        request = pickle.dumps((function, arguments))
        with self._lock:
            process = self._running()
            assert process.stdin is not None
            assert process.stdout is not None
            try:
                process.stdin.write(request)
                process.stdin.flush()
                done, found = pickle.load(process.stdout)
            except (EOFError, pickle.UnpicklingError, BrokenPipeError):
                raise ProcessDiedError(self._ending(process)) from None
            except BaseException:  # an interrupt: its answer would be taken for that of the next call
                self._stop(process)
                raise
        if not done:
            raise found
        return found

    def close(self) -> None:
        """End the helper; the next call starts another."""
        with self._lock:
            if self._process is not None:
                self._stop(self._process)

    def _running(self) -> subprocess.Popen[bytes]:
        # after a fork the pipes are the parent's
        if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
            self._said = tempfile.TemporaryFile()  # noqa: SIM115  (lives as long as the helper)
            self._process = subprocess.Popen(
                [sys.executable, "-c", _START, json.dumps(sys.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
            )
            self._owner = os.getpid()
            weakref.finalize(self, _end, self._process, self._owner)
        return self._process

    def _ending(self, process: subprocess.Popen[bytes]) -> str:
        try:
            code = process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._stop(process)
            return "it stopped answering"
        how = _signal_name(-code) if code < 0 else f"exit status {code}"
        said = self._last_line()
        self._process = None
        return f"it ended by {how}" + (f" ({said})" if said else "")

    def _last_line(self) -> str:
        if self._said is None:
            return ""
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").strip().splitlines()
        return lines[-1].strip() if lines else ""

    def _stop(self, process: subprocess.Popen[bytes]) -> None:
        process.kill()
        process.wait()
        self._process = None


def _end(process: subprocess.Popen[bytes], owner: int) -> None:
    """End a helper whose caller is gone or going; a fork of the caller leaves it alone."""
    if owner == os.getpid() and process.poll() is None:
        process.kill()
        process.wait()


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def serve() -> None:
    """Answer calls from the standard input until it ends; what libraries print goes to the standard error."""
    # Ctrl-C goes to the whole group of processes: it is the caller's, who ends this one
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    while True:
        try:
            function, arguments = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        answer: tuple[bool, Any]
        try:
            answer = True, function(*arguments)
        except Exception as error:
            answer = False, error
        pickle.dump(answer, answers)
        answers.flush()
