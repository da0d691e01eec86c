"""Both axes' inverses on a stream of blocks, within the amplifier's limits."""

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from attrs import frozen

from afm_scan_ros.core.coupling import Coupling, InverseState
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.effects.optimal_inverse import OptimalInverses
from afm_scan_ros.core.effects.slew_limit import TooSteepError
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scanner import compensator
from afm_scan_ros.core.types import AXES, Array, Trace

AT_ONCE = 2**15
"""Samples of a whole scan inverted at once: the cache holds both axes', and all inverses' work."""


DRIVE, VIBRATION, CREEP, OUTPUT = range(4)
"""Places of a compensator's cascade."""

Pair = Sequence[Array]
"""Samples of x and of y."""
NOTHING: Array = np.empty(0)


@frozen(eq=False)
class Progress:
    """How far a stream has come: the next drive sample, and the last drive (V) of each axis.

    Between them are the states of what is inverted, in that order. ``ahead`` is what both axes are
    to do together and is known of one, but not yet of the other.
    """

    next_sample: int
    output: Sequence[Any]
    ahead: Pair
    coupling: InverseState
    creep: Sequence[Any]
    vibration: Any
    hysteresis: Sequence[Any]
    drive: dict[str, float]


class Compensation:
    """Desired displacement (m) in, drive (V) out, some samples later; the state is passed in.

    ``invert`` and ``finish`` raise ScanError naming sample, axis and value where the drive would
    leave the model's identified range or the amplifier's limits.
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
        self._effects = [
            compensator(model.axis(name), sample_period, chosen, settings).effects for name in AXES
        ]
        self._coupling = Coupling(model, sample_period, AXES if chosen else ())
        self._sample_period = sample_period
        self._limits = limits

    @cached_property
    def _vibration(self) -> OptimalInverses | None:
        """Both axes' inverses, which share a transform, where vibration is inverted."""
        vibrations = [effects[VIBRATION] for effects in self._effects]
        inverses = [each.inverse for each in vibrations if isinstance(each, Vibration)]
        return OptimalInverses(inverses) if inverses else None

    def at_rest(self) -> Progress:
        """Return the progress before the first block."""
        rest = [[effect.inverse_at_rest() for effect in effects] for effects in self._effects]
        drive, apart, creep, output = zip(*rest, strict=True)
        vibration = self._vibration.at_rest() if self._vibration else apart
        nothing, still = (NOTHING, NOTHING), dict.fromkeys(AXES, 0.0)
        coupling = self._coupling.inverse_at_rest()
        return Progress(0, output, nothing, coupling, creep, vibration, drive, still)

    def invert(self, before: Progress, desired: Trace) -> tuple[Progress, Trace]:
        """Return the progress after a block, and the drive that is known by then."""
        output, both = self._each(OUTPUT, before, before.output, (desired.x, desired.y))
        ahead, both = _in_step(before.ahead, both)
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
        _, _, targets = self._of_itself(before, _in_step(before.ahead, owed)[1])
        vibration, inputs = self._against_vibration(before, targets)
        if self._vibration:
            held = self._vibration.finish(vibration)
            inputs = [np.concatenate(parts) for parts in zip(inputs, held, strict=True)]
        _, drive = self._each(DRIVE, before, before.hysteresis, inputs)
        return self._within_limits(before, drive)[0]

    def _of_itself(self, before: Progress, both: Pair) -> tuple[InverseState, Sequence[Any], Pair]:
        """States after, and what vibration is to follow for what both axes are to do together."""
        target = Trace(before.next_sample, self._sample_period, *both)
        coupling, own = self._coupling.invert(before.coupling, target)
        creep, targets = self._each(CREEP, before, before.creep, (own.x, own.y))
        return coupling, creep, targets

    def _each(
        self, place: int, before: Progress, states: Sequence[Any], blocks: Pair
    ) -> tuple[Sequence[Any], Pair]:
        """Invert one effect of each axis by itself."""
        after, results = [], []
        for name, effects, state, block in zip(AXES, self._effects, states, blocks, strict=True):
            try:
                new, result = effects[place].invert(state, block)
            except (BeyondRangeError, TooSteepError) as error:
                raise _named(error, name, before) from error
            after.append(new)
            results.append(result)
        return after, results

    def _against_vibration(self, before: Progress, targets: Pair) -> tuple[Any, Pair]:
        if self._vibration:
            return self._vibration.invert(before.vibration, targets)
        return self._each(VIBRATION, before, before.vibration, targets)

    def _within_limits(self, before: Progress, drive: Pair) -> tuple[Trace, dict[str, float]]:
        """Return the drive, and its last sample (V) of each axis."""
        x, y = drive
        trace = Trace(before.next_sample, self._sample_period, x, y)
        if not len(x):
            return trace, before.drive
        self._limits.refuse_beyond(trace, before.drive)
        return trace, {"x": float(x[-1]), "y": float(y[-1])}

    def whole(self, desired: Trace) -> Trace:
        """Return the drive of a whole scan from its first sample."""
        whole = {name: np.empty(len(desired.x)) for name in AXES}
        for drive in self._blocks(desired):
            last = drive.first_sample + len(drive.x)
            for name in AXES:
                whole[name][drive.first_sample : last] = drive.axis(name)
        return Trace(0, self._sample_period, whole["x"], whole["y"])

    def _blocks(self, desired: Trace) -> Iterator[Trace]:
        progress = self.at_rest()
        for first in range(0, len(desired.x), AT_ONCE):
            x, y = (desired.axis(name)[first : first + AT_ONCE] for name in AXES)
            progress, drive = self.invert(progress, Trace(first, self._sample_period, x, y))
            yield drive
        yield self.finish(progress)


def _in_step(ahead: Pair, blocks: Pair) -> tuple[Pair, Pair]:
    """Return what is known of one axis only, and what is known of both by now."""
    x, y = map(_joined, ahead, blocks)
    count = min(len(x), len(y))
    return (_after(count, x), _after(count, y)), (x[:count], y[:count])


def _joined(first: Array, then: Array) -> Array:
    return np.concatenate((first, then)) if len(first) else then


def _after(count: int, samples: Array) -> Array:
    """Return the samples after so many, which keeps nothing of those before."""
    return samples[count:].copy() if len(samples) > count else NOTHING


def _named(error: BeyondRangeError | TooSteepError, axis: str, before: Progress) -> ScanError:
    """Say which axis and which sample of the scan it is that left what was identified."""
    sample = before.next_sample + error.sample
    if isinstance(error, BeyondRangeError):
        return ScanError(
            f"sample {sample}, axis {axis}: effective input {error.value:.6g} V is beyond the"
            f" identified {error.limit:.6g} V: scan a smaller range or more slowly"
        )
    return ScanError(
        f"sample {sample}, axis {axis}: a drive of {error.value:.6g} V/s is beyond the slew limit"
        f" found, {error.limit:.6g} V/s: scan a smaller range or more slowly, or give turnaround"
        " and y_step more time"
    )
