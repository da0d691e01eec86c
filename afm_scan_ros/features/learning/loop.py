"""Learning over repeated scans: scan, correct the reference, and scan again."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np
from attrs import define, field, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.comparison import rms_of
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import INVERSES, InverseSettings, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES
from afm_scan_ros.features.learning.scan_to_scan import (
    AxisLearning,
    Convergence,
    LearningStep,
    TrialSpectra,
)

FEWEST, SCANS = 3, 6
"""Scans: two of one drive, which show what repeats, and one with a correction; by default."""
PRICES = 13
"""Prices of the drive that are tried, from none that counts to one that leaves no correction."""


class LearningSession(Protocol):
    """A scanner that repeats a scan with a corrected reference."""

    def scan(self, label: str, spec: ScanSpec, model: ScannerModel, correction: Correction) -> Scan:
        """Scan with all of a model's inverses.

        Raises InputError or ScanError where the scan cannot be made.
        """
        ...


@frozen(eq=False)
class LearningScan:
    """A scan, the correction that it was made with, and the test before it.

    ``convergence`` and ``steps`` are empty of the first two scans, which have no correction.
    ``restored`` names the axes whose error had grown: their correction was the best one's there.
    ``price`` is above zero where the drive's limits left no room for the whole correction.
    """

    scan: Scan
    correction: Correction
    steps: Mapping[str, LearningStep]
    restored: tuple[str, ...] = ()
    price: float = 0.0

    @property
    def convergence(self) -> dict[str, Convergence]:
        """The test of each axis."""
        return {name: step.convergence for name, step in self.steps.items()}

    @property
    def errors(self) -> dict[str, float]:
        """Measured error of each axis, m rms on all lines but the first."""
        tracking = self.scan.tracking("measured")
        return {name: rms_of(tracking, name) for name in AXES}


@define
class _AxisInLoop:
    """What is known of an axis so far."""

    learning: AxisLearning
    held_back: NDArray[np.bool_]
    trials: list[TrialSpectra] = field(factory=list)
    errors: list[float] = field(factory=list)

    def best(self) -> int:
        """Number of the scan with the least error."""
        return int(np.argmin(self.errors))

    def add(self, trial: TrialSpectra, error: float) -> bool:
        """Take a scan; return whether the error has grown, where learning then ends."""
        self.trials.append(trial)
        self.errors.append(error)
        if (best := self.best()) == len(self.errors) - 1 or len(self.errors) < FEWEST:
            return False
        grown = self.learning.grown(self.trials, best)
        self.held_back |= grown
        return bool(grown.any())


def learn(
    session: LearningSession,
    model: ScannerModel,
    spec: ScanSpec,
    scans: int,
    limits: DriveLimits,
) -> Iterator[LearningScan]:
    """Repeat a scan, each time with the correction that all scans before it ask for.

    Yields each scan. Raises InputError for fewer than ``FEWEST`` scans, and for a model without an
    axis that moves.
    """
    if scans < FEWEST:
        raise InputError(
            f"scans = {scans}: give {FEWEST} or more, for the first two show what repeats"
        )
    correction = Correction.none(spec)
    target = correction.reference()
    drive = _DriveLimits(model, spec, limits)
    axes: dict[str, _AxisInLoop] = {}
    for name in AXES:
        learning = AxisLearning(spec, model.axis(name), target.axis(name))
        axes[name] = _AxisInLoop(learning, np.zeros(len(learning.frequencies), bool))
    steps: Mapping[str, LearningStep] = {}
    restored: tuple[str, ...] = ()
    price = 0.0
    for number in range(scans):
        scan = session.scan(f"scan_{number}", spec, model, correction)
        done = LearningScan(scan, correction, steps, restored, price)
        yield done
        restored = _added(axes, done)
        if FEWEST - 2 <= number < scans - 1:
            steps = {
                name: axis.learning.step(axis.trials, axis.held_back, axis.best())
                for name, axis in axes.items()
            }
            correction, price = drive.feasible(axes, steps, correction)


def _added(axes: Mapping[str, _AxisInLoop], done: LearningScan) -> tuple[str, ...]:
    """Take a scan; return the axes whose error has grown."""
    reference, measured, errors = done.correction.reference(), done.scan.measured, done.errors
    for name in axes:
        if not np.ptp(measured.axis(name)) > 0.0:
            raise InputError(
                f"{name}: the measured displacement does not change: check its sensor and drive"
            )
    return tuple(
        name
        for name, axis in axes.items()
        if axis.add(axis.learning.trial(reference.axis(name), measured.axis(name)), errors[name])
    )


@frozen(eq=False)
class _DriveLimits:
    """The limits of amplifier and model, which every reference must keep to."""

    model: ScannerModel
    spec: ScanSpec
    limits: DriveLimits

    def feasible(
        self, axes: Mapping[str, _AxisInLoop], steps: Mapping[str, LearningStep], before: Correction
    ) -> tuple[Correction, float]:
        """Return the correction with the lowest price of drive that keeps to the limits.

        That ``before`` where none does.
        """
        whole = self._correction(axes, steps, 0.0)
        if self._keeps(whole):
            return whole, 0.0
        dearest = 1.0 / min(float(step.effort.min()) for step in steps.values())
        cheapest = 1.0 / max(
            float(step.effort[np.abs(step.correction) > 0.0].max(initial=1.0 / dearest))
            for step in steps.values()
        )
        prices = np.geomspace(cheapest, dearest, PRICES)
        low, high = -1, PRICES
        found = before, float("inf")
        while high - low > 1:
            middle = (low + high) // 2
            tried = self._correction(axes, steps, prices[middle])
            if self._keeps(tried):
                high, found = middle, (tried, float(prices[middle]))
            else:
                low = middle
        return found

    def _correction(
        self, axes: Mapping[str, _AxisInLoop], steps: Mapping[str, LearningStep], price: float
    ) -> Correction:
        signals = {
            name: axis.learning.spectra.correction(steps[name].with_less_drive(price))
            for name, axis in axes.items()
        }
        return Correction(self.spec, **signals)

    def _keeps(self, correction: Correction) -> bool:
        period = self.spec.sample_period
        try:
            Compensation(self.model, period, INVERSES, InverseSettings(), self.limits).whole(
                correction.reference()
            )
        except ScanError:
            return False
        return True


def best_of(scans: Sequence[LearningScan]) -> LearningScan:
    """Return the scan with the least error, both axes in quadrature."""
    return min(scans, key=lambda done: sum(error**2 for error in done.errors.values()))


def observations(scans: list[LearningScan]) -> list[Record]:
    """Return the first scan and the best one as records for a diagnosis."""
    chosen = {"first": scans[0], "learned": best_of(scans)}
    return [
        Record.of_traces(name, done.scan.drive, done.scan.measured, done.scan.spec)
        for name, done in chosen.items()
    ]


def lacking(model: ScannerModel, learned: LearningScan) -> dict[str, float]:
    """Rms (m) of each axis' displacement that a model lacks at the learned drive.

    It is the desired displacement, which the scanner follows, minus the one that the model
    predicts, without its mean, on all lines but the first.
    """
    scan = learned.scan
    predicted = predict(model, scan.drive)
    where = phases(scan.spec).lines
    lines = slice(where.start + scan.spec.samples_per_line, where.stop)
    missing = {n: scan.desired.axis(n)[lines] - predicted.axis(n)[lines] for n in AXES}
    return {name: float(np.std(each)) for name, each in missing.items()}
