"""Pictures of predictions beside measurements, and of what assumed inputs do to them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

from fem_biobot.view.graph import COLOURS, INK, SOFT, legend, name_axes, save, side_by_side


def beside_measured(
    path: str | os.PathLike[str],
    rows: Sequence[tuple[str, float, float | None, Mapping[str, float]]],
    *,
    title: str,
) -> None:
    """Predictions over the printed value, one line a number: grey is one deviation of the measurement.

    Parameters
    ----------
    path
        PNG file.
    rows
        Name, printed value (not zero), its deviation, and predictions by model.
    title
        Above the picture.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    figure, (axes,) = side_by_side(1, (8.4, 1.2 + 0.3 * len(rows)))
    models = list(dict.fromkeys(model for *_, predictions in rows for model in predictions))
    for line, (_, printed, deviation, predictions) in enumerate(rows):
        if deviation:
            share = deviation / abs(printed)
            axes.barh(line, 2.0 * share, left=1.0 - share, height=0.7, color=SOFT, alpha=0.35)
        for model, value in predictions.items():
            number = models.index(model)
            axes.plot(value / printed, line, "os^"[number], color=COLOURS[number], markersize=5.5)
    for number, model in enumerate(models):
        axes.plot([], [], "os^"[number], color=COLOURS[number], markersize=5.5, label=model)
    axes.axvline(1.0, color=INK, linewidth=0.9)
    axes.set_yticks(range(len(rows)), [name for name, *_ in rows], fontsize=8)
    axes.invert_yaxis()
    name_axes(axes, "predicted over printed [1]", "")
    legend(axes)
    save(figure, path, title)


def tornado(
    path: str | os.PathLike[str],
    panels: Mapping[str, Sequence[tuple[str, float, float]]],
    *,
    title: str,
) -> None:
    """What each input does to a prediction, the largest first.

    Parameters
    ----------
    path
        PNG file.
    panels
        Name of the prediction to the inputs' names and the relative changes at both ends of their ranges [1].
    title
        Above the panels.

    Raises
    ------
    FileError
        The file cannot be written.
    """
    figure, axes = side_by_side(len(panels), (4.6 * len(panels), 3.4))
    for each, (name, rows) in zip(axes, panels.items(), strict=True):
        ordered = sorted(rows, key=lambda row: max(abs(row[1]), abs(row[2])), reverse=True)
        for line, (_, low, high) in enumerate(ordered):
            each.barh(line, 100.0 * low, height=0.7, color=COLOURS[0])
            each.barh(line, 100.0 * high, height=0.7, color=COLOURS[1])
        each.axvline(0.0, color=INK, linewidth=0.9)
        each.set_yticks(range(len(ordered)), [label for label, *_ in ordered], fontsize=7.5)
        each.invert_yaxis()
        each.set_title(name, fontsize=8.5, color=INK)
        name_axes(each, "change [%]", "")
    save(figure, path, title)
