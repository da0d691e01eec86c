"""Both axes' inverses on a stream of blocks, within the amplifier's limits."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.catalogue.slew_limit import TooSteepError
from afm_scan_ros.core.coupling import Coupling, States
from afm_scan_ros.core.effects.convolution import stream_together
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scanner import compensator
from afm_scan_ros.core.types import AXES, Array, Trace

AT_ONCE = 2**15
"""Samples of a whole scan inverted at once: the cache holds both axes', and all inverses' work."""


DRIVE, VIBRATION, OUTPUT = range(3)
"""Places of a compensator's cascade."""

Blocks = dict[str, Array]
"""Of each axis."""


@frozen(eq=False)
class Progress:
    """How far a stream has come: next drive sample, states and last drive (V) of each axis.

    ``ahead`` is drive (V) that is known of an axis and not yet of the other.
    """

    next_sample: int
    coupling: States
    states: dict[str, Any]
    drive: dict[str, float]
    ahead: dict[str, Array]


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
        self._cascades = {
            name: compensator(model.axis(name), sample_period, chosen, settings) for name in AXES
        }
        vibrations = [cascade.effects[VIBRATION] for cascade in self._cascades.values()]
        self._vibrations = [each for each in vibrations if isinstance(each, Vibration)]
        self._coupling = Coupling(model, sample_period, AXES if chosen else ())
        self._sample_period = sample_period
        self._limits = limits

    def at_rest(self) -> Progress:
        """Return the progress before the first block."""
        states = {name: cascade.inverse_at_rest() for name, cascade in self._cascades.items()}
        ahead = {name: np.empty(0) for name in AXES}
        return Progress(0, self._coupling.at_rest(), states, dict.fromkeys(AXES, 0.0), ahead)

    def invert(self, before: Progress, desired: Trace) -> tuple[Progress, Trace]:
        """Return the progress after a block, and the drive that is known by then."""
        coupling, own = self._coupling.invert(before.coupling, desired)
        blocks = {name: own.axis(name) for name in AXES}
        output, blocks = self._each(OUTPUT, before, blocks)
        vibration, blocks = self._together(before, blocks)
        drive, blocks = self._each(DRIVE, before, blocks)
        states = {name: (drive[name], vibration[name], output[name]) for name in AXES}
        return self._advanced(before, coupling, states, blocks)

    def _each(self, place: int, before: Progress, blocks: Blocks) -> tuple[dict[str, Any], Blocks]:
        """Invert one effect of each axis by itself."""
        states, inputs = {}, {}
        for name, block in blocks.items():
            effect, state = self._cascades[name].effects[place], before.states[name][place]
            try:
                states[name], inputs[name] = effect.invert(state, block)
            except (BeyondRangeError, TooSteepError) as error:
                raise _named(error, name, before) from error
        return states, inputs

    def _together(self, before: Progress, blocks: Blocks) -> tuple[dict[str, Any], Blocks]:
        """Invert both axes' vibration: one transform of two rows is faster than two."""
        if not self._vibrations:
            return self._each(VIBRATION, before, blocks)
        convolutions = [vibration.inverse.convolution for vibration in self._vibrations]
        states = [before.states[name][VIBRATION] for name in AXES]
        targets = [blocks[name] for name in AXES]
        (x, y), (to_x, to_y) = stream_together(convolutions, states, targets)
        return {"x": x, "y": y}, {"x": to_x, "y": to_y}

    def finish(self, before: Progress) -> Trace:
        """Return the drive still owed after the last block."""
        drives = {}
        for name, cascade in self._cascades.items():
            try:
                drives[name] = cascade.finish(before.states[name])
            except (BeyondRangeError, TooSteepError) as error:
                raise _named(error, name, before) from error
        return self._advanced(before, before.coupling, before.states, drives)[1]

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

    def _advanced(
        self,
        before: Progress,
        coupling: States,
        states: dict[str, Any],
        drives: dict[str, Array],
    ) -> tuple[Progress, Trace]:
        known = {name: _joined(before.ahead[name], drives[name]) for name in AXES}
        count, period = min(map(len, known.values())), self._sample_period
        ahead = {name: drive[count:].copy() for name, drive in known.items()}
        drive = Trace(before.next_sample, period, known["x"][:count], known["y"][:count])
        if not count:
            return evolve(before, coupling=coupling, states=states, ahead=ahead), drive
        self._limits.refuse_beyond(drive, before.drive)
        last = {"x": float(drive.x[-1]), "y": float(drive.y[-1])}
        return Progress(before.next_sample + count, coupling, states, last, ahead), drive


def _joined(first: Array, then: Array) -> Array:
    return np.concatenate((first, then)) if len(first) else then


def _named(error: BeyondRangeError | TooSteepError, axis: str, before: Progress) -> ScanError:
    """Say which axis and which sample of the scan it is that left what was identified."""
    sample = before.next_sample + len(before.ahead[axis]) + error.sample
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
