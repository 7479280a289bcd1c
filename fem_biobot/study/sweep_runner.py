"""Who does the cases of a sweep: worker processes of this machine, each with one thread.

A worker is an interpreter of its own that reads orders from its standard input and answers on its standard output. It
ends with its parent, however that ends: a killed sweep leaves nothing behind that writes on.
"""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, Protocol, TypeVar

T = TypeVar("T")

# what keeps a worker to one thread, whatever was asked of this process
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
_LAST_WORDS = 10.0  # s, for a process that has closed its output to end
_PROGRAM = "from fem_biobot.study.sweep_worker import main; main()"


class Order(Protocol):
    """Something to do elsewhere; must be pickled."""

    def perform(self) -> dict[str, Any]:
        """Do it; the answer must be plain data."""
        ...


class Runner(Protocol):
    """Does orders in the background."""

    @property
    def capacity(self) -> int:
        """How many orders keep all workers busy."""
        ...

    def submit(self, name: str, order: Order) -> None:
        """Begin an order as soon as a worker is free."""
        ...

    def wait(self) -> list[tuple[str, dict[str, Any] | str]]:
        """Names and answers of orders that ended, one at least; in place of an answer why there is none."""
        ...

    def close(self) -> None:
        """End at once; orders under way are given up."""
        ...


def usable_processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def first_of(waiting: queue.SimpleQueue[T]) -> T:
    """What comes next out of a queue; not one wait for ever, which would not hear Ctrl-C on every system."""
    while True:
        try:
            return waiting.get(timeout=1.0)
        except queue.Empty:
            continue


class _Worker:
    """A worker process."""

    def __init__(self) -> None:
        root = str(Path(__file__).resolve().parents[2])
        paths = [root, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
        environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": os.pathsep.join(paths)}
        # a session of its own: Ctrl-C is for the parent, which ends its workers itself
        self.process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env=environment, start_new_session=True,
        )  # fmt: skip

    def do(self, order: Order) -> dict[str, Any] | str:
        """Answer to an order; why there is none where the worker ends over it."""
        to, back = self.process.stdin, self.process.stdout
        assert to is not None
        assert back is not None
        try:
            pickle.dump(order, to)
            to.flush()
            return pickle.load(back)
        except (EOFError, OSError, pickle.UnpicklingError):
            try:
                code = self.process.wait(_LAST_WORDS)
            except subprocess.TimeoutExpired:  # it lives and says what is no answer
                self.end()
                return "its worker process gave no answer that can be read"
            how = f"signal {-code}" if code < 0 else f"code {code}"
            return f"its worker process ended with {how}; is there enough memory for as many workers?"

    def end(self) -> None:
        """Kill the process."""
        self.process.kill()
        self.process.wait()


class LocalRunner:
    """Workers on this machine.

    Parameters
    ----------
    workers
        How many; by default as many as processors may be used.
    """

    def __init__(self, workers: int | None = None) -> None:
        self._count = workers or usable_processors()
        self._orders: queue.SimpleQueue[tuple[str, Order] | None] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[tuple[str, dict[str, Any] | str]] = queue.SimpleQueue()
        self._lock, self._workers, self._closed = threading.Lock(), set[_Worker](), False
        for _ in range(self._count):
            threading.Thread(target=self._serve, daemon=True).start()

    @property
    def capacity(self) -> int:
        """As many orders as workers."""
        return self._count

    def submit(self, name: str, order: Order) -> None:
        """See `Runner`."""
        self._orders.put((name, order))

    def wait(self) -> list[tuple[str, dict[str, Any] | str]]:
        """See `Runner`."""
        found = [first_of(self._answers)]
        while not self._answers.empty():
            found.append(self._answers.get())
        return found

    def close(self) -> None:
        """See `Runner`."""
        with self._lock:
            self._closed = True
            workers = list(self._workers)
        for _ in range(self._count):
            self._orders.put(None)
        for worker in workers:
            worker.end()

    def _serve(self) -> None:
        """Hand orders to one worker, which is replaced when it dies."""
        worker: _Worker | None = None
        while (item := self._orders.get()) is not None:
            name, order = item
            with self._lock:
                if self._closed:
                    return
                if worker is None:
                    worker = _Worker()
                    self._workers.add(worker)
            answer = worker.do(order)
            if isinstance(answer, str):
                with self._lock:
                    self._workers.discard(worker)
                worker = None
            self._answers.put((name, answer))
