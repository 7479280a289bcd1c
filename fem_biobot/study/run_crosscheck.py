"""The cross-check as a part of a run: rods beside the states of the solid that the run has solved already."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fem_biobot.design import Design
from fem_biobot.errors import BiobotError
from fem_biobot.link.crosscheck import crosscheck
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.study.crosscheck import told
from fem_biobot.study.finding import Finding
from fem_biobot.study.outputs import figures_folder
from fem_biobot.study.plan import Found
from fem_biobot.study.reporter import Reporter

# size of the mesh whose parts are loaded over that of the run: their constants change by 1 % at most
_COARSER = 1.6


def run_crosscheck(
    design: Design, mesh: BodyMesh, found: Sequence[Found], folder: Path, reporter: Reporter, *, given: bool
) -> Finding:
    """Rods beside the moulded states of a run, by rising tension.

    Parameters
    ----------
    design, mesh
        Of the run.
    found
        What it has solved.
    folder
        Of the result; figures are drawn in its own folder for them.
    reporter
        Told of stages.
    given
        Whether the mesh was given: its parts are loaded themselves then, else those of a coarser one.

    Returns
    -------
    Finding
        With a note in place of everything else where the design has no cross-check.
    """
    moulded = design.with_values({"muscle.reference": "as_moulded"})
    states = {each.state.step.tension: each.state for each in found if each.wanted.reference == "as_moulded"}
    unit = design.tension(design.drive.amplitude)
    # tensions that are asked for as such keep every digit
    asked = {each.state.step.tension: each.wanted.tension for each in found}
    factors = sorted(factor for factor in states if factor > 0.0)
    tensions = [asked[factor] or factor * unit for factor in factors]
    try:
        parts = mesh if given else mesh_for(moulded, _COARSER * design.mesh.size)[0]
        checked = crosscheck(
            moulded,
            mesh,
            tensions=tensions,
            solved=[states[factor] for factor in factors],
            parts_mesh=parts,
            reporter=reporter,
        )
    except BiobotError as reason:
        return Finding({}, notes=[f"cross-check: left out: {reason}"])
    # a run has both models to turn already
    return told(checked, figures_folder(folder), views=False)
