"""What a run tells of its muscle as tissue: drive and fibres always, the rest where the design has it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fem_biobot.design import Design
from fem_biobot.errors import DesignError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.muscle.oxygenation import oxygenation
from fem_biobot.study.finding import Finding, write_series
from fem_biobot.study.muscle_drive import drive_finding
from fem_biobot.study.muscle_fibres import fibres_finding
from fem_biobot.study.muscle_orientation import orientation_finding
from fem_biobot.study.muscle_oxygen import oxygen_finding
from fem_biobot.study.muscle_tissue import tissue_finding
from fem_biobot.study.muscle_velocity import velocity_finding
from fem_biobot.study.outputs import figures_folder
from fem_biobot.view.report import Table


@dataclass(frozen=True)
class MuscleFindings:
    """Findings of all subjects as a run takes them.

    Attributes
    ----------
    numbers
        For the summary, by subject.
    tables, figures, notes
        For the report, in order.
    """

    numbers: dict[str, dict[str, Any]] = field(default_factory=dict)
    tables: list[Table] = field(default_factory=list)
    figures: list[tuple[Path, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def oxygen_notes(design: Design, mesh: BodyMesh) -> list[str]:
    """What a user must know of a design's oxygen before anything is solved: how much of the tissue dies.

    Raises
    ------
    DesignError
        Gamma 0: a muscle that pulls with nothing.
    """
    oxygen = None if design.muscle is None else design.muscle.oxygen
    if oxygen is None:
        return []
    found = oxygenation(design, mesh)
    if found.gamma == 0.0 and oxygen.tension != "none":
        raise DesignError(
            f"muscle.oxygen: found gamma 0 (consumption {oxygen.consumption:g} mM/s, supply {oxygen.supply:g} mM): no "
            "tissue between the pillars gets oxygen, so the machine has no muscle; expected less consumption"
        )
    return found.notes()


def muscle_findings(design: Design, mesh: BodyMesh, folder: Path) -> MuscleFindings:
    """Examine a design's muscle; tables and figures are written to a result's folder. Empty without a muscle."""
    if design.muscle is None:
        return MuscleFindings()
    figures = figures_folder(folder)
    found: dict[str, Finding] = {
        "drive": drive_finding(design, figures),
        "fibres": fibres_finding(design, mesh, figures),
    }
    if design.muscle.orientation is not None:
        found["orientation"] = orientation_finding(design, Path(design.muscle.orientation), figures)
    if design.muscle.tissue is not None:
        found["tissue"] = tissue_finding(design, figures)
    if design.muscle.oxygen is not None:
        found["oxygen"] = oxygen_finding(design, mesh, figures)
    if design.muscle.force_velocity is not None:
        found["velocity"] = velocity_finding(design, figures)
    merged = MuscleFindings()
    for subject, finding in found.items():
        write_series(folder, finding)
        merged.numbers[subject] = dict(finding.numbers)
        merged.tables.extend((t.title, t.header, t.rows) for t in finding.tables)
        merged.figures.extend(finding.figures)
        merged.notes.extend(finding.notes)
    return merged
