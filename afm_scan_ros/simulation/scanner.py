"""The simulated piezoscanner in x and y: amplifier, chain of physical effects, sensor."""

import numpy as np

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import ramp_to_rest
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.simulation.chain import SimulatedChain
from afm_scan_ros.simulation.spec import PlantSpec, SensorSpec


def read(spec: SensorSpec, true: Trace, rng: np.random.Generator) -> Trace:
    """Reading (m) of the true displacement (m): a whole number of quanta.

    Draws one normal number a sample and axis, in the samples' order, so that the readings do not
    depend on how they are cut into blocks. Raises ScanError where the span is too small.
    """
    noise = spec.noise_rms * rng.standard_normal((true.x.size, len(AXES)))
    x, y = (_convert(spec, true, axis, noise[:, i]) for i, axis in enumerate(AXES))
    return Trace(true.first_sample, true.sample_period, x, y)


def _convert(spec: SensorSpec, true: Trace, axis: str, noise: Array) -> Array:
    code = np.rint((true.axis(axis) + noise) / spec.quantum)
    half = 2 ** (spec.bits - 1)
    if not -half <= code.min() <= code.max() < half:  # NaN is not
        outside = np.flatnonzero(~((code >= -half) & (code < half)))[0]
        raise ScanError(
            f"sample {true.first_sample + outside}, axis {axis}: displacement ="
            f" {true.axis(axis)[outside]:.6g} m saturates the sensor, which spans"
            f" {spec.span:g} m: scan a smaller range"
        )
    return code * spec.quantum


BESIDE_THE_SENSOR = 1  # so that a mechanism draws other numbers than the sensor's noise does


class Piezoscanner:
    """A scanner that owns its time: it begins at rest, undriven, and advances block by block.

    The converter holds drive sample k from k ``sample_period`` on; displacement sample k is taken
    just before that update, so that it is the answer to the drive up to sample k - 1. The same
    ``seed`` gives the same readings, however the drive is cut into blocks. ``age`` is the time (s)
    since it was switched on: what goes on from one scan to the next depends on it.
    """

    def __init__(self, spec: PlantSpec, sample_period: float, seed: int, age: float = 0.0) -> None:
        if not 0.0 < sample_period < np.inf:
            raise InputError(f"sample_period = {sample_period:g} s must be above 0 and finite")
        if not 0.0 <= age < np.inf:
            raise InputError(f"age = {age:g} s must be 0 or more, and finite")
        spec = spec.older(age)
        self._spec = spec
        self._sample_period = sample_period
        self._rng = np.random.default_rng(seed)
        self._chain = SimulatedChain(spec, sample_period)
        self._states = self._chain.at_rest(np.random.default_rng((seed, BESIDE_THE_SENSOR)))
        self._drive = dict.fromkeys(AXES, 0.0)
        self._next_sample = 0

    @property
    def next_sample(self) -> int:
        """Index of the first sample that is still to come."""
        return self._next_sample

    def advance(self, drive: Trace) -> tuple[Trace, Trace]:
        """Measured and true displacement (m) for a block of drive (V) that follows the last one.

        Raises InputError for a gap, a repeated or empty block, unequal axes or another sample
        period, and ScanError, naming sample, axis and value, beyond a limit of amplifier or
        sensor. A block that is refused leaves the scanner where it was.
        """
        self._refuse_misplaced(drive)
        self._spec.amplifier.limits.refuse_beyond(drive, self._drive)
        states, true = self._chain.advance(self._states, drive)
        measured = read(self._spec.sensor, true, self._rng)
        self._states = states
        self._drive = {name: float(drive.axis(name)[-1]) for name in AXES}
        self._next_sample += drive.x.size
        return measured, true

    def ramp_down(self) -> Trace:
        """Drive (V) that follows the last block and brings both axes to rest at zero."""
        slew = self._spec.amplifier.ramp_down_slew
        return ramp_to_rest(self._next_sample, self._sample_period, self._drive, slew)

    def _refuse_misplaced(self, drive: Trace) -> None:
        if drive.first_sample != self._next_sample:
            raise InputError(
                f"drive block begins at sample {drive.first_sample}, expected"
                f" {self._next_sample}: give every block once and in order"
            )
        if drive.sample_period != self._sample_period:
            raise InputError(
                f"drive block at sample {drive.first_sample} has sample period"
                f" {drive.sample_period:g} s, the scanner {self._sample_period:g} s: give one"
            )
        if drive.x.shape != drive.y.shape or drive.x.ndim != 1 or drive.x.size == 0:
            raise InputError(
                f"drive block at sample {drive.first_sample} has shapes {drive.x.shape} in x and"
                f" {drive.y.shape} in y: give as many samples in both, and some"
            )
