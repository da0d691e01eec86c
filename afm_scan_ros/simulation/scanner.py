"""The simulated scanner: its parameters, and its physics from converter to sensor, both axes.

    drive -> inserts -> hysteresis -> F -> vibration and creep -> attachments -> inserts -> sensor

A link's state holds all that it remembers and is never changed in place, so that blocks cut
anywhere give the same path. A scanner without mechanisms is solved from update to update of the
converter. Mechanisms act between updates too: with one, all runs in steps of at most ``STEP``.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import ceil
from typing import Any, Protocol, TypeAlias

import numpy as np
from attrs import evolve, frozen
from attrs.validators import ge, gt, le

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import AmplifierSpec, ramp_to_rest
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.simulation.axis import (
    AxisSpec,
    ComplexArray,
    Dynamics,
    PlayBank,
    first_resonance,
    quantity,
)
from afm_scan_ros.simulation.mechanisms import base
from afm_scan_ros.simulation.mechanisms.attachment import AttachedStage, Attachment


@frozen
class SensorSpec:
    """Displacement sensor: white noise, then ``bits`` over a span centred on zero. In m."""

    noise_rms: float = quantity(ge(0.0), suffix="_nm", scale=1e-9)
    span: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    bits: int = quantity(ge(1), le(32))

    @property
    def quantum(self) -> float:
        """Displacement between two neighbouring readings, m."""
        return float(self.span / 2**self.bits)


@frozen
class PlantSpec:
    """A whole scanner; ``sensor_sensitivity`` (m/V) turns the vibration's sensor volts into m."""

    amplifier: AmplifierSpec
    sensor: SensorSpec
    x: AxisSpec
    y: AxisSpec
    sensor_sensitivity: float = quantity(ge(1e-9), le(1e-3), suffix="_m_per_v")
    mechanisms: tuple[base.Mechanism, ...] = ()

    def older(self, by: float) -> "PlantSpec":
        """Return the scanner ``by`` s later: only mechanisms that age are others."""
        aged = (m.older(by) if isinstance(m, base.Ageing) else m for m in self.mechanisms)
        return evolve(self, mechanisms=tuple(aged))

    def axes(self) -> dict[str, AxisSpec]:
        """Return the axes by name, in the order in which a sample draws its noise."""
        return {name: getattr(self, name) for name in AXES}


STEP = 5e-6  # s
AT_ONCE = 20_000  # steps: what a processor's cache holds

States: TypeAlias = tuple[Any, ...]


class SimulatedElement(Protocol):
    """A part of the chain: signals of both axes in, signals of both axes out, shape (2, n)."""

    def at_rest(self, step: float, rng: np.random.Generator) -> Any:  # noqa: ANN401 - each its own
        """State of an undriven scanner."""

    def apply(self, state: Any, signals: Array, step: float) -> tuple[Any, Array]:  # noqa: ANN401
        """New state, and what becomes of the signals, sampled every ``step`` s."""


@frozen(eq=False)
class PerAxis:
    """What each axis does by itself: its ``starts`` at rest, and its ``moves`` by a step (s)."""

    starts: tuple[Callable[[], Array | ComplexArray], ...]
    moves: tuple[Callable[[Any, Array, float], tuple[Any, Array]], ...]

    def at_rest(self, step: float, rng: np.random.Generator) -> States:  # noqa: ARG002
        """Virgin plays, or sections at zero."""
        return tuple(start() for start in self.starts)

    def apply(self, state: States, signals: Array, step: float) -> tuple[States, Array]:
        """Move, exactly while the signals are held for a step."""
        moved = [m(s, u, step) for m, s, u in zip(self.moves, state, signals, strict=True)]
        states, paths = zip(*moved, strict=True)
        return states, np.array(paths)


class SimulatedChain:
    """All links of a scanner whose converter is updated every ``sample_period`` s."""

    def __init__(self, spec: PlantSpec, sample_period: float) -> None:
        self._substeps = ceil(sample_period / STEP) if spec.mechanisms else 1
        self._step = sample_period / self._substeps
        self._links = _links(spec, self._step)

    def at_rest(self, rng: np.random.Generator) -> States:
        """State of a virgin scanner: never driven."""
        return tuple(link.at_rest(self._step, rng) for link in self._links)

    def advance(self, states: States, drive: Trace) -> tuple[States, Trace]:
        """True displacement (m) just before each update of the drive (V)."""
        updates, paths = np.array([drive.x, drive.y]), []
        samples = max(1, AT_ONCE // self._substeps)
        for first in range(0, drive.x.size, samples):
            states, path = self._advance(states, updates[:, first : first + samples])
            paths.append(path)
        x, y = np.concatenate(paths, axis=1)
        return states, Trace(drive.first_sample, drive.sample_period, x, y)

    def _advance(self, states: States, updates: Array) -> tuple[States, Array]:
        signals, after = np.repeat(updates, self._substeps, axis=1), []
        for link, state in zip(self._links, states, strict=True):
            new, signals = link.apply(state, signals, self._step)
            after.append(new)
        return tuple(after), signals[:, :: self._substeps]


def _links(spec: PlantSpec, step: float) -> Sequence[SimulatedElement]:
    axes = _axes(spec)
    dynamics = [Dynamics.from_spec(axis, spec.sensor_sensitivity) for axis in axes.values()]
    inserts = [each for each in spec.mechanisms if isinstance(each, base.Insert)]
    stages = {name: AttachedStage.of_pole(first_resonance(a.vibration)) for name, a in axes.items()}
    attachments = (each for each in spec.mechanisms if isinstance(each, Attachment))
    return (
        *(insert for insert in inserts if insert.PLACE == "drive"),
        _hysteresis(axes, spec.mechanisms, step),
        PerAxis(tuple(d.at_rest for d in dynamics), tuple(d.apply for d in dynamics)),
        *(each.attached(stages[each.axis]) for each in attachments),
        *(insert for insert in inserts if insert.PLACE == "displacement"),
    )


def _axes(spec: PlantSpec) -> dict[str, AxisSpec]:
    """What each axis is made of by now."""
    axes = spec.axes()
    for mechanism in spec.mechanisms:
        if isinstance(mechanism, base.Alteration):
            axes[mechanism.axis] = mechanism.altered(axes[mechanism.axis])
    return axes


def _hysteresis(
    axes: Mapping[str, AxisSpec], mechanisms: Iterable[base.Mechanism], step: float
) -> PerAxis:
    """Drive (V) to effective input F (V) of each axis."""
    plays = {name: PlayBank.from_spec(axis.hysteresis) for name, axis in axes.items()}
    blocks = (each for each in mechanisms if isinstance(each, base.Blocks))
    dragged = {each.axis: each.bank(plays[each.axis], step) for each in blocks}
    banks = [dragged.get(name, plays[name]) for name in AXES]
    return PerAxis(tuple(b.relaxed for b in banks), tuple(map(_held, banks)))


def _held(bank: base.Bank) -> Callable[[Any, Array, float], tuple[Any, Array]]:
    """Return how a bank, which knows its step, moves."""
    return lambda state, drive, _step: bank.apply(state, drive)


def read(spec: SensorSpec, true: Trace, rng: np.random.Generator) -> Trace:
    """Reading (m) of the true displacement (m): a whole number of quanta.

    Draws one number a sample and axis, in their order. Raises ScanError beyond the span.
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

        Raises InputError for a misplaced block, and ScanError, naming sample, axis and value, at a
        limit of amplifier or sensor. A block that is refused leaves the scanner where it was.
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
