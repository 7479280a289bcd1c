"""What tests of sweeps share: small sweeps, a runner in this process, orders that workers can be asked."""

from __future__ import annotations

import os
import signal
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from fem_biobot.solid import products, sharing
from fem_biobot.solid.linear import pardiso_missing
from fem_biobot.study.sweep_runner import Order

WALKS = """
base = "junction_bot"
task = "walk"

[set]
drive.duration = "0.5 s"
muscle.active_tension = "2.7 kPa"

[grid]
muscle.passive_tension = [{tensions}]
skeleton.beam_thickness = [{thicknesses}]
"""


def walks(folder: Path, tensions: str = '"0.9 kPa", "1.7 kPa"', thicknesses: str = '"0.68 mm", "9 mm"') -> Path:
    """File of a sweep of short walks; a beam of 9 mm has no room for its pillars."""
    file = folder / "walks.toml"
    file.write_text(WALKS.format(tensions=tensions, thicknesses=thicknesses))
    return file


@dataclass
class Inline:
    """Does orders one by one in this process, the latest first, and remembers their names."""

    capacity: int = 3
    names: list[str] = field(default_factory=list)
    closed: bool = False
    waiting: list[tuple[str, Order]] = field(default_factory=list)

    def submit(self, name: str, order: Order) -> None:
        """Remember it."""
        self.names.append(name)
        self.waiting.append((name, order))

    def wait(self) -> list[tuple[str, dict[str, Any] | str]]:
        """Do the latest."""
        name, order = self.waiting.pop()
        return [(name, order.perform())]

    def close(self) -> None:
        """Remember that."""
        self.closed = True


@dataclass(frozen=True)
class Dies:
    """An order over which its worker is killed."""

    def perform(self) -> dict[str, Any]:
        """Kill the process."""
        os.kill(os.getpid(), signal.SIGKILL)
        return {}


@dataclass(frozen=True)
class Mumbles:
    """An order whose worker says something else on the way of its answers, and lives on."""

    def perform(self) -> dict[str, Any]:
        """Write to whatever is open for answers, and sleep."""
        for number in range(3, 64):
            with suppress(OSError):
                if stat.S_ISFIFO(os.fstat(number).st_mode):
                    os.write(number, b"no pickle at all\n")
        time.sleep(60.0)
        return {}


@dataclass(frozen=True)
class Says:
    """An order that tells of its process, and prints to standard output, which is for answers alone."""

    word: str

    def perform(self) -> dict[str, Any]:
        """The word, the process, and how many threads it may use."""
        print("not an answer", flush=True)  # noqa: T201
        os.write(1, b"nor this")
        return {"word": self.word, "pid": os.getpid(), "threads": os.environ["OMP_NUM_THREADS"]}


@dataclass(frozen=True)
class Fails:
    """An order that ends in an error of its own."""

    def perform(self) -> dict[str, Any]:
        """Fail."""
        raise OSError("no such luck")


@contextmanager
def one_thread() -> Iterator[None]:
    """Cases done in this process have one thread each, as those of workers: sums of two differ in their last digit."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (sharing, products):
            patch.setattr(module, "usable_threads", lambda: 1)
        if pardiso_missing() is not None:
            yield
            return
        from pypardiso.pardiso_wrapper import PyPardisoSolver

        mkl = PyPardisoSolver().libmkl
        before = mkl.MKL_Get_Max_Threads()
        mkl.MKL_Set_Num_Threads(1)
        try:
            yield
        finally:
            mkl.MKL_Set_Num_Threads(before)
