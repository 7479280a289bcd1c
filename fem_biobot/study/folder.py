"""The folder of a result: whose it is, whether it is whole, and the states saved while it is not.

`summary.json` appears last and marks a whole result. Until then `.unfinished/` holds what the job was and each state
solved so far, and is what a later run goes on from.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from fem_biobot.config import to_toml
from fem_biobot.design import Design
from fem_biobot.design_files import content_of, named_files
from fem_biobot.errors import FileError
from fem_biobot.files import file_error, replacing, write_bytes, write_json, write_text
from fem_biobot.solid.interface.state import Touch
from fem_biobot.solid.records import Step
from fem_biobot.study.plan import Found
from fem_biobot.study.reporter import Reporter

SUMMARY = "summary.json"
_UNFINISHED = ".unfinished"
_JOB = "job.json"
# what a result consists of; cleared before another one takes its place
_OURS = (
    "solid_*.vtu", "solid*.pvd", "solid*/*.vtp", "rod*.pvd", "rod*/*.vtp", "design.toml", "report.html",
    "tables/*.csv", "figures/*.png", "figures/*.gif", "fibres.vtu", "states.npz",
)  # fmt: skip


def write_design(folder: Path, design: Design) -> None:
    """`design.toml` of a result, resolved, with copies of the files that the design names beside it.

    So the folder reruns to the same result wherever it is taken. Copies are named after their keys.
    """
    copies: dict[str, str] = {}
    for key, path in named_files(design).items():
        copies[key] = f"{key.replace('.', '_')}{path.suffix}"
        try:
            content = path.read_bytes()
        except OSError as error:
            raise file_error(error, path, doing="read") from None
        write_bytes(folder / copies[key], content)
    write_text(folder / "design.toml", to_toml(design.with_values(copies) if copies else design))


def mesh_identity(file: Path | None) -> str:
    """What tells the mesh of a result from another: the name and the content of a given file."""
    return "generated" if file is None else f"{file.name} {content_of(file)}"


@dataclass(frozen=True)
class Saved:
    """A state read back."""

    u: np.ndarray
    step: Step
    natural_stretch: float
    work: dict[str, float]
    pressure: np.ndarray | None
    touch: Touch | None


@dataclass(frozen=True)
class ResultFolder:
    """A folder that holds, or will hold, the result of one job.

    Attributes
    ----------
    path
        The folder.
    job
        What identifies the result: design digest, mesh, kind of job. Equal jobs give equal results.
    """

    path: Path
    job: dict[str, str]

    @property
    def unfinished(self) -> Path:
        """Where states are kept until the result is whole."""
        return self.path / _UNFINISHED

    def whole_result(self) -> dict[str, Any] | None:
        """Summary of this very job's whole result, or None; refuses a folder that holds something else.

        Raises
        ------
        FileError
            The folder holds another design's result, or files that are no result at all.
        """
        if not self.path.exists():
            return None
        if not self.path.is_dir():
            raise FileError(f"{self.path}: found a file, expected a folder for the result")
        holds = self._held_job()
        if holds is None:
            if self._holds_strangers():
                raise FileError(
                    f"{self.path}: found files that are no result of this program, expected an empty or new folder; "
                    "give another --out"
                )
            return None
        if holds.get("design_digest") != self.job["design_digest"]:
            raise FileError(
                f"{self.path}: found the result of another design (digest {holds.get('design_digest')}), expected this "
                f"one's ({self.job['design_digest']}) or an empty folder; give another --out, or --force to redo it"
            )
        own = [job.get("kind") for job in (holds, self.job) if job.get("kind") not in ("run", "solve")]
        if own and (holds.get("kind"), holds.get("walk")) != (self.job["kind"], self.job.get("walk")):
            kinds = [f"{job['kind']} ({job['walk']})" if "walk" in job else job["kind"] for job in (holds, self.job)]
            raise FileError(
                f"{self.path}: found the result of another job, {kinds[0]}, expected {kinds[1]}; "
                "give another --out, or --force to redo it here"
            )
        if holds.get("mesh") != self.job["mesh"]:
            raise FileError(
                f"{self.path}: found this design's result on another mesh ({holds.get('mesh')}), expected "
                f"{self.job['mesh']}; give another --out, or --force to redo it here"
            )
        summary = self._read(self.path / SUMMARY)
        same = summary is not None and summary.get("complete") and summary.get("job") == self.job
        return summary if same else None

    def done(self, reporter: Reporter, *, force: bool, resume: bool = False) -> dict[str, Any] | None:
        """Summary of this job's whole result, told of, or None where there is work to do.

        Parameters
        ----------
        reporter
            Told that nothing is done again.
        force
            Forget what is there, also another design's result.
        resume
            Insist on going on from an unfinished result.

        Raises
        ------
        FileError
            As `whole_result`; nothing to resume.
        """
        if force:
            self.clear()
            summary = None
        else:
            summary = self.whole_result()
        if summary is not None:
            reporter.note(f"{self.path} holds this design's result already; --force redoes it")
        elif resume and not self.unfinished.is_dir():
            raise FileError(
                f"{self.path}: found no unfinished result, expected one to resume; leave out --resume to begin"
            )
        return summary

    def clear(self) -> None:
        """Forget the result that is here; refuses a folder that is not ours."""
        if self.path.is_dir() and self._held_job() is None and self._holds_strangers():
            raise FileError(
                f"{self.path}: found files that are no result of this program, so --force leaves them; "
                "give another --out"
            )
        try:
            (self.path / SUMMARY).unlink(missing_ok=True)
            for pattern in _OURS:
                for file in self.path.glob(pattern):
                    file.unlink()
            shutil.rmtree(self.unfinished, ignore_errors=True)
        except OSError as error:
            raise file_error(error, self.path) from None

    def open(self) -> None:
        """Make the folder and mark it as this job's, keeping the states of an earlier try of the same job."""
        try:
            self.unfinished.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise file_error(error, self.path) from None
        if self._read(self.unfinished / _JOB) != self.job:
            for old in self.unfinished.glob("*.npz"):
                old.unlink()
        (self.path / SUMMARY).unlink(missing_ok=True)
        write_json(self.unfinished / _JOB, self.job)

    def close(self, summary: dict[str, Any]) -> None:
        """Write the summary of a whole result and drop what was kept for going on."""
        write_json(self.path / SUMMARY, summary)
        shutil.rmtree(self.unfinished, ignore_errors=True)

    def keep(self, key: str, arrays: Mapping[str, Any]) -> None:
        """Keep named arrays for a later run to go on from."""
        with replacing(self.unfinished / f"{key}.npz") as temporary:
            np.savez(temporary, **arrays)

    def kept(self, key: str) -> dict[str, np.ndarray] | None:
        """Arrays kept by an earlier try of this job, or None."""
        file = self.unfinished / f"{key}.npz"
        if not file.exists():
            return None
        try:
            with np.load(file) as data:
                return {name: data[name] for name in data.files}
        except (OSError, ValueError, EOFError, BadZipFile) as error:
            raise self._unreadable(file, error) from None

    @staticmethod
    def _unreadable(file: Path, error: Exception) -> FileError:
        return FileError(f"{file}: cannot be read ({error}), expected a saved state; --force starts anew")

    def save(self, found: Found) -> None:
        """Keep a state of the solid for a later run to go on from."""
        s = found.state
        self.keep(
            found.wanted.key,
            {
                "u": s.u,
                "step": [s.step.load, s.step.tension],
                "natural_stretch": found.natural_stretch,
                "work": [s.residual, s.newton_iterations, s.factorisations, s.cg_iterations],
                **({} if s.pressure is None else {"pressure": s.pressure}),
                **({} if s.touch is None else {f"touch_{name}": v for name, v in s.touch._asdict().items()}),
            },
        )

    def saved(self, key: str) -> Saved | None:
        """A state of the solid kept by an earlier try, or None."""
        data = self.kept(key)
        if data is None:
            return None
        try:
            load, tension = (float(x) for x in data["step"])
            residual, newton, factorisations, cg = map(float, data["work"])
            work = {"residual": residual, "newton": newton, "factorisations": factorisations, "cg": cg}
            pressure = data.get("pressure")
            touch = Touch(*(data[f"touch_{name}"] for name in Touch._fields)) if "touch_traction" in data else None
            return Saved(data["u"], Step(load, tension), float(data["natural_stretch"]), work, pressure, touch)
        except (ValueError, KeyError) as error:
            raise self._unreadable(self.unfinished / f"{key}.npz", error) from None

    def _holds_strangers(self) -> bool:
        """Whether anything lies here but the empty mark of a job that could not write its first file."""
        return any(entry.name != _UNFINISHED or any(entry.iterdir()) for entry in self.path.iterdir())

    def _held_job(self) -> dict[str, str] | None:
        """The job whose result or beginning is here, None if the folder is not ours."""
        job = self._read(self.unfinished / _JOB)
        if job is not None:
            return job
        summary = self._read(self.path / SUMMARY)
        return summary.get("job") if summary is not None and "design_digest" in summary else None

    @staticmethod
    def _read(file: Path) -> dict[str, Any] | None:
        try:
            return json.loads(file.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            raise FileError(
                f"{file}: cannot be read ({error}), expected a whole JSON file; give another --out"
            ) from None
