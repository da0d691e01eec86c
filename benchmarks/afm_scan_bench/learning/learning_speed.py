"""What a learning step costs beside an inversion of the whole scan; both for two axes.

A step takes one scan's spectra, the next correction and its signal. Afterwards an inversion tests
the correction against the drive's limits.
"""

from attrs import define
from numpy.random import Generator, default_rng

from afm_scan_bench.scans import ALL, default_model, default_plant
from afm_scan_bench.speed.timing.ratios import COLUMNS, by_turns, processor_seconds, row
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.features.learning.scan_to_scan import AxisLearning, TrialSpectra
from afm_scan_ros.report.table import Table

SPEC = ScanSpec(lines=256, line_rate=5.0, samples_per_line=3904)
"""A million samples."""
BEFORE = 2
"""Scans before the one that the step takes."""
TARGET = "≤ 3"


def measure(spec: ScanSpec = SPEC, turns: int = 7) -> Table:
    """Time the step, and the step with its test, by turns with the inversion."""
    rng = default_rng(1)
    target = Correction.none(spec).reference()
    axes = [_Axis.of(spec, name, target, rng) for name in AXES]
    model, limits = default_model(), default_plant().amplifier.limits
    compensation = Compensation(model, spec.sample_period, ALL, InverseSettings(), limits)

    def inverted() -> None:
        compensation.whole(target)

    def step() -> None:
        for axis in axes:
            axis.step()

    ours, theirs = by_turns(turns, processor_seconds(step), processor_seconds(inverted))
    tested = [step + test for step, test in zip(ours, theirs, strict=True)]
    samples = f"{len(target.x):,} samples"
    against = "an inversion of the scan"
    rows = [
        row(f"learning step, {samples}", against, "s", TARGET, ours, theirs),
        row("the step and its test of the limits", against, "s", "", tested, theirs),
    ]
    return Table("learning_speed", "Processor time of a learning step, both axes", COLUMNS, rows)


@define
class _Axis:
    """An axis that has learned, and its next scan."""

    learning: AxisLearning
    trials: list[TrialSpectra]
    reference: Array
    measured: Array

    @classmethod
    def of(cls, spec: ScanSpec, name: str, target: Trace, rng: Generator) -> "_Axis":
        """Take scans whose error is the sensor's noise."""
        desired, model = target.axis(name), default_model()
        learning = AxisLearning(spec, model.axis(name), desired)
        noise = default_plant().sensor.noise_rms
        measured = [desired + noise * rng.standard_normal(len(desired)) for _ in range(BEFORE + 1)]
        trials = [learning.trial(desired, each) for each in measured[:BEFORE]]
        return cls(learning, trials, desired, measured[-1])

    def step(self) -> Array:
        """Return the signal of the next correction."""
        last = self.learning.trial(self.reference, self.measured)
        free = self.learning.frequencies < 0.0
        step = self.learning.step([*self.trials, last], free, BEFORE)
        return self.learning.spectra.correction(step.correction)
