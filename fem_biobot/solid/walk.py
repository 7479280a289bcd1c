"""Walking of the solid itself: a design's mesh stands on the ground, is driven, and what it does is a `SolidWalk`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from fem_biobot.design import Design
from fem_biobot.errors import DesignError, MeshError, SolveError
from fem_biobot.friction.ground import Ground
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.muscle.waveforms import drive_function
from fem_biobot.solid.dynamics.body import GRAVITY, MovingBody, moving_body
from fem_biobot.solid.dynamics.feet import Feet, feet_of
from fem_biobot.solid.dynamics.integrate import solid_dynamics
from fem_biobot.solid.dynamics.motion import SolidMotion, joined
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.from_design import densities, tension_step
from fem_biobot.solid.gait import SolidWalk
from fem_biobot.solid.happenings import fall, happened
from fem_biobot.solid.medium import surface_drag
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.records import Step
from fem_biobot.solid.standing import FEET, Standing, stand

_SAMPLES = 50  # in a stroke, where the step allows it
_TRANSIENT = 1.0  # s, in whole strokes, left out of means; at most half of the walk


def refuse_unwalkable(design: Design) -> None:
    """Refuse a design whose solid cannot walk, before anything is meshed or written."""
    if design.kind != "bot":
        raise DesignError(f"kind: found {design.kind}, expected bot for a solid that walks")
    if design.value("muscle.reference") == "remodelled":
        raise DesignError("muscle.reference: found remodelled, expected as_moulded for a solid that walks")


def walking_body(design: Design, mesh: BodyMesh) -> MovingBody:
    """A design's mesh, free of supports, with its weight less buoyancy, its viscosity and the drag of the medium."""
    refuse_unwalkable(design)
    for name in FEET:
        if name not in mesh.surfaces:
            raise MeshError(f"{name}: found no such surface in the mesh, expected one for the machine to stand on")
    medium = design.ground.medium_density if design.ground.immersion == "submerged" else 0.0
    model = SolidModel.from_design(design, mesh)
    return moving_body(
        model, densities(design), gravity=GRAVITY, medium_density=medium, damping_time=design.numerics.damping_time,
        free=True, drag=surface_drag(design, model),
    )  # fmt: skip


def solid_ground(design: Design) -> Ground:
    """The design's ground: a level plane at z = 0 with its two coefficients."""
    return Ground(design.ground.static_friction, design.ground.kinetic_friction)


def solid_walk(
    design: Design,
    mesh: BodyMesh | MovingBody,
    *,
    frequency: float | None = None,
    duration: float | None = None,
    amplitude: float | None = None,
    step: float | None = None,
    discard: int | None = None,
    sample_every: int | None = None,
    settings: DynamicsSettings | None = None,
    feet: Feet | None = None,
    start: Standing | None = None,
    before: Sequence[SolidMotion] = (),
    listener: Callable[[float], None] | None = None,
    keeper: Callable[[SolidMotion], None] | None = None,
) -> SolidWalk:
    """Walk of a design's solid over its ground.

    Parameters
    ----------
    design
        A bot, tissue as moulded.
    mesh
        Its mesh, or the `walking_body` made of it.
    frequency, duration, amplitude, step
        Strokes per second [Hz], driven time [s], largest drive [1], time step [s]; by default the design's.
    discard
        Strokes left out of means at the beginning. By default those of the first second, at most half.
    sample_every
        Steps between samples; by default as many as leave about 50 samples to a stroke.
    settings
        Of the integrator; by default ``soft_landing``, see `solid.dynamics.settings.Scheme`.
    feet
        Points that touch the ground; by default all of both soles.
    start
        How the machine stands, on the same points; found first by default.
    before
        Motions that `keeper` was given before an interruption, in order: the walk goes on from the last of them.
    listener
        Told the time reached after each sample [s].
    keeper
        Given the motion of each stroke when it is done.

    Returns
    -------
    SolidWalk
        Up to `duration`, or to where the machine overturned.

    Raises
    ------
    DesignError, MeshError
        A design that cannot walk as a solid; a mesh without feet.
    SolveError
        A step that cannot be made; `best` is the `SolidWalk` up to there.
    """
    refuse_unwalkable(design)
    body = mesh if isinstance(mesh, MovingBody) else walking_body(design, mesh)
    frequency = design.drive.frequency if frequency is None else frequency
    duration = design.drive.duration if duration is None else duration
    amplitude = design.drive.amplitude if amplitude is None else amplitude
    step = design.numerics.step if step is None else step
    for key, value, unit in (("frequency", frequency, "Hz"), ("duration", duration, "s"), ("step", step, "s")):
        if not (math.isfinite(value) and value > 0.0):
            raise DesignError(f"walk: {key}: found {value!r}, expected a number above 0 {unit}")
    per_stroke = max(1, round(1.0 / (frequency * step)))
    step = 1.0 / (frequency * per_stroke)  # strokes end with steps
    driven = drive_function(design.drive, frequency, amplitude)
    driven.check_step(step)
    ground = solid_ground(design)
    settings = settings or DynamicsSettings(Scheme.soft_landing)
    clock = time.process_time()
    feet = feet or feet_of(body, FEET)
    stood = start or stand(design, body, ground, feet=feet, settings=settings)
    if sample_every is None:
        sample_every = max(1, per_stroke // _SAMPLES)

    def drive(t: float) -> Step:
        return replace(tension_step(design, design.tension(driven(t))), time=t)

    motions = list(before)

    def made() -> SolidWalk:
        motion = joined(motions)
        strokes = math.floor((motion.times[-1] - motion.times[0]) * frequency + 1e-6)
        left_out = min(math.ceil(_TRANSIENT * frequency - 1e-9), strokes // 2) if discard is None else discard
        spent = time.process_time() - clock
        return SolidWalk(
            motion, design, frequency, driven.size, driven.description.waveform, step, left_out, stood,
            happened(motion), wall_time=spent,
        )  # fmt: skip

    total = max(1, round(duration / step))
    done = round(motions[-1].final.time / step) if motions else 0
    while done < total and not (motions and fall(motions[-1]) is not None):
        count = min((done // per_stroke + 1) * per_stroke, total) - done
        try:
            motion = solid_dynamics(
                body, count * step, step, ground=ground, feet=feet, drive=drive,
                start=motions[-1].final if motions else stood.checkpoint, sample_every=sample_every,
                settings=settings, listener=listener,
            )  # fmt: skip
        except SolveError as error:
            motions.append(error.best)
            raise SolveError(f"walk: {error}", best=made(), reason=error.reason, why=error.why) from None
        motions.append(motion)
        done += count
        if keeper is not None:
            keeper(motion)
    return made()
