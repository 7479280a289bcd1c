"""The picture of where a muscle presses on its pillars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem_biobot.view.machine import EDGE, GEL, Array, Ints, Machine, Shape
from fem_biobot.view.scene import Bar, Layer, Panel, Picture
from fem_biobot.view.surface import feature_edges
from fem_biobot.vtk import boundary_surface

_LIFT = 2e-3  # of the body's length, by which the footprint is drawn in front of the gel


@dataclass(frozen=True)
class Pressed:
    """A state with the pressure on its pillars.

    Attributes
    ----------
    shape
        The machine in this state.
    points, triangles, pressure
        Of the surface that bears the muscle, in the state as it was solved, (3, c) [mm], (3, f), (c,) [kPa].
    """

    shape: Shape
    points: Array
    triangles: Ints
    pressure: Array


def footprint_pictures(machine: Machine, states: Sequence[Pressed]) -> list[Picture]:
    """``footprint_<key>`` for each state: the gel from two sides, its pillars coloured by pressure, on one bar."""
    if not states:
        return []
    top = max(float(each.pressure.max(initial=0.0)) for each in states)
    bar = Bar("pressure of the muscle on the pillars [kPa]", (0.0, top or 1.0), "stress")
    cells = machine.split[1][:, ~machine.muscle]
    gel = boundary_surface(cells)
    edges = feature_edges(machine.points[:, machine.split[0]], gel)
    pictures = []
    for each in states:
        drawn = (machine.points + each.shape.displacement)[:, machine.split[0]]
        pressed = each.triangles[:, (each.pressure[each.triangles] > 0.0).any(axis=0)]
        corners = each.points[:, each.triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
        normal /= np.linalg.norm(normal, axis=0)
        lift = np.zeros_like(each.points)
        for k in range(3):
            np.add.at(lift.T, each.triangles[k], normal.T)
        lift *= _LIFT * float(np.ptp(machine.points[0])) / np.linalg.norm(lift, axis=0)
        layers = [
            Layer(drawn, gel, colour=GEL, edges=edges, edge_colour=EDGE, edge_width=0.8),
            Layer(each.points + lift, pressed, values=np.maximum(each.pressure, 0.0), lit=False),
        ]
        panels = [Panel(layers, "iso_below", "from the right"), Panel(layers, "iso_below_left", "from the left")]
        title = f"{machine.name}: pressure on the pillars, {each.shape.label}"
        pictures.append(Picture(f"footprint_{each.shape.key}", title, panels, bar))
    return pictures
