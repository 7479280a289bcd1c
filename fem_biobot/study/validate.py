"""The validation of the software against the paper as a result: table, CSV, plots of predictions and assumptions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from fem_biobot.design import Design
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.study.claims import Claim, Verdict
from fem_biobot.study.finding import Finding
from fem_biobot.study.reporter import Reporter
from fem_biobot.study.validation import Sensitivity, validate
from fem_biobot.study.views import both_view
from fem_biobot.tables import Table
from fem_biobot.view.validation import beside_measured, tornado

_MODELS = ("solid", "rods", "equations")


def validation_finding(
    design: Design, mesh: BodyMesh, figures: Path, reporter: Reporter, notes: Sequence[str] = ()
) -> Finding:
    """Predictions of the paper's numbers, verdicts, and what assumed inputs do to them."""
    claims, assumed, both = validate(design, mesh, reporter)
    judged = Counter(claim.verdict(value) for claim in claims for value in claim.predictions.values())
    told = [claim for claim in claims if not claim.predictions]
    remarks = [
        f"{len(claims) - len(told)} printed numbers predicted, {len(told)} not, each with its reason; of "
        f"{sum(judged.values())} predictions: " + ", ".join(f"{judged[v]} {v.value}" for v in Verdict if judged[v]),
        *(f"outside: {claim.name} by {' and '.join(claim.failed)}" for claim in claims if claim.failed),
    ]
    return Finding(
        {
            "rows": [claim.row() for claim in claims],
            "failed_1": sum(bool(claim.failed) for claim in claims),
            "sensitivities": [_as_row(s) for s in assumed],
        },
        [_predicted(claims), _unpredicted(told), _sensitivity(assumed)],
        {"validation": [claim.row() for claim in claims], "sensitivity": [_as_row(s) for s in assumed]},
        _draw(design, claims, assumed, figures),
        list(notes),
        remarks,
        [both_view(design, both)],
    )


def _predicted(claims: Sequence[Claim]) -> Table:
    lines = []
    for claim in claims:
        if not claim.predictions:
            continue
        p = claim.printed
        measured = f"{claim.bound}{p.value:g}" + (f" +- {p.deviation:g}" if p.deviation else "") + f" {p.unit}"
        cells = []
        for model in _MODELS:
            value = claim.predictions.get(model)
            z = None if value is None else claim.z(value)
            cells.append("" if value is None else f"{value:.3g}" + ("" if z is None else f" (z {z:+.1f})"))
        verdicts = [claim.verdict(value).value for value in claim.predictions.values()]
        lines.append((claim.name, measured, *cells, "; ".join(dict.fromkeys(verdicts))))
    return Table("Predicted", ("printed number", "paper", *_MODELS, "verdict"), tuple(lines))


def _unpredicted(claims: Sequence[Claim]) -> Table:
    lines = [(c.name, f"{c.printed.value:g} {c.printed.unit}", c.printed.where, c.why) for c in claims]
    return Table("Not predicted", ("printed number", "paper", "where", "why not"), tuple(lines))


def _sensitivity(assumed: Sequence[Sensitivity]) -> Table:
    lines = [(s.quantity, s.key, _range(s), s.low, s.as_is, s.high) for s in assumed]
    header = ("prediction of the rods", "assumed input", "varied by", "at the low end", "as it is", "at the high end")
    return Table("What the assumed inputs do", header, tuple(lines))


def _range(s: Sensitivity) -> str:
    return "plane strain" if s.factors == (1.0, 1.0) else f"{s.factors[0]:g} to {s.factors[1]:g} times"


def _as_row(s: Sensitivity) -> dict[str, object]:
    return {
        "quantity": s.quantity,
        "input": s.key,
        "varied": _range(s),
        "low": s.low,
        "as_is": s.as_is,
        "high": s.high,
    }


def _draw(
    design: Design, claims: Sequence[Claim], assumed: Sequence[Sensitivity], figures: Path
) -> list[tuple[Path, str]]:
    beside, storm = figures / "validation.png", figures / "sensitivity.png"
    rows = [(c.name, c.printed.value, c.printed.deviation, c.predictions) for c in claims if c.predictions]
    beside_measured(beside, rows, title=f"{design.name}: predicted over printed")
    panels: dict[str, list[tuple[str, float, float]]] = {}
    for s in assumed:
        if s.low is not None and s.high is not None:
            change = (s.key, s.low / s.as_is - 1.0, s.high / s.as_is - 1.0)
            panels.setdefault(s.quantity, []).append(change)
    tornado(storm, panels, title="What assumed inputs do to the rods' predictions")
    return [
        (beside, "Predictions over printed values; grey: one deviation of the measurement."),
        (storm, "Change of a prediction with each assumed input at both ends of its range."),
    ]
