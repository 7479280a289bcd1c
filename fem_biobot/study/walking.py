"""The walking of a design: strokes at one or more frequencies, each as a `Walk`, resumable stroke by stroke.

`walk_design` is the job of the command `walk`; `walks_of` is the part that a run shares with it.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.config import digest
from fem_biobot.design import Design
from fem_biobot.design_tissue import told
from fem_biobot.errors import BiobotError, DesignError, FileError, SolveError
from fem_biobot.files import write_json
from fem_biobot.muscle.drive import paper_amplitude
from fem_biobot.muscle.waveforms import drive_function
from fem_biobot.rod.compiling import compile_kernels
from fem_biobot.rod.dynamics.integrate import Checkpoint, Motion
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.reduce import ground_of, reduce
from fem_biobot.rod.rest import Stance, stance
from fem_biobot.rod.walk import walk
from fem_biobot.study import walk_files
from fem_biobot.study.folder import SUMMARY, ResultFolder, write_design
from fem_biobot.study.reporter import Reporter, Silent
from fem_biobot.study.versions import versions


@dataclass(frozen=True)
class WalkPlan:
    """What to walk.

    Attributes
    ----------
    frequencies
        Strokes per second, one walk each [Hz].
    duration
        Driven time of each [s].
    amplitude
        Largest drive [1]; None for that with which the muscle has the active force that the paper's simulation applied
        at the frequency.
    least_strokes
        Walks of fewer strokes than this in `duration` go on until they have them.
    """

    frequencies: tuple[float, ...]
    duration: float
    amplitude: float | None
    least_strokes: int = 0

    def __post_init__(self) -> None:
        if not self.frequencies:
            raise DesignError("frequency: found none, expected at least one")
        for f in self.frequencies:
            if not (math.isfinite(f) and f > 0.0):
                raise DesignError(f"frequency: found {f:g} Hz, expected above 0 Hz")
        if len(set(self.frequencies)) < len(self.frequencies):
            raise DesignError("frequency: found one twice, expected different ones")

    def time(self, frequency: float) -> float:
        """Driven time of the walk at a frequency [s]."""
        return max(self.duration, self.least_strokes / frequency)

    @property
    def text(self) -> str:
        """In a line, as the identity of a result."""
        given = "forces of the paper" if self.amplitude is None else f"drive {self.amplitude:g}"
        return f"{', '.join(f'{f:g}' for f in self.frequencies)} Hz, {self.duration:g} s, {given}"


def walk_design(
    design: Design,
    out: Path,
    plan: WalkPlan,
    *,
    force: bool = False,
    resume: bool = False,
    pictures: bool = True,
    reporter: Reporter | None = None,
) -> dict[str, Any]:
    """Walk a design at the frequencies of a plan and write the result's folder.

    Parameters
    ----------
    design, plan
        What walks, and how.
    out
        Folder of the result.
    force, resume
        As in `study.run.run`.
    pictures
        Whether the rods over time, plots, animation and report are written beside the numbers.
    reporter
        Told of stages, strokes and notes.

    Returns
    -------
    dict
        The summary, as in `summary.json`.

    Raises
    ------
    BiobotError
        Wrong input before anything is written; a walk that fails after everything reached is on disk.
    """
    reporter = reporter or Silent()
    _refuse(design, plan)
    folder = ResultFolder(out, {"kind": "walk", "design_digest": digest(design), "mesh": "none", "walk": plan.text})
    done = folder.done(reporter, force=force, resume=resume)
    if done is not None:
        return done
    began = time.perf_counter()
    notes: list[str] = []

    def note(text: str) -> None:
        if text not in notes:
            notes.append(text)
            reporter.note(text)

    walks: list[Walk] = []

    def summary(complete: bool) -> dict[str, Any]:
        return {
            "complete": complete,
            "job": folder.job,
            "design_digest": folder.job["design_digest"],
            "design": design.name,
            "versions": versions(),
            "timings_s": {"walk": round(sum(w.wall_time for w in walks), 3), "total": round(_since(began), 3)},
            "mesh": None,
            "solid": {"states": []},
            "walks": [walk_files.walk_summary(w) for w in walks],
            "crosscheck": None,
            "notes": notes,
        }

    folder.open()
    if line := told(design.muscle):
        note(line)
    write_design(folder.path, design)
    try:
        for found in walks_of(design, plan, folder, reporter, note):
            walks.append(found)
            walk_files.write_walk(folder.path, found, _series(plan, found) if pictures else None)
    except (BiobotError, KeyboardInterrupt) as failure:
        if isinstance(failure, SolveError) and isinstance(failure.best, Walk):
            walks.append(failure.best)
            walk_files.write_walk(folder.path, failure.best, _series(plan, failure.best) if pictures else None)
        reached = f"{len(walks)} of {len(plan.frequencies)} walks"
        write_json(
            folder.path / SUMMARY, {**summary(False), "failure": str(failure) or "interrupted", "reached": reached}
        )
        raise
    walk_files.write_walk_tables(folder.path, walks)
    figures = []
    if pictures:
        reporter.stage("plots and animation", 1)
        figures = walk_files.draw_walks(folder.path, walks, walks)
        reporter.advance("plots and animation")
    result = summary(True)
    if pictures:
        walk_files.write_walk_report(folder.path, result, figures, design, walks)
    folder.close(result)
    return result


def _series(plan: WalkPlan, walk: Walk) -> str:
    """Name of a walk's series for ParaView: rod, or with the frequency where there are several."""
    return "rod" if len(plan.frequencies) == 1 else f"rod_{walk.frequency:g}Hz".replace(".", "p")


def _since(began: float) -> float:
    return time.perf_counter() - began


def check_drive(design: Design, plan: WalkPlan) -> None:
    """Refuse a drive whose pulses do not fit a stroke of the plan, or which the time step jumps over."""
    for frequency in plan.frequencies:
        drive_function(design.drive, frequency).check_step(design.numerics.step)


def _refuse(design: Design, plan: WalkPlan) -> None:
    """What cannot walk, before anything is written."""
    if design.kind not in ("bot", "walker"):
        raise DesignError(
            f"kind: found {design.kind}, expected bot or walker: only a machine with feet and muscle walks"
        )
    check_plan(design, plan)
    reduce(design)


def check_plan(design: Design, plan: WalkPlan) -> None:
    """Refuse a plan whose drive, step or duration do not fit a stroke."""
    check_drive(design, plan)
    period = 1.0 / max(plan.frequencies)
    if design.numerics.step > period:
        raise DesignError(
            f"numerics.step: found {design.numerics.step:g} s, expected at most the drive's period ({period:g} s)"
        )
    for frequency in plan.frequencies:
        if plan.time(frequency) < 1.0 / frequency:
            raise DesignError(
                f"duration: found {plan.duration:g} s, expected at least a stroke ({1.0 / frequency:g} s)"
            )


def walks_of(
    design: Design, plan: WalkPlan, folder: ResultFolder, reporter: Reporter, note: Callable[[str], None]
) -> Iterator[Walk]:
    """The walks of a plan one by one, each stroke kept in the folder, from where an earlier try stopped."""
    compile_kernels(reporter)
    if design.muscle is not None and design.muscle.attachment != "bonded":
        note("walking: rods keep the muscle bonded to its pillars (muscle.attachment contact is the solid's)")
    model, ground = reduce(design), ground_of(design)
    place = "in air" if design.ground.immersion == "air" else "submerged"
    stood = None
    if design.walker is None or design.walker.start == "standing":
        stood = _stance(model, folder, reporter, ground, design.ground.immersion)
    for frequency in plan.frequencies:
        amplitude = plan.amplitude
        if amplitude is None and design.drive.amplitude_by != "given":
            amplitude = design.drive.amplitude
            note(f"drive {amplitude:.3g}, by frequency as drive.amplitude_by {design.drive.amplitude_by} has it")
        if amplitude is None:
            amplitude, source = paper_amplitude(design, frequency)
            note(f"{frequency:g} Hz: drive {amplitude:.3g}, the active force of the paper's simulation: {source}")
        duration = plan.time(frequency)
        reporter.stage(f"walk {place} at {frequency:g} Hz", max(1, math.ceil(duration * frequency - 1e-6)))
        kept = _kept_motions(folder, design, frequency, model, ground)
        for number in range(len(kept)):
            reporter.advance(f"stroke {number + 1}, from the earlier try")
        numbers = itertools.count(len(kept))

        def keep(motion: Motion, numbers: Iterator[int] = numbers, frequency: float = frequency) -> None:
            number = next(numbers)
            folder.keep(_key(design, frequency, number), _arrays(motion))
            reporter.advance(f"stroke {number + 1}")

        found = walk(
            design, frequency=frequency, duration=duration, amplitude=amplitude, start=stood, before=kept, keeper=keep
        )
        if not (found.foot_slips > 0.0).any():
            note(f"{place}, {frequency:g} Hz: no foot slips, so the machine stays where it stands")
        for event in found.events:
            note(f"{place}, {frequency:g} Hz: {event.text}")
        for text in found.notes:
            note(f"walking: {text}")
        yield found


def _stance(model: RodModel, folder: ResultFolder, reporter: Reporter, ground: Any, key: str) -> Stance:
    """How the machine stands, from an earlier try if there is one."""
    key = f"stance_{key}"
    kept = folder.kept(key)
    if kept is not None:
        state = RodState(model, kept["x"], kept["Q"])
        return Stance(state, float(kept["time"]), float(kept["energy"]), float(kept["tilt"]))
    reporter.stage("stand on the ground", 1)
    found = stance(model, ground)
    folder.keep(
        key,
        {
            "x": found.state.x,
            "Q": found.state.Q,
            "time": found.time,
            "energy": found.kinetic_energy,
            "tilt": found.tilt,
        },
    )
    reporter.advance(f"settled after {found.time:.2g} s")
    return found


def _key(design: Design, frequency: float, number: int) -> str:
    return f"walk_{design.ground.immersion}_{frequency:g}Hz_{number:05d}"


_NOT_ARRAYS = ("model", "ground", "final")


def _arrays(motion: Motion) -> dict[str, Any]:
    """A motion as named arrays."""
    found = {f.name: getattr(motion, f.name) for f in fields(Motion) if f.name not in _NOT_ARRAYS}
    return {**found, **{f"final_{k}": v for k, v in motion.final.arrays().items()}}


def _kept_motions(folder: ResultFolder, design: Design, frequency: float, model: RodModel, ground: Any) -> list[Motion]:
    """Strokes of an earlier try, in order."""
    found: list[Motion] = []
    while (kept := folder.kept(_key(design, frequency, len(found)))) is not None:
        try:
            final = Checkpoint.from_arrays({k[6:]: v for k, v in kept.items() if k.startswith("final_")})
            values = {f.name: kept[f.name] for f in fields(Motion) if f.name not in _NOT_ARRAYS}
        except KeyError as error:
            raise FileError(f"{folder.path}: a saved stroke lacks {error}; --force starts anew") from None
        plain: dict[str, Any] = {k: v.item() if np.ndim(v) == 0 else v for k, v in values.items()}
        found.append(Motion(model=model, ground=ground, final=final, **plain))
    return found
