"""The main job on a design: mesh, passive path, stroke, measures, files, comparison, pictures, report.

`run` is the one entry. States go to disk as they are solved; a job that was interrupted goes on from them.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fem_biobot.config import digest
from fem_biobot.design import Design
from fem_biobot.design_checks import refuse_without_solid
from fem_biobot.design_tissue import at_rest, told
from fem_biobot.errors import BiobotError, ModelError, SolveError
from fem_biobot.files import write_json
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.mesh.files import read_mesh, shape_notes
from fem_biobot.mesh.store import stored_mesh
from fem_biobot.rod.gait import Walk
from fem_biobot.solid.compiling import compile_kernels
from fem_biobot.solid.linear import pardiso_missing
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.touching import in_contact, touching_parts
from fem_biobot.study import compare, outputs, views, walk_files
from fem_biobot.study.checked import checked, report_tables, write_run_tables
from fem_biobot.study.contact_outputs import contact_notes, contact_numbers, draw_contact, write_contact
from fem_biobot.study.finding import Finding, write_series
from fem_biobot.study.folder import SUMMARY, ResultFolder, mesh_identity, write_design
from fem_biobot.study.muscle_findings import MuscleFindings, muscle_findings, oxygen_notes
from fem_biobot.study.neighbour import Shared, keep_states
from fem_biobot.study.paper import WALKED_FREQUENCIES
from fem_biobot.study.plan import Found, Solver, Wanted, wanted_states
from fem_biobot.study.reporter import Reporter, Silent
from fem_biobot.study.run_crosscheck import run_crosscheck
from fem_biobot.study.versions import versions
from fem_biobot.study.walking import WalkPlan, check_drive, walks_of
from fem_biobot.study.work import add_work
from fem_biobot.view.interactive import Moving

_COARSER = 1.6  # size of the second mesh of the error estimate over the first
_LEAST_STROKES = 8  # a walk of fewer says little


def run(
    design: Design,
    out: Path,
    *,
    mesh_file: Path | None = None,
    names: Mapping[str, str] | None = None,
    size: float | None = None,
    force: bool = False,
    resume: bool = False,
    complete: bool = True,
    walks: bool = True,
    shared: Shared | None = None,
    reporter: Reporter | None = None,
) -> dict[str, Any]:
    """Do the main job and write its folder.

    Parameters
    ----------
    design
        What to compute.
    out
        Folder of the result.
    mesh_file, names
        A tagged mesh to use instead of a generated one, and how its volumes map to regions.
    size
        Mesh size instead of the design's [mm].
    force
        Redo what is there, also another design's result.
    resume
        Insist on going on from an unfinished result; refused where there is none.
    complete
        True for `run`; False for `solve`: states, tables and VTK only.
    walks
        Whether a complete job of a bot includes walking, at the frequencies and with the forces of the paper.
    shared
        What a case of a sweep shares with others; its states are kept for them where these begin at neighbours.
    reporter
        Told of stages, states, iterations and notes.

    Returns
    -------
    dict
        The summary, as in `summary.json`.

    Raises
    ------
    BiobotError
        Wrong input before anything is written; a failed solve after everything reached is on disk.
    """
    refuse_without_solid(design, "solve")
    job = _Job(design, out, mesh_file, names, size, complete, walks, shared, reporter or Silent())
    done = job.folder.done(job.reporter, force=force, resume=resume)
    if done is not None:
        return done
    return job.do()


class _Job:
    """One job under way: what is fixed before it, and what it has found so far."""

    def __init__(
        self,
        design: Design,
        out: Path,
        mesh_file: Path | None,
        names: Mapping[str, str] | None,
        size: float | None,
        complete: bool,
        walks: bool,
        shared: Shared | None,
        reporter: Reporter,
    ) -> None:
        self.design = design if size is None else design.with_values({"mesh.size": size})
        self.mesh_file, self.names, self.complete, self.reporter = mesh_file, names, complete, reporter
        self.shared = shared
        identity = {
            "kind": "run" if complete else "solve",
            "design_digest": digest(self.design),
            "mesh": mesh_identity(mesh_file),
        }
        self.plan = None
        if complete and walks and design.kind == "bot":
            self.plan = WalkPlan(WALKED_FREQUENCIES, design.drive.duration, None, _LEAST_STROKES)
            identity["walk"] = self.plan.text
            check_drive(design, self.plan)
        self.folder = ResultFolder(out, identity)
        self.sliding = design.muscle is not None and design.muscle.attachment == "contact"
        self.walks: list[Walk] = []
        self.notes: list[str] = []
        self.timings: dict[str, float] = {}
        self.states: list[dict[str, Any]] = []
        self.found: list[Found] = []
        self.files: list[str] = []
        self.figures: list[tuple[Path, str]] = []
        self.muscle = MuscleFindings()
        self.beside = Finding({})
        self.began = time.perf_counter()

    def do(self) -> dict[str, Any]:
        self.reporter.stage("mesh", 1)
        for line in (told(self.design.muscle), at_rest(self.design.muscle)):
            if line:
                self._note(line)
        mesh = self._timed("mesh", self._mesh)
        self.reporter.advance(f"{mesh.n_elements} elements, {mesh.n_unknowns} unknowns")
        if missing := pardiso_missing():
            self._note(f"SuperLU factors instead of PARDISO ({missing}); slower on large meshes")
        self._timed("compile", lambda: compile_kernels(self.reporter, self.design.mesh.element, sliding=self.sliding))
        solver = self._timed("model", lambda: Solver(self.design, mesh, self.reporter, shared=self.shared))
        for note in [*solver.model.system.notes, *oxygen_notes(self.design, mesh), *shape_notes(self.design, mesh)]:
            self._note(note)
        self.folder.open()
        write_design(self.folder.path, self.design)
        try:
            self._timed("solve", lambda: self._solve(solver))
        except (BiobotError, KeyboardInterrupt) as failure:
            self._leave_readable(mesh, solver, failure)
            raise
        for note in contact_notes(self.design, self.states):
            self._note(note)
        coarse = self._timed("second_mesh", lambda: self._coarse_states(mesh)) if self.complete else None
        if self.plan is not None:
            self._timed("walk", self._walk)
        summary = self._summary(mesh, solver, coarse)
        summary["design_check"] = checked(self.design, self.found, summary)
        write_run_tables(self.folder.path, summary, self.walks)
        if self.complete:
            self.muscle = self._timed("muscle", lambda: muscle_findings(self.design, mesh, self.folder.path))
            summary["muscle"] = self.muscle.numbers
            for note in self.muscle.notes:
                self._note(note)
            if self.sliding:
                self._note("cross-check: left out: the rods' muscle is bonded to its pillars, the solid's rings slide")
            elif self.design.kind == "bot":
                self.beside = self._timed("crosscheck", lambda: self._crosscheck(mesh))
                summary["crosscheck"] = dict(self.beside.numbers) or None
            self._timed("pictures", lambda: self._show(summary))
        summary["notes"] = self.notes
        summary["timings_s"] = {**self.timings, "total": round(time.perf_counter() - self.began, 3)}
        if self.complete:
            self.figures += [*self.muscle.figures, *self.beside.figures]
            more = [*report_tables(summary), *self.muscle.tables]
            more += [(t.title, t.header, t.rows) for t in self.beside.tables]
            shown = self._timed("views", self._views)
            outputs.write_run_report(self.folder.path, summary, self.figures, self.design, more, shown)
            self.reporter.advance("report")
        if self.shared is not None and self.shared.sharp:
            keep_states(self.folder.path, self.found, self.design)
        self.folder.close(summary)
        return summary

    def _mesh(self) -> BodyMesh:
        if self.mesh_file is not None:
            return read_mesh(self.mesh_file, self.names, design=self.design)
        mesh, notes = mesh_for(self.design) if self.shared is None else stored_mesh(self.design, self.shared.meshes)
        for note in notes:
            self._note(note)
        return mesh

    def _solve(self, solver: Solver) -> None:
        wanted = wanted_states(self.design)
        self.reporter.stage("solve", len(wanted))
        for each in wanted:
            if each.force is not None and not self._within_reach(each):
                self.reporter.advance(f"{each.label}: left out")
                continue
            if (saved := self.folder.saved(each.key)) is not None:
                found = solver.restore(
                    each, saved.u, saved.step, saved.natural_stretch, saved.work, saved.pressure, saved.touch
                )
            else:
                try:
                    found = solver.solve(each)
                except SolveError as failure:
                    if each.reference == self.design.value("muscle.reference") or each.reference == "as_moulded":
                        raise
                    # the other reference state is a bound beside the design's own: its absence is said, not fatal
                    self._note(f"{each.label}: left out: {failure}")
                    self.reporter.advance(f"{each.label}: left out")
                    break
                self.folder.save(found)
            self._take(solver, found)
            self.reporter.advance(each.label)

    def _within_reach(self, wanted: Wanted) -> bool:
        """Whether full drive could give the force wanted at all; even a rigid muscle gives tension times section."""
        assert wanted.force is not None
        limit = self.design.tension(self.design.drive.amplitude) * self.design.junction_section
        # tissue that shortens spends about half of its tension on itself
        if wanted.force < 0.5 * limit:
            return True
        self._note(f"{wanted.label}: left out, full drive pulls with at most {limit:.3g} mN before the tissue resists")
        return False

    def _take(self, solver: Solver, found: Found) -> None:
        measurer = Measurer(self.design, found.state.model)
        touching = touching_parts(found.state.model.mesh, found.state.u, in_contact(found.state.model))
        if touching:
            self._note(f"{found.wanted.label}: the body touches itself ({touching}); contact forces are not modelled")
        self.states.append(
            {
                "key": found.wanted.key,
                "label": found.wanted.label,
                "reference": found.wanted.reference,
                "natural_stretch_1": found.natural_stretch,
                "load_1": found.state.step.load,
                **measurer.measures(found.state),
                **contact_numbers(self.design, found.state),
                "touching": touching,
                "file": f"solid_{len(self.files):02d}_{found.wanted.key}.vtu",
            }
        )
        self.found.append(found)
        name = str(self.states[-1]["file"])
        outputs.write_state(self.folder.path / name, found.state)
        self.files.append(name)
        outputs.write_series(self.folder.path, self.files)
        write_contact(self.folder.path, self.files, found.state)

    @property
    def _shown_frequency(self) -> float:
        """Of the walk that is drawn and written for ParaView: the paper's next to the design's [Hz]."""
        return min(WALKED_FREQUENCIES, key=lambda f: abs(f - self.design.drive.frequency))

    @property
    def _shown_walk(self) -> Walk:
        """The walk that the report shows; there is one at least."""
        return next((w for w in self.walks if w.frequency == self._shown_frequency), self.walks[0])

    def _walk(self) -> None:
        """Walk at the paper's frequencies; a walk that fails is said and leaves the rest of the result whole."""
        assert self.plan is not None
        try:
            # the weight on the feet is the least known number: both bounds are walked, the design's own first
            own = self.design.ground.immersion
            for immersion in (own, "submerged" if own == "air" else "air"):
                design = self.design.with_values({"ground.immersion": immersion})
                for found in walks_of(design, self.plan, self.folder, self.reporter, self._note):
                    self.walks.append(found)
                    shown = immersion == own and found.frequency == self._shown_frequency
                    walk_files.write_walk(self.folder.path, found, "rod" if shown else None)
        except (SolveError, ModelError) as failure:
            self._note(f"walking: left out from here: {failure}")

    def _coarse_states(self, mesh: BodyMesh) -> tuple[list[dict[str, Any]], float] | None:
        """The moulded states on a coarser mesh and how much coarser it is; None where there is no second mesh."""
        if self.mesh_file is not None:
            self._note("error not estimated: a given mesh has no second size; run a refined one and compare")
            return None
        size = self.design.mesh.size * _COARSER
        coarse, _ = mesh_for(self.design, size)
        if coarse.n_elements > 0.8 * mesh.n_elements:
            self._note("error not estimated: no mesh that is coarser enough is at hand")
            return None
        wanted = [
            f.wanted
            for f in self.found
            if f.wanted.reference == "as_moulded" and not f.wanted.key.startswith(("path", "half"))
        ]
        self.reporter.stage("second mesh, for the error", len(wanted))
        solver = Solver(self.design, coarse, self.reporter)
        states = []
        for each in wanted:
            found = solver.solve(each)
            measured = solver.measurer.measures(found.state)
            states.append({"key": each.key, "label": each.label, **measured})
            self.reporter.advance(each.label)
        return states, (mesh.n_elements / coarse.n_elements) ** (1.0 / 3.0)

    def _summary(
        self, mesh: BodyMesh, solver: Solver, coarse: tuple[list[dict[str, Any]], float] | None
    ) -> dict[str, Any]:
        if why := add_work(self.design, solver, self.found, self.states):
            self._note(why)
        solid: dict[str, Any] = {"states": self.states}
        if self.design.kind == "bot":
            solid["stroke"] = compare.strokes(self.states)
            solid["comparison"] = compare.beside_paper(self.design, self.states, solid["stroke"])
            solid["comparison"] += compare.walks_beside_paper([walk_files.walk_summary(found) for found in self.walks])
        else:
            solid["comparison"] = compare.beside_closed_form(self.design, self.states)
        if coarse is not None:
            solid["error_estimate"] = compare.error_estimate(self.states, *coarse)
        solid["linear_solver"] = solver.solver.name
        solid["factorisations_1"] = sum(int(s["factorisations_1"]) for s in self.states)
        return {
            "complete": True,
            "job": self.folder.job,
            "design_digest": self.folder.job["design_digest"],
            "design": self.design.name,
            "versions": versions(),
            "timings_s": dict(self.timings),
            "mesh": outputs.mesh_summary(mesh, solver.model.n_dofs, self.design.mesh.element),
            "solid": solid,
            "walks": [walk_files.walk_summary(found) for found in self.walks],
            "crosscheck": None,
            "notes": self.notes,
        }

    def _crosscheck(self, mesh: BodyMesh) -> Finding:
        """Rods beside the moulded states; a machine that has no cross-check is said and leaves the rest whole."""
        given = self.mesh_file is not None
        found = run_crosscheck(self.design, mesh, self.found, self.folder.path, self.reporter, given=given)
        for note in found.notes:
            self._note(note)
        write_series(self.folder.path, found)
        return found

    def _show(self, summary: dict[str, Any]) -> None:
        self.reporter.stage("pictures", 4 if self.walks else 3)
        own = self.design.value("muscle.reference") if self.design.kind == "bot" else ""
        prefix = "remodelled_" if own == "remodelled" else ""
        pictured = ("load_4", f"{prefix}passive", f"{prefix}peak")
        shown = [f for f in self.found if f.wanted.key in pictured]
        files, note = outputs.draw(self.folder.path, self.design, shown)
        if note:
            self._note(note)
        self.figures = [(file, file.stem.replace("_", " ")) for file in files]
        self.figures += draw_contact(self.folder.path, self.design, shown)
        self.reporter.advance("pictures")
        self.figures += outputs.plot(self.folder.path, self.design, summary["solid"]["states"])
        self.reporter.advance("plots")
        if self.walks:
            self.figures += walk_files.draw_walks(self.folder.path, self.walks, [self._shown_walk])
            self.reporter.advance("walks")

    def _views(self) -> list[Moving]:
        """Both models as the reader turns them."""
        found = views.solid_views(self.design, self.found)
        return [*found, views.walk_view(self._shown_walk)] if self.walks else found

    def _leave_readable(self, mesh: BodyMesh, solver: Solver, failure: BaseException) -> None:
        """What was reached, as a summary that says it is not whole."""
        summary = self._summary(mesh, solver, None)
        reached = self.states[-1]["label"] if self.states else "nothing"
        summary |= {"complete": False, "failure": str(failure) or "interrupted", "reached": reached}
        write_run_tables(self.folder.path, summary, self.walks)
        write_json(self.folder.path / SUMMARY, summary)
        if isinstance(failure, SolveError):
            self._note(f"reached: {reached}; everything up to there is in {self.folder.path}")

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)
            self.reporter.note(text)

    def _timed(self, name: str, action: Any) -> Any:
        start = time.perf_counter()
        try:
            return action()
        finally:
            self.timings[name] = round(time.perf_counter() - start, 3)
