"""The reference of a scan adapted to what earlier lines have shown to have changed."""

from functools import partial

import numpy as np

from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, DRIVE, Aligner
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.features.online.adaptation import TIME_CONSTANT, Adaptation
from afm_scan_ros.features.online.adapted_reference import AxisShift, ReferenceFilter
from afm_scan_ros.features.online.line_correction import (
    LineCorrection,
    lines_of_delay,
    refuse_unsuited,
)
from afm_scan_ros.nodes.parameters import NodeParameter, OnlineOption


class AdaptedScan(LineCorrection):
    """Adapts a reference to the shifts that an adaptation sees in drive and measured displacement.

    Raises InputError for a scan without turn-arounds.
    """

    def __init__(
        self, model: ScannerModel, spec: ScanSpec, adaptation: Adaptation, delay: int
    ) -> None:
        refuse_unsuited("adaptation", spec)
        super().__init__(spec, delay, np.stack([AxisShift().weights] * len(AXES)))
        self._adaptation, self._aligner = adaptation, Aligner((DRIVE, ACHIEVED))
        period = spec.sample_period
        self._filters = {name: ReferenceFilter(model.axis(name), period) for name in AXES}
        self._states = {name: each.at_rest() for name, each in self._filters.items()}
        for name, each in self._filters.items():  # compiled now, not while a scan waits
            each.apply(self._states[name], np.zeros(1), AxisShift().weights[:, None])

    def observe(self, name: str, block: Trace) -> None:
        """Take the next block of a topic; from the drive (V) and what was achieved (m), learn.

        Raises ScanError where the drive leaves the model's identified range.
        """
        if name == DESIRED:
            return
        self._aligner.add(name, block)
        for drive, measured in self._aligner.ready():
            try:
                for line, shifts in self._adaptation.add(drive, measured):
                    weights = np.stack([shifts[axis].weights for axis in AXES])
                    self._values[line + self.delay] = weights
            except BeyondRangeError as error:
                sample = drive.first_sample + error.sample
                raise ScanError(f"sample {sample}: adaptation predicts nothing: {error}") from error

    def _correct(self, line: int, before: Array, now: Array, block: Trace) -> Trace:
        """Filter a block by the weights (2, 4) of the line before and of this one."""
        rise = self._rise(line, block)
        weights = before[:, :, None] + rise * (now - before)[:, :, None]
        adapted = {}
        for name, own in zip(AXES, weights, strict=True):
            self._states[name], adapted[name] = self._filters[name].apply(
                self._states[name], block.axis(name), own
            )
        return Trace(block.first_sample, block.sample_period, **adapted)


def adapted_scan(
    time_constant: float, model: ScannerModel, spec: ScanSpec, held_back: int, latency: float
) -> AdaptedScan:
    """Return the adaptation of a scan, with a memory in s; raises InputError where it has none."""
    adaptation = Adaptation(model, spec, time_constant)
    return AdaptedScan(model, spec, adaptation, lines_of_delay(spec, held_back, latency))


ADAPT = OnlineOption(
    help="Track changes of gain, resonance and slow creep, and scan accordingly.",
    parameters=(
        NodeParameter(
            "adapt",
            default=False,
            description="Whether changes of gain, resonance and slow creep are tracked",
        ),
        NodeParameter(
            "adapt_time_constant_s", TIME_CONSTANT, "With adapt: memory of the estimator", low=0.0
        ),
    ),
    refuse_unsuited=partial(refuse_unsuited, "adaptation"),
    correction=lambda given: partial(adapted_scan, given["adapt_time_constant_s"]),
    tracker=lambda model, spec, given: Adaptation(model, spec, given["adapt_time_constant_s"]).news,
)
