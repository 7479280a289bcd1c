"""The walking of a design's solid, alone or beside the rods under the same drive; resumable stroke by stroke."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.config import digest
from fem_biobot.design import Design
from fem_biobot.design_checks import refuse_unbonded
from fem_biobot.design_tissue import told
from fem_biobot.errors import BiobotError, FileError, SolveError
from fem_biobot.files import write_json
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.mesh.files import read_mesh, shape_notes
from fem_biobot.muscle.drive import paper_amplitude
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.compiling import compile_kernels
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.book import BOOK
from fem_biobot.solid.dynamics.feet import feet_of
from fem_biobot.solid.dynamics.motion import SolidCheckpoint, SolidMotion
from fem_biobot.solid.gait import SolidWalk
from fem_biobot.solid.interface.state import Touch
from fem_biobot.solid.records import Step
from fem_biobot.solid.standing import FEET, Standing, stand
from fem_biobot.solid.walk import refuse_unwalkable, solid_ground, solid_walk, walking_body
from fem_biobot.study import outputs, solid_walk_files, walk_files
from fem_biobot.study.contact_outputs import contact_notes
from fem_biobot.study.folder import SUMMARY, ResultFolder, mesh_identity, write_design
from fem_biobot.study.reporter import Reporter, Silent
from fem_biobot.study.versions import versions
from fem_biobot.study.walking import WalkPlan, check_plan, walks_of

_PARTS = 10  # of a stroke, in which progress is told


def walk_solid(
    design: Design,
    out: Path,
    plan: WalkPlan,
    *,
    rods: bool = False,
    mesh_file: Path | None = None,
    names: Mapping[str, str] | None = None,
    size: float | None = None,
    force: bool = False,
    resume: bool = False,
    reporter: Reporter | None = None,
) -> dict[str, Any]:
    """Walk a design's solid at the frequencies of a plan and write the result's folder.

    Parameters
    ----------
    design, plan
        What walks, and how.
    out
        Folder of the result.
    rods
        Whether its rods walk as well, under the same drive.
    mesh_file, names, size
        As in `study.run.run`.
    force, resume
        As in `study.run.run`.
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
    design = design if size is None else design.with_values({"mesh.size": size})
    refuse_unwalkable(design)
    check_plan(design, plan)
    if rods:
        refuse_unbonded(design, "walk beside its rods")
        reduce(design)  # refuses what rods cannot have
    job = _Job(design, out, plan, rods, mesh_file, names, reporter or Silent())
    done = job.folder.done(job.reporter, force=force, resume=resume)
    return job.do() if done is None else done


class _Job:
    """One job under way."""

    def __init__(
        self,
        design: Design,
        out: Path,
        plan: WalkPlan,
        rods: bool,
        mesh_file: Path | None,
        names: Mapping[str, str] | None,
        reporter: Reporter,
    ) -> None:
        self.design, self.plan, self.rods, self.reporter = design, plan, rods, reporter
        self.mesh_file, self.names = mesh_file, names
        models = "solid and rods" if rods else "solid"
        identity = {"kind": "walk", "design_digest": digest(design), "mesh": mesh_identity(mesh_file)}
        self.folder = ResultFolder(out, {**identity, "walk": f"{plan.text}, {models}"})
        self.began = time.perf_counter()
        self.notes: list[str] = []
        self.walks: list[SolidWalk] = []
        self.rod_walks: list[Walk] = []
        self.mesh: dict[str, Any] | None = None

    def do(self) -> dict[str, Any]:
        self.reporter.stage("mesh", 1)
        mesh = self._mesh()
        self.reporter.advance(f"{mesh.n_elements} elements, {mesh.n_unknowns} unknowns")
        sliding = self.design.value("muscle.attachment") == "contact"
        compile_kernels(self.reporter, self.design.mesh.element, sliding=sliding)
        body = walking_body(self.design, mesh)
        self.mesh = outputs.mesh_summary(mesh, body.system.n_dofs, str(self.design.mesh.element))
        for note in body.system.notes:
            self._note(note)
        self.folder.open()
        if line := told(self.design.muscle):
            self._note(line)
        write_design(self.folder.path, self.design)
        try:
            if self.rods:
                for found in walks_of(self.design, self.plan, self.folder, self.reporter, self._note):
                    self.rod_walks.append(found)
                    walk_files.write_walk(self.folder.path, found, self._series("rod", found.frequency))
            self._walk(body)
        except (BiobotError, KeyboardInterrupt) as failure:
            if isinstance(failure, SolveError) and isinstance(failure.best, SolidWalk):
                self._take(failure.best)
            reached = f"{len(self.walks)} of {len(self.plan.frequencies)} walks of the solid"
            left = {**self._summary(False), "failure": str(failure) or "interrupted", "reached": reached}
            write_json(self.folder.path / SUMMARY, left)
            raise
        self.reporter.stage("plots", 1)
        figures = solid_walk_files.draw(self.folder.path, self.walks, self.rod_walks)
        self.reporter.advance("plots")
        result = self._summary(True)
        solid_walk_files.write_tables(self.folder.path, self.walks, self.rod_walks)
        solid_walk_files.write_solid_report(self.folder.path, result, figures, self.design)
        self.folder.close(result)
        return result

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)
            self.reporter.note(text)

    def _mesh(self) -> BodyMesh:
        if self.mesh_file is not None:
            mesh = read_mesh(self.mesh_file, self.names, design=self.design)
            notes = shape_notes(self.design, mesh)
        else:
            mesh, notes = mesh_for(self.design)
        for note in notes:
            self._note(note)
        return mesh

    def _series(self, name: str, frequency: float) -> str:
        many = len(self.plan.frequencies) > 1
        return f"{name}_{frequency:g}Hz".replace(".", "p") if many else name

    def _take(self, found: SolidWalk) -> None:
        self.walks.append(found)
        solid_walk_files.write_walk(self.folder.path, found, self._series("solid", found.frequency))

    def _walk(self, body: MovingBody) -> None:
        design, folder, reporter = self.design, self.folder, self.reporter
        stood = self._standing(body)
        place = "in air" if design.ground.immersion == "air" else "submerged"
        for frequency in self.plan.frequencies:
            amplitude = self.plan.amplitude
            if amplitude is None and design.drive.amplitude_by != "given":
                amplitude = design.drive.amplitude
            if amplitude is None:
                amplitude, source = paper_amplitude(design, frequency)
                self._note(f"{frequency:g} Hz: drive {amplitude:.3g}, the active force of the paper: {source}")
            duration = self.plan.time(frequency)
            parts = max(1, round(duration * frequency * _PARTS))
            reporter.stage(f"the solid walks {place} at {frequency:g} Hz", parts)
            kept = list(_kept(folder, design, frequency, body))
            tell = _Teller(reporter, frequency)
            if kept:
                tell(float(kept[-1].times[-1]), ", from the earlier try")
            numbers = itertools.count(len(kept))

            def keep(motion: SolidMotion, numbers: Iterator[int] = numbers, frequency: float = frequency) -> None:
                folder.keep(_key(design, frequency, next(numbers)), _arrays(motion))

            found = solid_walk(
                design, body, frequency=frequency, duration=duration, amplitude=amplitude, start=stood, before=kept,
                keeper=keep, listener=tell,
            )  # fmt: skip
            if not (found.foot_slips > 0.0).any():
                self._note(f"solid, {place}, {frequency:g} Hz: no foot slips, so the machine stays where it stands")
            for text in contact_notes(design, solid_walk_files.rings_of(found)):
                self._note(text)
            for text in [*found.notes, *(event.text for event in found.events)]:
                self._note(f"solid, {place}, {frequency:g} Hz: {text}")
            self._take(found)

    def _standing(self, body: MovingBody) -> Standing:
        """How the machine stands, from an earlier try if there is one."""
        key = f"solid_stance_{self.design.ground.immersion}"
        kept = self.folder.kept(key)
        if kept is not None:
            try:
                return Standing.from_arrays(kept)
            except KeyError as error:
                raise FileError(
                    f"{self.folder.path}: the saved standing shape lacks {error}; --force starts anew"
                ) from None
        self.reporter.stage("the solid stands on the ground", 1)
        found = stand(self.design, body, solid_ground(self.design))
        self.folder.keep(key, found.arrays())
        self.reporter.advance(f"settled after {found.time:.2g} s")
        return found

    def _summary(self, complete: bool) -> dict[str, Any]:
        spent = sum(w.wall_time for w in self.walks)
        rods = sum(w.wall_time for w in self.rod_walks)
        total = time.perf_counter() - self.began
        return {
            "complete": complete,
            "job": self.folder.job,
            "design_digest": self.folder.job["design_digest"],
            "design": self.design.name,
            "versions": versions(),
            "timings_s": {"walk": round(spent + rods, 3), "solid": round(spent, 3), "total": round(total, 3)},
            "mesh": self.mesh,
            "solid": {"states": []},
            "walks": [*map(solid_walk_files.summary_of, self.walks), *map(walk_files.walk_summary, self.rod_walks)],
            "crosscheck": None,
            "notes": self.notes,
        }


class _Teller:
    """Tells of the tenths of strokes that are made."""

    def __init__(self, reporter: Reporter, frequency: float) -> None:
        self.reporter, self.frequency, self.told = reporter, frequency, 0

    def __call__(self, t: float, more: str = "") -> None:
        while self.told < int(t * self.frequency * _PARTS + 1e-6):
            self.reporter.advance(f"stroke {self.told // _PARTS + 1}{more}")
            self.told += 1


def _key(design: Design, frequency: float, number: int) -> str:
    return f"solid_walk_{design.ground.immersion}_{frequency:g}Hz_{number:05d}"


_OBJECTS = ("body", "ground", "feet", "drive", "final", "between")


def _arrays(motion: SolidMotion) -> dict[str, Any]:
    """A motion as named arrays."""
    found = {f.name: getattr(motion, f.name) for f in fields(SolidMotion) if f.name not in _OBJECTS}
    driven = np.array([(s.load, s.tension, s.time) for s in motion.drive])
    found["driven"] = driven
    if motion.between:
        found |= {f"between_{k}": np.array([getattr(b, k) for b in motion.between]) for k in Touch._fields}
    return {**found, **{f"final_{k}": v for k, v in motion.final.arrays().items()}}


def _kept(folder: ResultFolder, design: Design, frequency: float, body: MovingBody) -> Iterator[SolidMotion]:
    """Strokes of an earlier try, in order."""
    ground, feet = solid_ground(design), feet_of(body, FEET)
    for number in itertools.count():
        kept = folder.kept(_key(design, frequency, number))
        if kept is None:
            return
        try:
            final = SolidCheckpoint.from_arrays({k[6:]: v for k, v in kept.items() if k.startswith("final_")})
            values: dict[str, Any] = {f.name: kept[f.name] for f in fields(SolidMotion) if f.name not in _OBJECTS}
            drive = tuple(Step(load, tension, time=t) for load, tension, t in kept["driven"].tolist())
            sliding = () if body.joint is None else tuple(kept[f"between_{k}"] for k in Touch._fields)
            if values["book"].shape[1] != len(BOOK):
                raise KeyError(BOOK[values["book"].shape[1]])
        except KeyError as error:
            raise FileError(f"{folder.path}: a saved stroke lacks {error}; --force starts anew") from None
        plain: dict[str, Any] = {k: v.item() if np.ndim(v) == 0 else v for k, v in values.items()}
        yield SolidMotion(
            body=body, ground=ground, feet=feet, drive=drive, final=final,
            between=tuple(Touch(*arrays) for arrays in zip(*sliding, strict=True)), **plain,
        )  # fmt: skip
