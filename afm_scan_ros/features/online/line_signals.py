"""What one line shows of a shift: the residual and each unknown's part in it, per axis.

With y measured, ŷ predicted by the model from the drive, and filters as in adapted_reference.py,

    y - ŷ = (g - 1) ŷ - a (s²/N) y - b (2 ζ ω s/N) y + η h + c z + the model's error + noise.

h is the change of ŷ per share by which the part of the hysteresis with memory grows. So a gain is
distinguished from a hysteresis loop that the model does not have. z is slow creep.
The equation is exact in g, a and b. Its right side holds measured signals, so least squares would
be biased by their noise. Predicted ones in their place are instruments without noise (T. Söderström
and P. Stoica, System Identification, 1989, chapter 8).
"""

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.model import Added, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import Prediction
from afm_scan_ros.core.streams import WholeLines
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.features.online.adapted_reference import ResonanceParts, SlowSection

STEP = 0.01
"""Share by which the hysteresis is changed to see its part."""
GAIN, ALPHA, BETA, HYSTERESIS = range(4)
"""Places of the unknowns g - 1, a, b and η."""
UNKNOWNS = 4


@frozen(eq=False)
class LineSignals:
    """One axis on one line: residual (n,), m, and the unknowns' parts, in m per unknown.

    ``parts`` and ``instruments`` are (4, n), by measured and by predicted signals. ``creep`` is z.
    """

    residual: Array
    parts: Array
    instruments: Array
    creep: Array


_AxisState: TypeAlias = tuple[Array, Array, float]
"""State of an axis' filters: of measured and predicted displacement, and of its creep."""


class _AxisFilters:
    """The filters of one axis; the state is passed in."""

    ROWS = 8

    def __init__(self, model: ScannerModel, name: str, sample_period: float) -> None:
        self._resonance = ResonanceParts(model.axis(name), sample_period)
        self._creep = SlowSection(model.axis(name), sample_period)

    def at_rest(self) -> _AxisState:
        still = self._resonance.at_rest()
        return still, still, self._creep.at_rest()

    def apply(
        self, state: _AxisState, measured: Array, predicted: Array, varied: Array
    ) -> tuple[_AxisState, Array]:
        """Rows (8, n): residual, ŷ, filtered y, h, filtered ŷ, z."""
        of_measured, of_predicted, creep = state
        of_measured, parts = self._resonance.apply(of_measured, measured)
        of_predicted, instruments = self._resonance.apply(of_predicted, predicted)
        creep, _, crept = self._creep.without(creep, predicted, np.zeros(len(predicted)))
        memory = (varied - predicted) / STEP
        rows = [measured - predicted, predicted, *-parts, memory, *-instruments, crept]
        return (of_measured, of_predicted, creep), np.stack(rows)


def _signals(rows: Array) -> LineSignals:
    gain, memory = rows[1:2], rows[4:5]
    parts, instruments = (np.concatenate((gain, r, memory)) for r in (rows[2:4], rows[5:7]))
    return LineSignals(rows[0], parts, instruments, rows[7])


class ScanSignals:
    """Takes drive and measured displacement, and yields the signals of each whole line.

    Memory does not grow with the scan. Raises InputError for an axis without a resonance.
    """

    def __init__(self, model: ScannerModel, spec: ScanSpec) -> None:
        period = spec.sample_period
        self._predictions = Prediction(model, period), Prediction(_varied(model), period)
        self._states: Any = tuple(each.at_rest() for each in self._predictions)
        self._axes = {name: _AxisFilters(model, name, period) for name in model.axes}
        self._filters = {name: each.at_rest() for name, each in self._axes.items()}
        rows = _AxisFilters.ROWS * len(self._axes)
        self._whole = WholeLines(phases(spec).lines, spec.samples_per_line, rows)

    def add(self, drive: Trace, measured: Trace) -> Iterator[tuple[int, dict[str, LineSignals]]]:
        """Take the next run of samples, the same of both; yield lines by number.

        Raises BeyondRangeError where the drive leaves the model's identified range.
        """
        predictions = zip(self._predictions, self._states, strict=True)
        self._states, moved = zip(*(p.advance(s, drive) for p, s in predictions), strict=True)
        rows = []
        for name, filters in self._axes.items():
            given = measured.axis(name), moved[0].axis(name), moved[1].axis(name)
            self._filters[name], found = filters.apply(self._filters[name], *given)
            rows.append(found)
        for number, line in self._whole.add(drive.first_sample, np.concatenate(rows)):
            each = np.split(line, len(rows))
            yield number, {name: _signals(r) for name, r in zip(self._axes, each, strict=True)}


def _varied(model: ScannerModel) -> ScannerModel:
    """Model of which the hysteresis has changed by a step."""
    change = Added("parameter_shift", "hysteresis", (1.0 + STEP,))
    changed = {
        name: evolve(model.axis(name), added=(*model.axis(name).added, change))
        for name in AXES
        if name in model.axes
    }
    return evolve(model, **changed)
