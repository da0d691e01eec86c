"""Adaptation on line: what has changed in each axis is tracked from line to line.

**Dead zone.** A value that the model's error alone may give is no change. It is the detection
limit, at the probability ``FALSE_CHANGE`` and with the factor that diagnosis allows it. In a
to-and-fro scan x follows the same path on every line, so its model error is the same on every line.
A value within the dead zone on the first lines is therefore taken as model error, and subtracted
from then on. What differs from it later is compared with the detection limit itself. An unknown of
x that has once changed is then followed wherever it differs by more than the noise.

**Bounds.** A value outside the catalogue's bounds is not taken: the last one
stays. **Excitation.** A parameter that the scan does not excite stays too.

**Other causes.** All parameters of a line stay where what the estimate leaves of the residual is
beyond the detection limit: then something else has changed. So does the gain where the hysteresis
has changed, for that changes the displacement too.
"""

from collections.abc import Iterator, Mapping
from enum import Enum

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray
from scipy.special import ndtri

from afm_scan_ros.core.diagnosis.monitor import expected_limits
from afm_scan_ros.core.diagnosis.scan_monitor import ScanNews
from afm_scan_ros.core.diagnosis.settings import LIMIT
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.features.online.adapted_reference import AxisShift, room, slowest
from afm_scan_ros.features.online.line_signals import (
    GAIN,
    HYSTERESIS,
    UNKNOWNS,
    LineSignals,
    ScanSignals,
)
from afm_scan_ros.features.online.shift_estimate import (
    CreepInformation,
    Information,
    LineInformation,
    ShiftEstimate,
    estimate,
)

TIME_CONSTANT = 1.0
"""Default memory, s."""
FALSE_CHANGE = 0.01
"""Probability that a parameter of an unchanged scanner is changed in a scan."""
PARAMETERS = ("gain", "frequency", "loss")
"""What the unknowns of a line belong to, in their order."""
CREEP_NAME = "creep"
CREEP = 3
"""Place of c among the unknowns of a shift."""


class Outcome(Enum):
    """What is known of a parameter by the last line."""

    UNCHANGED = "unchanged"
    CHANGED = "changed"
    NOT_EXCITED = "not excited"
    BEYOND_BOUNDS = "beyond its bounds"
    OTHER_CAUSE = "not distinguished from another cause"


EXPECTED = (Outcome.UNCHANGED, Outcome.NOT_EXCITED)
"""Of a scanner that has not changed."""


@frozen
class AdaptationFinding:
    """A parameter's outcome, and its dead zone: the change of its unknown that can be detected."""

    outcome: Outcome
    dead_zone: float


@frozen(eq=False)
class AxisState:
    """State of an axis: sums, model errors ``baseline`` (4,), and ``unknowns`` (4,) in force."""

    lines: int
    information: Information
    creep: Array
    baseline: Array
    unknowns: Array
    findings: Mapping[str, AdaptationFinding]

    @property
    def shift(self) -> AxisShift:
        """The shift in force."""
        return AxisShift.of(self.unknowns) or AxisShift()


class AxisAdaptation:
    """The law of one axis: lines in, shift out; the state is passed in.

    ``memory`` is in lines. ``repeats`` says whether all ``lines`` follow the same path.
    """

    def __init__(
        self,
        information: LineInformation,
        creep: CreepInformation,
        memory: float,
        lines: int,
        *,
        repeats: bool,
    ) -> None:
        self._information, self._creep = information, creep
        memory = max(memory, 1.0)
        self._kept, self._first = 1.0 - 1.0 / memory, 1 + int(np.ceil(memory))
        self._by_error = -float(ndtri(0.5 * FALSE_CHANGE))
        self._by_noise = -float(np.sqrt(2.0) * ndtri(0.5 * FALSE_CHANGE / lines))
        self._repeats = repeats

    def at_rest(self) -> AxisState:
        """State before the first line."""
        sums, creep = Information.nothing(), self._creep.at_rest()
        return AxisState(0, sums, creep, np.zeros(UNKNOWNS), np.zeros(CREEP + 1), {})

    def learn(self, before: AxisState, line: LineSignals) -> AxisState:
        """Return the state after one more line.

        The first line is left out, and nothing is changed until the memory is filled.
        """
        lines = before.lines + 1
        if lines == 1:
            return evolve(before, lines=lines)
        known = before.information.after(self._information.of(line), self._kept)
        creep = self._creep.after(before.creep, line)
        state = evolve(before, lines=lines, information=known, creep=creep)
        return state if lines < self._first else self._decided(state)

    def _decided(self, state: AxisState) -> AxisState:
        known = np.append(state.unknowns[:HYSTERESIS], 0.0) + state.baseline
        kept = np.append(known[:HYSTERESIS], 0.0)
        found = estimate(state.information, kept, LIMIT.expected * self._by_error)
        dead_zone = self._dead_zone(state, found)
        change = found.unknowns - known
        if self._repeats and state.lines == self._first:
            within = found.excited & (np.abs(change) <= dead_zone)
            state = evolve(state, baseline=np.where(within, change, 0.0))
            change = np.where(within, 0.0, change)
        linear = np.append(found.unknowns[:HYSTERESIS], 0.0)
        held = np.zeros(UNKNOWNS, dtype=np.bool_)
        held[:] = state.information.left(linear) > LIMIT.expected
        held[GAIN] |= abs(change[HYSTERESIS]) > dead_zone[HYSTERESIS]
        return self._decided_creep(_each_judged(state, found.excited, held, change, dead_zone))

    def _dead_zone(self, state: AxisState, found: ShiftEstimate) -> Array:
        """Largest change (4,) of each unknown that is none."""
        deviation = np.hypot(found.model_error, found.noise)
        if not self._repeats or state.lines == self._first:
            return np.asarray(LIMIT.expected * self._by_error * deviation)
        changed = np.append(state.unknowns[:HYSTERESIS] != 0.0, False)
        return np.where(changed, self._by_noise * found.noise, self._by_error * deviation)

    def _decided_creep(self, state: AxisState) -> AxisState:
        """Change c where the means of the lines show it."""
        found = self._creep.estimate(state.creep)
        dead_zone = LIMIT.expected * self._by_error * found.model_error
        change = found.change - state.unknowns[CREEP]
        if dead_zone > room()[CREEP]:
            return _found(state, CREEP_NAME, Outcome.NOT_EXCITED, dead_zone)
        if abs(change) > dead_zone and found.left > LIMIT.expected * self._creep.limit:
            return _found(state, CREEP_NAME, Outcome.OTHER_CAUSE, dead_zone)
        return _judged(state, CREEP_NAME, CREEP, change, dead_zone)


def _each_judged(
    state: AxisState,
    excited: NDArray[np.bool_],
    held: NDArray[np.bool_],
    change: Array,
    dead_zone: Array,
) -> AxisState:
    """Change the unknowns that are excited and not ``held``, all (4,)."""
    for place, name in enumerate(PARAMETERS):
        if not excited[place]:
            state = _found(state, name, Outcome.NOT_EXCITED, dead_zone[place])
        elif held[place]:
            state = _found(state, name, Outcome.OTHER_CAUSE, dead_zone[place])
        else:
            state = _judged(state, name, place, change[place], dead_zone[place])
    return state


def _judged(state: AxisState, name: str, place: int, change: float, dead_zone: float) -> AxisState:
    """Change an unknown where it left the dead zone and stays within its bounds."""
    unknowns = state.unknowns.copy()
    if abs(change) <= dead_zone:
        outcome = Outcome.CHANGED if unknowns[place] else Outcome.UNCHANGED
        return _found(state, name, outcome, dead_zone)
    unknowns[place] += change
    if AxisShift.of(unknowns) is None:
        return _found(state, name, Outcome.BEYOND_BOUNDS, dead_zone)
    return _found(evolve(state, unknowns=unknowns), name, Outcome.CHANGED, dead_zone)


def _found(state: AxisState, name: str, outcome: Outcome, dead_zone: float) -> AxisState:
    return evolve(
        state, findings={**state.findings, name: AdaptationFinding(outcome, float(dead_zone))}
    )


class Adaptation:
    """Takes drive and measured displacement of a scan, and yields each axis' shift line by line.

    ``time_constant`` (s) is the estimator's memory: its bandwidth is 1 / (2π ``time_constant``).
    Raises InputError where the model states no error, or has no resonance below half the sample
    rate. Its loops are compiled when it is made, not while others wait.
    """

    def __init__(
        self, model: ScannerModel, spec: ScanSpec, time_constant: float = TIME_CONSTANT
    ) -> None:
        rest = Trace(0, spec.sample_period, np.zeros(2), np.zeros(2))
        list(ScanSignals(model, spec).add(rest, rest))
        self._signals = ScanSignals(model, spec)
        limits, memory = expected_limits(model, spec), time_constant * spec.line_rate
        self._axes = {}
        for name in AXES:
            line = LineInformation(limits[name], spec.samples_per_line, spec.sample_period)
            creep = CreepInformation(limits[name], slowest(model.axis(name)), spec.line_rate)
            repeats = name == "x"
            self._axes[name] = AxisAdaptation(line, creep, memory, spec.lines, repeats=repeats)
        self.states = {name: axis.at_rest() for name, axis in self._axes.items()}

    def add(self, drive: Trace, measured: Trace) -> Iterator[tuple[int, dict[str, AxisShift]]]:
        """Take the next run of samples, the same of both; yield each line's number and shifts.

        Raises BeyondRangeError where the drive leaves the model's identified range.
        """
        for number, line in self._signals.add(drive, measured):
            for name, axis in self._axes.items():
                self.states[name] = axis.learn(self.states[name], line[name])
            yield number, {name: state.shift for name, state in self.states.items()}

    def news(self, drive: Trace, measured: Trace) -> Iterator[ScanNews]:
        """Take the next run of samples, as ``add`` does; yield what it changes in what is known."""
        before = dict(self.states)
        for _ in self.add(drive, measured):
            for axis, state in self.states.items():
                yield from _news(axis, before[axis].findings, state)
            before = dict(self.states)


def _news(
    axis: str, before: Mapping[str, AdaptationFinding], state: AxisState
) -> Iterator[ScanNews]:
    """Yield a sentence for each parameter of which something else is known than ``before``."""
    for name, finding in state.findings.items():
        if name not in before or before[name].outcome is not finding.outcome:
            value, known = getattr(state.shift, name), finding.outcome.value
            sentence = f"{axis}: by line {state.lines - 1} the {name} is {known}: {value:.4g}"
            yield ScanNews(sentence, expected=finding.outcome in EXPECTED)
