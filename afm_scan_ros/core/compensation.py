"""The inverses of a model's axes on a stream of blocks, within the amplifier's limits."""

from collections.abc import Generator, Iterable, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from attrs import frozen

from afm_scan_ros.core.correction import Correction, Stop
from afm_scan_ros.core.effects.optimal_inverse import OptimalInverses
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.errors import SampleError, ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scan_spec import SMALLEST_RANGE, ScanSpec
from afm_scan_ros.core.scanner import Coupling, InverseState, chain_of
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import AXES, Array, Trace

AT_ONCE = 2**15
"""Samples of a whole scan inverted at once: the cache holds both axes', and all inverses' work."""


DRIVE, VIBRATION, CREEP, OUTPUT = range(4)
"""Places of a compensator's cascade."""

Blocks = Sequence[Array]
"""Samples of each axis that the model holds."""
NOTHING: Array = np.empty(0)


@frozen(eq=False)
class Progress:
    """States of the inverses, last drives (V), and samples that are ``ahead`` of the other axis."""

    next_sample: int
    output: Sequence[Any]
    ahead: Blocks
    coupling: InverseState
    creep: Sequence[Any]
    vibration: Any
    hysteresis: Sequence[Any]
    drive: dict[str, float]


class Compensation:
    """Desired displacement (m) in, drive (V) out, some samples later; the state is passed in.

    ``invert`` and ``finish`` raise ScanError naming sample, axis and value where the drive would
    leave the identified range or the limits, and where an axis that the model lacks is to move.
    """

    def __init__(
        self,
        model: ScannerModel,
        sample_period: float,
        inverses: Iterable[str],
        settings: InverseSettings,
        limits: DriveLimits,
    ) -> None:
        chosen = frozenset(inverses)
        self._axes = model.axes
        self._effects = [
            chain_of(model.axis(name)).compensator(sample_period, chosen, settings).effects
            for name in self._axes
        ]
        self._coupling = Coupling(model, sample_period, self._axes if chosen else ())
        self._sample_period = sample_period
        self._limits = limits

    @cached_property
    def _vibration(self) -> OptimalInverses | None:
        """The axes' inverses, which share a transform, where vibration is inverted."""
        vibrations = [effects[VIBRATION] for effects in self._effects]
        inverses = [each.inverse for each in vibrations if isinstance(each, Vibration)]
        return OptimalInverses(inverses) if inverses else None

    @cached_property
    def held_back(self) -> int:
        """Samples by which the drive that is known lags behind the desired displacement."""
        count = 0
        drive = Trace(0, self._sample_period, NOTHING, NOTHING)
        while not len(drive.x):
            count = 2 * count + 1
            still = np.zeros(count)
            _, drive = self.invert(self.at_rest(), Trace(0, self._sample_period, still, still))
        return count - len(drive.x)

    def at_rest(self) -> Progress:
        """Return the progress before the first block."""
        rest = [[effect.inverse_at_rest() for effect in effects] for effects in self._effects]
        drive, apart, creep, output = zip(*rest, strict=True)
        vibration = self._vibration.at_rest() if self._vibration else apart
        nothing, still = [NOTHING] * len(self._axes), dict.fromkeys(AXES, 0.0)
        coupling = self._coupling.inverse_at_rest()
        return Progress(0, output, nothing, coupling, creep, vibration, drive, still)

    def invert(self, before: Progress, desired: Trace) -> tuple[Progress, Trace]:
        """Return the progress after a block, and the drive that is known by then."""
        output, both = self._each(OUTPUT, before, before.output, self._own(desired))
        ahead, both = _common(before.ahead, both)
        coupling, creep, targets = self._of_itself(before, both)
        vibration, inputs = self._against_vibration(before, targets)
        hysteresis, drive = self._each(DRIVE, before, before.hysteresis, inputs)
        trace, last = self._within_limits(before, drive)
        following = before.next_sample + len(trace.x)
        return Progress(
            following, output, ahead, coupling, creep, vibration, hysteresis, last
        ), trace

    def finish(self, before: Progress) -> Trace:
        """Return the drive still owed after the last block."""
        ends = zip(self._effects, before.output, strict=True)
        owed = [effects[OUTPUT].finish(state) for effects, state in ends]
        _, _, targets = self._of_itself(before, _common(before.ahead, owed)[1])
        vibration, inputs = self._against_vibration(before, targets)
        if self._vibration:
            held = self._vibration.finish(vibration)
            inputs = [np.concatenate(parts) for parts in zip(inputs, held, strict=True)]
        _, drive = self._each(DRIVE, before, before.hysteresis, inputs)
        return self._within_limits(before, drive)[0]

    def _own(self, desired: Trace) -> Blocks:
        """Take the axes that the model holds; raise ScanError where another is to move."""
        for name in AXES:
            if name not in self._axes and desired.axis(name).any():
                moving = np.flatnonzero(desired.axis(name))
                raise ScanError(
                    f"sample {desired.first_sample + moving[0]}, axis {name}: the model holds no"
                    f" axis {name}, which is to move: identify it too, or leave it at 0 m"
                )
        return [desired.axis(name) for name in self._axes]

    def _trace(self, first: int, blocks: Blocks) -> Trace:
        """Join the axes' samples, from sample ``first`` on, with zeros for an absent axis."""
        given = dict(zip(self._axes, blocks, strict=True))
        still = np.zeros(len(blocks[0]))
        return Trace(first, self._sample_period, *(given.get(name, still) for name in AXES))

    def _of_itself(
        self, before: Progress, both: Blocks
    ) -> tuple[InverseState, Sequence[Any], Blocks]:
        """States after, and what vibration is to follow for what both axes are to do together."""
        target = self._trace(before.next_sample, both)
        coupling, own = self._coupling.invert(before.coupling, target)
        creep, targets = self._each(CREEP, before, before.creep, self._own(own))
        return coupling, creep, targets

    def _each(
        self, place: int, before: Progress, states: Sequence[Any], blocks: Blocks
    ) -> tuple[Sequence[Any], Blocks]:
        """Invert one effect of each axis by itself."""
        after, results = [], []
        every = zip(self._axes, self._effects, states, blocks, strict=True)
        for name, effects, state, block in every:
            try:
                new, result = effects[place].invert(state, block)
            except SampleError as error:
                sample = before.next_sample + error.sample
                raise ScanError(f"sample {sample}, axis {name}: {error.problem}") from error
            after.append(new)
            results.append(result)
        return after, results

    def _against_vibration(self, before: Progress, targets: Blocks) -> tuple[Any, Blocks]:
        if self._vibration:
            return self._vibration.invert(before.vibration, targets)
        return self._each(VIBRATION, before, before.vibration, targets)

    def _within_limits(self, before: Progress, drive: Blocks) -> tuple[Trace, dict[str, float]]:
        """Return the drive, and its last sample (V) of each axis."""
        trace = self._trace(before.next_sample, drive)
        if not len(trace.x):
            return trace, before.drive
        self._limits.refuse_beyond(trace, before.drive)
        return trace, {"x": float(trace.x[-1]), "y": float(trace.y[-1])}

    def whole(self, desired: Trace) -> Trace:
        """Return the drive of a whole scan from its first sample."""
        x, y = zip(*((drive.x, drive.y) for drive in self._blocks(desired)), strict=True)
        return Trace(0, self._sample_period, np.concatenate(x), np.concatenate(y))

    def _blocks(self, desired: Trace) -> Iterator[Trace]:
        progress = self.at_rest()
        for first in range(0, len(desired.x), AT_ONCE):
            x, y = (desired.axis(name)[first : first + AT_ONCE] for name in AXES)
            progress, drive = self.invert(progress, Trace(first, self._sample_period, x, y))
            yield drive
        yield self.finish(progress)


def _common(ahead: Blocks, blocks: Blocks) -> tuple[Blocks, Blocks]:
    """Return the samples of one axis only, and those of all axes."""
    pairs = zip(ahead, blocks, strict=True)
    joined = [np.concatenate(pair) if len(pair[0]) else pair[1] for pair in pairs]
    count = min(len(each) for each in joined)
    left = [each[count:].copy() if len(each) > count else NOTHING for each in joined]  # no views
    return left, [each[:count] for each in joined]


BLOCK = 5000
"""Samples inverted at once: some 10 ms of work."""
RESOLUTION = 0.01
"""Of a range that is found."""
SEARCHED = 200_000
"""First samples of a scan by which ranges are searched; the result is checked on all of them."""
SHRINKAGE = 0.98
"""Factor on both ranges where a later sample needs more than those that were searched."""

Ranges = dict[str, float]
"""Range (m) of each axis."""


def preflight(
    compensation: Compensation, spec: ScanSpec, samples: int, learned: Correction | None = None
) -> Generator[str, None, None]:
    """Invert the first ``samples`` of a scan, with what was ``learned``; yield what is being done.

    Raises ScanError naming sample, axis and value where the drive leaves the range or a limit.
    """
    progress = compensation.at_rest()
    stop: Stop = None
    for first in range(0, samples, BLOCK):
        yield f"inverting the scan: sample {first} of {samples}"
        block = desired(spec, first, min(BLOCK, samples - first))
        if learned is not None:
            stop, block = learned.follow(stop, block)
        progress, _ = compensation.invert(progress, block)
    compensation.finish(progress)


def largest_ranges(
    compensation: Compensation, spec: ScanSpec, samples: int
) -> Generator[str, None, Ranges]:
    """Largest ranges (m) up to those of ``spec`` with which the scan's drive can be had.

    x is found first, with y at rest, and then y, each bisected to ``RESOLUTION``: at most 17
    inversions of ``SEARCHED`` samples, and one or a few of all. Empty where the preparation needs
    too much by itself. Yields what is being done, as ``preflight``.
    """
    samples = min(samples, total_samples(spec))
    found = dict.fromkeys(AXES, SMALLEST_RANGE)
    searched = min(samples, SEARCHED)
    if not (yield from _drivable(compensation, _ranged(spec, found), searched)):
        return {}
    for axis, asked in zip(AXES, (spec.range_x, spec.range_y), strict=True):
        low, high = SMALLEST_RANGE, asked
        trial = high
        while high - low > RESOLUTION * high:
            ranged = _ranged(spec, {**found, axis: trial})
            if (yield from _drivable(compensation, ranged, searched)):
                low = trial
            else:
                high = trial
            trial = 0.5 * (low + high)
        found[axis] = low
    while not (yield from _drivable(compensation, _ranged(spec, found), samples)):
        found = {axis: max(SMALLEST_RANGE, SHRINKAGE * each) for axis, each in found.items()}
    return found


def _drivable(
    compensation: Compensation, spec: ScanSpec, samples: int
) -> Generator[str, None, bool]:
    try:
        for _ in preflight(compensation, spec, samples):
            yield "finds the largest range"
    except ScanError:
        return False
    return True


def _ranged(spec: ScanSpec, ranges: Ranges) -> ScanSpec:
    return spec.resized(ranges["x"], ranges["y"])
