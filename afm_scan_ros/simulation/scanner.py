"""The simulated piezoscanner: amplifier, hysteresis, vibration, creep, sensor, in x and y."""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.simulation.amplifier import ramp_down
from afm_scan_ros.simulation.dynamics import ComplexArray, Dynamics
from afm_scan_ros.simulation.play import PlayBank
from afm_scan_ros.simulation.sensor import read
from afm_scan_ros.simulation.spec import AxisSpec, PlantSpec


@frozen(eq=False)
class AxisState:
    """Where one axis stands: its plays (V), its sections (V), and the last drive (V)."""

    plays: Array
    sections: ComplexArray
    drive: float = 0.0


@frozen(eq=False)
class Axis:
    """Hysteresis, then vibration and creep: drive (V) to true displacement (m)."""

    hysteresis: PlayBank
    dynamics: Dynamics

    @classmethod
    def from_spec(cls, spec: AxisSpec, sensor_sensitivity: float) -> "Axis":
        """Build an axis; ``sensor_sensitivity`` in m per sensor volt."""
        dynamics = Dynamics.from_spec(spec, sensor_sensitivity)
        return cls(PlayBank.from_spec(spec.hysteresis), dynamics)

    def at_rest(self) -> AxisState:
        """State of a virgin axis: never driven."""
        return AxisState(self.hysteresis.relaxed(), self.dynamics.at_rest())

    def advance(
        self, state: AxisState, drive: Array, sample_period: float
    ) -> tuple[AxisState, Array]:
        """Displacement (m) just before each update of the drive (V), both of shape (n,)."""
        plays, effective = self.hysteresis.apply(state.plays, drive)
        sections, displacement = self.dynamics.apply(state.sections, effective, sample_period)
        return AxisState(plays, sections, float(drive[-1])), displacement


class Piezoscanner:
    """A scanner that owns its time: it begins at rest, undriven, and advances block by block.

    The converter holds drive sample k from k ``sample_period`` on; displacement sample k is taken
    just before that update, so that it is the answer to the drive up to sample k - 1. The same
    ``seed`` gives the same readings, however the drive is cut into blocks.
    """

    def __init__(self, spec: PlantSpec, sample_period: float, seed: int) -> None:
        if not 0.0 < sample_period < np.inf:
            raise InputError(f"sample_period = {sample_period:g} s must be above 0 and finite")
        axes = spec.axes().items()
        self._spec = spec
        self._sample_period = sample_period
        self._rng = np.random.default_rng(seed)
        self._axes = {name: Axis.from_spec(axis, spec.sensor_sensitivity) for name, axis in axes}
        self._states = {name: axis.at_rest() for name, axis in self._axes.items()}
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
        self._spec.amplifier.limits.refuse_beyond(drive, self._drive())
        moved = {
            name: axis.advance(self._states[name], drive.axis(name), self._sample_period)
            for name, axis in self._axes.items()
        }
        paths = (moved[name][1] for name in AXES)
        true = Trace(drive.first_sample, drive.sample_period, *paths)
        measured = read(self._spec.sensor, true, self._rng)
        self._states = {name: state for name, (state, _) in moved.items()}
        self._next_sample += drive.x.size
        return measured, true

    def ramp_down(self) -> Trace:
        """Drive (V) that follows the last block and brings both axes to rest at zero."""
        spec, period = self._spec.amplifier, self._sample_period
        return ramp_down(spec, self._next_sample, period, self._drive())

    def _drive(self) -> dict[str, float]:
        return {name: state.drive for name, state in self._states.items()}

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
