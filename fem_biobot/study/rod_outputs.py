"""Files of rods in motion: surfaces over time for ParaView, graphs of a walk, the animated gait."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import FileError
from fem_biobot.files import file_error
from fem_biobot.rod.dynamics.integrate import Motion
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.tube_fields import (
    KINDS,
    TOUCH,
    contact_fields,
    face_fields,
    line_fields,
    part_names,
    resultants,
)
from fem_biobot.rod.tubes import Piece, contact_points, ground_square, pieces
from fem_biobot.strokes import CAMERA_RATE
from fem_biobot.study.views import is_tissue
from fem_biobot.view.animation import Silhouette, Trail, write_gait
from fem_biobot.view.gait import Foot, energy_book, foot_forces, position
from fem_biobot.view.machine import GEL, MUSCLE
from fem_biobot.vtk import write_pvd, write_vtp

Array = NDArray[np.float64]

MOST_STATES = 200  # of a series, unless more are asked for
_SHOWN = 2.0  # s of a walk in an animation, in whole strokes
_RATE = 25.0  # frames a second


def write_rod_series(
    folder: Path, motion: Motion, every: int | None = None, *, name: str = "rod", most: int = MOST_STATES
) -> list[Path]:
    """A motion for ParaView: three series on the motion's times.

    ``rod.pvd`` has the surfaces of rods, bodies and muscles with their fields; ``rod_lines.pvd`` the centre lines with
    directors and resultants as vectors; ``rod_contacts.pvd`` the contact points with the ground's forces as vectors.
    Their states, and ``ground.vtp``, are in the folder ``rod``.

    Parameters
    ----------
    folder
        An existing folder.
    motion
        What is written.
    every
        Samples from one state to the next; as many as leave at most `most` states by default.
    name
        Instead of ``rod`` in all names.
    most
        Limit of the states.

    Returns
    -------
    list
        The series' files; without contacts where there is no ground.

    Raises
    ------
    FileError
        `every` is below 1; a file cannot be written.
    """
    count = len(motion.times)
    every = math.ceil(count / most) if every is None else every
    if every < 1:
        raise FileError(f"{folder}: every: found {every}, expected a whole number of at least 1")
    states = folder / name
    try:
        states.mkdir(exist_ok=True)
    except OSError as error:
        raise file_error(error, states) from None
    model, ground = motion.model, motion.ground
    parts = pieces(model)
    sizes = [piece.points(motion.x[0], motion.Q[0]).shape[1] for piece in parts]
    triangles = np.hstack(
        [p.triangles + first for p, first in zip(parts, np.cumsum([0, *sizes[:-1]]), strict=True)]
    )  # fmt: skip
    names = {"part_names": part_names(model), "kind_names": KINDS}
    feet = {"foot_names": [str(group.part) for group in model.contacts], "touch_names": TOUCH}
    entries: dict[str, list[tuple[float, str]]] = {"": [], "_lines": [], "_contacts": []}
    for number, i in enumerate(range(0, count, every)):
        state = motion.state(i)
        found = resultants(state)
        stem, time = f"{number:04d}.vtp", float(motion.times[i])
        surface = np.hstack([piece.points(state.x, state.Q) for piece in parts])
        write_vtp(
            states / f"rod_{stem}", surface, triangles, cell_data=face_fields(state, parts, found), names=names
        )  # fmt: skip
        entries[""].append((time, f"{name}/rod_{stem}"))
        line = line_fields(state, found)
        write_vtp(
            states / f"lines_{stem}", line.points, lines=list(line.lines.T), point_data=line.point_data,
            cell_data=line.cell_data, names=names,
        )  # fmt: skip
        entries["_lines"].append((time, f"{name}/lines_{stem}"))
        if ground is not None:
            points, fields = contact_fields(motion, i)
            write_vtp(
                states / f"contacts_{stem}", points, vertices=np.arange(points.shape[1]), point_data=fields, names=feet
            )
            entries["_contacts"].append((time, f"{name}/contacts_{stem}"))
    if ground is not None:
        ends = np.hstack([p.points(motion.x[[0, -1]], motion.Q[[0, -1]]).swapaxes(0, 1).reshape(3, -1) for p in parts])
        write_vtp(states / "ground.vtp", ground_square(ground, ends), np.arange(4)[:, None])
    files = []
    for suffix, series in entries.items():
        if series:
            files.append(folder / f"{name}{suffix}.pvd")
            write_pvd(files[-1], series)
    return files


def draw_walk(figures: Path, walk: Walk, label: str, *, animated: bool = True) -> list[tuple[Path, str]]:
    """Graphs of one walk and its animation, with captions; `label` is a word for file names.

    Files ``walk_<label>.png``, ``feet_<label>.png``, ``energy_<label>.png`` and ``gait_<label>.gif``; a walk without a
    whole stroke has no feet and no animation.
    """
    motion, name = walk.motion, f"{walk.frequency:g} Hz"
    out: list[tuple[Path, str]] = [(figures / f"walk_{label}.png", "")]
    camera = walk.camera()
    position(
        out[-1][0], walk.times, walk.advance, tip_closing=walk.tip_closing, strokes=walk.stroke_ends,
        discarded=walk.kept.start, camera=camera if len(camera[0]) > 1 else None, title=f"Walk at {name}",
    )  # fmt: skip
    out[-1] = (out[-1][0], f"Position and tip closing at {name}; dots: as a camera of {CAMERA_RATE:g} frames a second.")
    if walk.strokes:
        begin, end = (float(t) for t in walk.stroke_ends[-2:])
        feet = {
            foot: Foot(walk.foot_force[:, k, 0], walk.foot_force[:, k, 1], walk.foot_state[:, k])
            for k, foot in enumerate(walk.anatomy.feet)
        }
        kinetic = walk.ground.kinetic_coefficients
        out.append((figures / f"feet_{label}.png", f"Forces on the feet over the last stroke at {name}."))
        foot_forces(
            out[-1][0], walk.times, feet, period=(begin, end), friction=[float(kinetic[1]), float(kinetic[0])],
            drive=motion.drive, title=f"Forces on the feet over a stroke at {name}",
        )  # fmt: skip
    stored = {key: motion.energy(key) for key in ("kinetic", "elastic", "weight")}
    work = {key: motion.energy(key) for key in ("muscle", "damping", "friction", "normal", "loads", "integrator")}
    work = {key: values for key, values in work.items() if np.ptp(values) > 0.0}
    out.append((figures / f"energy_{label}.png", f"Energy stored, work on the machine, and the rest, at {name}."))
    energy_book(
        out[-1][0], walk.times, stored, work, motion.energy_error, strokes=walk.stroke_ends, title=f"Energy at {name}"
    )
    if animated and walk.strokes:
        out.append((figures / f"gait_{label}.gif", f"Gait at {name}, at life's speed, and the way of the feet."))
        draw_gait(out[-1][0], walk)
    return out


def draw_gait(
    path: Path, walk: Walk, *, shown: float = _SHOWN, rate: float = _RATE, slow: float = 1.0, width: int = 900
) -> int:
    """Animation of a walk's last whole strokes, at least one and otherwise as many as `shown` seconds hold.

    `rate` frames per second of the machine's time; see `write_gait`. Returns the number of frames.
    """
    motion, ends = walk.motion, walk.stroke_ends
    strokes = min(walk.strokes, max(1, math.floor(shown * walk.frequency + 1e-9)))
    if strokes < 1:
        raise FileError(f"{path}: found a walk without a whole stroke, expected at least one to animate")
    inside = (walk.times >= ends[-1 - strokes] - 1e-9) & (walk.times <= ends[-1] + 1e-9)
    x, Q, times = motion.x[inside], motion.Q[inside], walk.times[inside]
    normal, forward, _ = walk.ground.axes
    plane = np.array([forward, normal])
    strongest = max(float(motion.drive.max()), 1e-300)
    parts = []
    lateral = walk.ground.axes[2]
    seen_from_right = sorted(
        pieces(walk.model),
        # what stands further right is in front; parts of one plane as they are layered
        key=lambda piece: (-round(float((lateral @ piece.points(x[0], Q[0])).mean()), 6), _layer(piece)),
    )
    for piece in seen_from_right:
        tissue = is_tissue(piece)
        glow = motion.drive[inside] / strongest if piece.kind == "muscle" else None
        seen = np.einsum("ac,tcp->tap", plane, piece.points(x, Q))
        parts.append(Silhouette(seen, piece.triangles, MUSCLE if tissue else GEL, glow))
    touching = contact_points(walk.model, walk.ground, x, Q) @ plane.T
    feet = {}
    for k, name in enumerate(walk.anatomy.feet):
        corners, middle = walk.anatomy.corners[k], walk.foot_path[inside, k] @ plane.T
        borne = motion.contact_force[inside][:, corners, 0]
        total = borne.sum(axis=1)[:, None]
        centre = np.einsum("tc,tca->ta", borne, touching[:, corners]) / np.where(total > 0.0, total, 1.0)
        force = walk.foot_force[inside, k][:, 1::-1]
        base = np.where(total > 0.0, centre, middle)
        feet[name] = Trail(middle, walk.foot_state[inside, k], force, base)
    return write_gait(
        path, times, parts, feet, ground=walk.ground.height, rate=rate, slow=slow, weight=walk.weight_mN, width=width,
        title=f"{walk.design.name if walk.design else 'Gait'} at {walk.frequency:g} Hz"
        + (f", {slow:g} times slower" if slow != 1.0 else ""),
    )  # fmt: skip


def _layer(piece: Piece) -> int:
    """Order from back to front in one plane: rods, muscles, bodies, and the tissue around them."""
    return 3 if piece.name.startswith("ring") else ("rod", "muscle", "body").index(piece.kind)
