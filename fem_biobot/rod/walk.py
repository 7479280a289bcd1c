"""Walking: a machine stands, is driven, and what it does is returned as a `Walk`.

`walk` runs the implicit integrator stroke by stroke, so that a machine that falls is noticed, a caller can keep what is
done, and a walk that was interrupted goes on as if it had not been.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

from fem_biobot.design import Design
from fem_biobot.design_parts import Drive
from fem_biobot.errors import ModelError, SolveError
from fem_biobot.muscle.waveforms import DriveFunction, drive_function, drive_named
from fem_biobot.rod.anatomy import anatomy
from fem_biobot.rod.dynamics.integrate import Checkpoint, Integrator, Motion, Settings, dynamics
from fem_biobot.rod.events import cut, fall, happened, joined
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.published.course import beginning
from fem_biobot.rod.reduce import ground_of, reduce
from fem_biobot.rod.rest import Stance, stance

_SAMPLES = 100  # at least, in a stroke, where the step allows it
_TRANSIENT = 1.0  # s, in whole strokes, left out of means; at most half of the walk


def walk(
    machine: Design | RodModel,
    *,
    frequency: float | None = None,
    duration: float | None = None,
    amplitude: float | None = None,
    step: float | None = None,
    ground: Ground | None = None,
    waveform: str | Drive | None = None,
    beam_elements: int = 16,
    plate_factor: str = "none",
    discard: int | None = None,
    sample_every: int | None = None,
    settings: Settings | None = None,
    start: Stance | RodState | Checkpoint | None = None,
    rest: Stance | None = None,
    before: Sequence[Motion] = (),
    listener: Callable[[float], None] | None = None,
    keeper: Callable[[Motion], None] | None = None,
) -> Walk:
    """Walk of a machine over its ground.

    Parameters
    ----------
    machine
        A design, reduced with `beam_elements` and `plate_factor`, or a model with contact points and muscles.
    frequency, duration, amplitude, waveform, step
        Strokes per second [Hz], driven time [s], largest drive [1], shape of the drive, time step [s]. By default the
        design's; for a model 2 Hz, 5 s, 1, ``abs_sine`` and 1 ms. A waveform is a name, or a whole `Drive`, whose
        own frequency and amplitude then count where none are given beside it.
    ground
        By default the design's; for a model ``Ground()``.
    discard
        Strokes left out of means at the beginning. By default those of the first second, at most half.
    sample_every
        Steps between samples; by default as many as leave 100 samples to a stroke.
    settings
        Of the integrator; by default the design's largest error of a step, if it has one.
    start
        By default the machine first takes its standing shape and settles (`stance`); a published walker that starts as
        published begins as drawn. A `Stance` of the same model saves
        that; a `RodState` is begun from as it is; a `Checkpoint` (``motion.final``) goes on from where it was.
    rest
        With another start: the stance that stroke and sagitta are measured from; by default the first sample.
    before
        Motions that `keeper` was given before an interruption, in order: the walk goes on from the last of them up to
        `duration` in all, and they are part of it. `start` is then no more than the stance that they began from.
    listener
        Told the time reached after each sample [s].
    keeper
        Given the motion of each stroke when it is done; its ``final`` is a checkpoint to go on from.

    Returns
    -------
    Walk
        Up to `duration`, or to the event that ended it: a machine that overturned.

    Raises
    ------
    ModelError
        A frequency, duration or step that is not above zero, a step longer than a stroke, a model without contact
        points or muscles, a start inside the ground.
    SolveError
        A step that cannot be made; `best` is the `Walk` up to there.
    """
    design = machine if isinstance(machine, Design) else None
    given = waveform if isinstance(waveform, Drive) else design.drive if design else None
    frequency = _first(frequency, given.frequency if given else 2.0)
    duration = _first(duration, given.duration if given else 5.0)
    amplitude = _first(amplitude, given.amplitude if given else 1.0)
    step = _first(step, design.numerics.step if design else 1e-3)
    settings = settings or settings_of(design)
    _check_times(frequency, duration, amplitude, step)
    if isinstance(machine, Design):
        model = reduce(machine, beam_elements=beam_elements, plate_factor=plate_factor)
        ground = ground or ground_of(machine)
    else:
        model, ground = machine, ground or Ground()
    anatomy(model)  # refuses what cannot walk
    driven = _driven(waveform, given, frequency, amplitude)
    driven.check_step(step)
    drive: Callable[[float], float] = driven
    stood = start if isinstance(start, Stance) else rest
    if design is not None:
        drawn, drive = beginning(design, model, drive)
        start = drawn if start is None else start
    if start is None and not before:
        stood = start = stance(model, ground)
    begin = before[-1].final if before else start.state if isinstance(start, Stance) else start
    if sample_every is None:
        sample_every = _sampling(round(1.0 / (frequency * step)))
    first = begin.time if isinstance(begin, Checkpoint) else 0.0
    clock = time.thread_time()
    motions = list(before)

    def made() -> Walk:
        motion = joined(motions)
        strokes = math.floor((motion.times[-1] - motion.times[0]) * frequency + 1e-6)
        left_out = min(math.ceil(_TRANSIENT * frequency - 1e-9), strokes // 2) if discard is None else discard
        spent = time.thread_time() - clock
        name = driven.description.waveform
        events, notes = happened(motion), notes_of(ground, settings, step)
        return Walk(motion, frequency, driven.size, name, step, left_out, stood, design, events, notes, spent)

    left = duration - (first if before else 0.0)
    over = not before or fall(joined(motions)) is None
    for count in _strokes(first, left, frequency, step) if over else ():
        here = motions[-1].final if motions else begin
        assert not isinstance(here, Stance)
        try:
            motion = dynamics(
                model,
                count * step,
                step,
                ground=ground,
                drive=drive,
                start=here,
                sample_every=sample_every,
                settings=settings,
                listener=listener,
            )
        except SolveError as error:
            motions.append(error.best)
            raise SolveError(f"walk: {error}", best=made(), reason=error.reason) from None
        fallen = fall(motion)
        motions.append(motion if fallen is None else cut(motion, fallen))
        if keeper is not None:
            keeper(motions[-1])
        if fallen is not None:
            break
    return made()


def settings_of(design: Design | None) -> Settings:
    """Of the integrator, as a design asks for."""
    return Settings(largest_error=design.numerics.largest_error if design else None)


def notes_of(ground: Ground, settings: Settings, step: float) -> tuple[str, ...]:
    """What a walk is to be read with: that steps of one length, of `step` [s], may find gaits that shorter ones do not.

    So they do where friction jumps from static to kinetic; explicit steps are as short as any.
    """
    jumps = (ground.static_coefficients > ground.kinetic_coefficients).any()
    if not jumps or settings.largest_error is not None or settings.integrator is Integrator.explicit:
        return ()
    return (
        f"static friction is above kinetic and steps have one length, {1e3 * step:g} ms: what gait is found may depend "
        'on it; numerics.largest_error = "0.2 nm" with steps of 0.5 ms follows changes of contact',
    )


def _driven(waveform: str | Drive | None, given: Drive | None, frequency: float, amplitude: float) -> DriveFunction:
    """The drive asked for: another waveform by name, or as it is described."""
    return drive_function(
        drive_named(waveform) if isinstance(waveform, str) else given or Drive(), frequency, amplitude
    )


def _first(value: float | None, default: float) -> float:
    return default if value is None else value


def _check_times(frequency: float, duration: float, amplitude: float, step: float) -> None:
    limits = (("frequency", frequency, "Hz"), ("duration", duration, "s"), ("step", step, "s"))
    for name, value, unit in limits:
        if not (isinstance(value, int | float) and math.isfinite(value) and value > 0.0):
            raise ModelError(f"walk: {name}: found {value!r}, expected a number above 0 {unit}")
    if not (isinstance(amplitude, int | float) and math.isfinite(amplitude) and amplitude >= 0.0):
        raise ModelError(f"walk: amplitude: found {amplitude!r}, expected a number of at least 0")
    if step > 1.0 / frequency:
        raise ModelError(f"walk: step: found {step:g} s, expected at most the drive's period ({1.0 / frequency:g} s)")
    if step > duration:
        raise ModelError(f"walk: step: found {step:g} s, expected at most the duration ({duration:g} s)")


def _sampling(steps: int) -> int:
    """Largest number of steps between samples that divides a stroke of `steps` and leaves it enough samples."""
    most = max(1, steps // _SAMPLES)
    return next(n for n in range(most, 0, -1) if steps % n == 0 or n == 1)


def _strokes(first: float, duration: float, frequency: float, step: float) -> list[int]:
    """Steps from each stroke's end to the next, from the time `first` on; the same wherever one begins."""
    counts, last = [], round(duration / step)
    stroke = math.floor(first * frequency + 1e-6)
    done = 0
    while done < last:
        stroke += 1
        end = min(round((stroke / frequency - first) / step), last)
        if end > done:
            counts.append(end - done)
            done = end
    return counts
