"""The signals of a record as the diagnosis uses them, and the response of a chain to it.

The initial state is a drive history. A depolarised scanner has none. Any other state is given by a
sequence of drive extremes, each within those before it, since a larger extreme erases smaller ones
(Preisach's wiping-out property). Here two extremes and the drive at rest are used. An excursion to
a limit saturates. Displacement is relative, so the effective input is relative to its value at
rest.
"""

import numpy as np
from attrs import define, evolve, field, frozen

from afm_scan_ros.core.chain import Chain, Stage
from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.residual_features import prominent_lines
from afm_scan_ros.core.identification.records.periods import repeated_part
from afm_scan_ros.core.intersample import HELD, held_voltages, read_between, upsampling
from afm_scan_ros.core.model import Range
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES, Array, floats


def repetition_rates(record: Record) -> tuple[float, ...]:
    """Rates (Hz) at which the motion repeats: a scan's line rate, else the drive's.

    Of a drive that nowhere repeats they are those of its spectral lines.
    """
    if record.scan:
        lines = record.scan.line_rate
        of_y = (lines * (1.0 - 1.0 / record.scan.lines),)
        return (lines, *(of_y if record.scan.pattern == "lissajous" else ()))
    period = record.sample_period
    drives = [record.signals(axis)[0] for axis in AXES]
    if found := [part for drive in drives if (part := repeated_part(drive))]:
        return tuple(1.0 / (samples * period) for _, _, samples in found)
    lined = (prominent_lines(drive, period) for drive in drives)
    return tuple(rate for found in lined for rate in found)


@frozen(eq=False)
class AxisSignals:
    """One axis of a record: ``drive`` (V), ``measured`` (m) and ``other`` (m), all of shape (n,).

    ``other`` is the other axis' own displacement, as the model predicts it. ``number`` is the place
    of the record among those diagnosed together. ``rates`` (Hz) are those at which the motion of
    either axis repeats. ``voltages`` and ``other_between`` are the drive and the other axis'
    displacement as the model meets them, ``upsampling`` values of each for a sample.
    """

    name: str
    sample_period: float
    drive: Array
    measured: Array
    other: Array
    number: int = 0
    rates: tuple[float, ...] = ()
    intersample: str = HELD
    voltages: Array = field()
    other_between: Array = field()

    @voltages.default
    def _held(self) -> Array:
        return held_voltages(self.drive, self.intersample)

    @other_between.default
    def _between(self) -> Array:
        return read_between(self.other, self.intersample)

    @property
    def upsampling(self) -> int:
        """Values that the model meets for each sample."""
        return upsampling(self.intersample)

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return len(self.drive) * self.sample_period

    def part(self, count: int) -> "AxisSignals":
        """The first samples."""
        between = count * self.upsampling
        return evolve(
            self,
            drive=self.drive[:count],
            measured=self.measured[:count],
            other=self.other[:count],
            voltages=self.voltages[:between],
            other_between=self.other_between[:between],
        )

    def halved(self, count: int) -> "AxisSignals":
        """So many samples, every other one, of voltages averaged over pairs."""
        both, between = 2 * count, 2 * count * self.upsampling
        return evolve(
            self,
            sample_period=2.0 * self.sample_period,
            drive=self.drive[:both].reshape(-1, 2).mean(axis=1),
            measured=self.measured[:both:2].copy(),
            other=self.other[:both:2].copy(),
            voltages=self.voltages[:between].reshape(-1, 2).mean(axis=1),
            other_between=self.other_between[:between:2].copy(),
        )


SAMPLES_PER_MOVE = 200
"""Samples from one extreme to the next, enough for lagging elements of the drive to follow."""


@frozen
class InitialState:
    """The drive (V) before a record: from depolarised 0 V by way of ``turns`` to ``rest``."""

    turns: tuple[float, ...] = field(default=(), converter=floats)
    rest: float = 0.0

    @property
    def blank(self) -> bool:
        """Whether the scanner is depolarised and at 0 V."""
        return not self.turns and self.rest == 0.0

    def path(self) -> Array:
        """Drive (V) before the record; its last segment is at rest."""
        stops = np.array([0.0, *self.turns, self.rest, self.rest])
        progress = np.arange(SAMPLES_PER_MOVE * (len(stops) - 1)) / SAMPLES_PER_MOVE
        return np.asarray(np.interp(progress, np.arange(len(stops)), stops))

    def played(
        self, cascade: Cascade, drive: Array, identified: Range = (-np.inf, np.inf)
    ) -> Array:
        """Output (n,) of the elements up to the hysteresis from this state on, less that before.

        A drive before the record that lies beyond the ``identified`` range (V) is at its limit.
        """
        state, path = cascade.at_rest(), np.zeros(1) if self.blank else self.path()
        path = np.clip(path, *identified)
        settled, before = cascade.apply(state, path)
        begun = state if self.blank else settled
        return np.asarray(cascade.apply(begun, drive)[1] - before[-1])


DEPOLARISED = InitialState()


StageResponses = dict[int, tuple[Stage, Array]]


@define(eq=False)
class Playback:
    """One axis of one record.

    A fit evaluates many chains that differ in one place; hysteresis and vibration take most of the
    time. So the last response of each stage is cached with the stage, which compares by value.
    """

    view: AxisSignals
    initial_state: InitialState = DEPOLARISED
    _cache: StageResponses = field(factory=dict, init=False)

    def displacement(self, chain: Chain) -> Array:
        """Displacement (n,) in m that the chain predicts, with what the other axis adds."""
        chain = chain.of_record(self.view.number)
        view = self.view
        period, signal, changed = view.sample_period / view.upsampling, view.voltages, False
        identified = chain.model.hysteresis.forward.drive_range
        for number, stage in enumerate(chain.stages()):
            changed = changed or number not in self._cache or self._cache[number][0] != stage
            if changed:
                met, cascade = self._with_other(signal, stage), stage.at(period)
                played = (
                    cascade.apply(cascade.at_rest(), met)[1]
                    if number
                    else self.initial_state.played(cascade, met, identified)
                )
                self._cache[number] = stage, played
            signal = self._cache[number][1]
        return signal[:: view.upsampling]

    def _with_other(self, signal: Array, stage: Stage) -> Array:
        """Signal with what the other axis adds before a stage."""
        for element in stage.coupling:
            effect = element.at(self.view.sample_period / self.view.upsampling)
            signal = signal + effect.apply(effect.at_rest(), self.view.other_between)[1]
        return signal
