"""Learning lowers the error of scanners that differ from the model, and never leaves it raised."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from attrs import define, evolve, field

from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.features.learning.loop import LearningScan, best_of, lacking, learn
from afm_scan_ros.simulation.axis import detuned_axis
from afm_scan_ros.simulation.scanner import PlantSpec
from helpers.in_process import InProcessSession, default_model, default_plant

SPEC = ScanSpec(
    line_rate=100.0, lines=6, samples_per_line=500, turnaround=0.2, preparation_cycles=5
)
LIMITS = DriveLimits(5.0, 2e5)


def detuned(factor: float) -> PlantSpec:
    """Plant whose first resonance and its damping are off by a factor."""
    plant = default_plant()
    return evolve(plant, **{n: detuned_axis(getattr(plant, n), factor, factor) for n in AXES})


def learned(
    session: InProcessSession, scans: int = 4, limits: DriveLimits = LIMITS, **spec: object
) -> list[LearningScan]:
    return list(learn(session, default_model(), evolve(SPEC, **spec), scans, limits))


def errors(done: LearningScan) -> tuple[float, float]:
    """True errors at constant speed, m."""
    found = done.scan.tracking("true")
    assert found.x.constant_speed is not None
    assert found.y.trace is not None
    return found.x.constant_speed.rms, found.y.trace.rms


@pytest.mark.parametrize("factor", [0.95, 1.0, 1.05])
def test_each_scan_is_better_than_the_one_before(factor: float) -> None:
    scans = learned(InProcessSession(detuned(factor)))
    for axis in range(2):
        _, *history = (errors(done)[axis] for done in scans)
        assert all(later < 1.05 * earlier for earlier, later in pairwise(history))
        assert history[-1] < 0.35 * history[0]
    assert errors(scans[-1])[0] < 0.0002 * SPEC.range_x


def test_the_bound_on_the_next_error_holds() -> None:
    scans = learned(InProcessSession(detuned(0.97)))
    for before, after in pairwise(scans[1:]):
        for axis, test in after.convergence.items():
            assert after.errors[axis] < 1.1 * test.bound * before.errors[axis]


def test_the_slow_rates_learn_the_ringing_too() -> None:
    scans = learned(InProcessSession(default_plant(), seed=5), 5, line_rate=20.0)
    assert errors(scans[-1])[0] < 0.15 * errors(scans[0])[0]


def test_what_a_model_lacks_is_what_learning_added() -> None:
    scans = learned(InProcessSession(detuned(0.95)))
    found = lacking(default_model(), best_of(scans))
    assert found["x"] == pytest.approx(errors(scans[0])[0], rel=0.6)


@define
class Drifting(InProcessSession):
    """A scanner whose position moves by another amount along each scan."""

    _way: list[float] = field(factory=lambda: [1.0, -1.0, 1.0, -1.0, 1.0, -1.0])

    def scan(
        self, label: str, spec: ScanSpec, model: ScannerModel, correction: Correction | None = None
    ) -> Scan:
        done = super().scan(label, spec, model, correction)
        ramp = 2e-7 * self._way.pop(0) * np.linspace(0.0, 1.0, len(done.measured.x))
        measured, true = (
            Trace(0, t.sample_period, t.x + ramp, t.y) for t in (done.measured, done.true)
        )
        return Scan(spec, done.desired, done.drive, measured, true)


def test_what_does_not_repeat_is_not_learned() -> None:
    scans = learned(Drifting(default_plant()))
    before, after = (
        float(np.std(done.scan.true.x - done.scan.desired.x)) for done in (scans[0], scans[-1])
    )
    # One scan's drift may stand in the correction, beside that of the scan itself.
    assert after < 1.05 * np.sqrt(2.0) * before
    assert best_of(scans).errors["x"] <= scans[0].errors["x"]


@define
class Turned(InProcessSession):
    """A scanner whose fast response turns round after three scans: what was learned is wrong."""

    def scan(
        self, label: str, spec: ScanSpec, model: ScannerModel, correction: Correction | None = None
    ) -> Scan:
        done = super().scan(label, spec, model, correction)
        if self._made <= 3 or correction is None:
            return done
        wrong = -3.0 * correction.x
        measured, true = (
            Trace(0, t.sample_period, t.x + wrong, t.y) for t in (done.measured, done.true)
        )
        return Scan(spec, done.desired, done.drive, measured, true)


def test_an_error_that_has_grown_restores_the_best_correction() -> None:
    scans = learned(Turned(detuned(0.95)), 6)
    assert any("x" in done.restored for done in scans)
    assert best_of(scans) is scans[2]


def test_the_limits_of_the_drive_hold() -> None:
    whole = learned(InProcessSession(detuned(0.95)))
    peak = max(float(np.abs(whole[0].scan.drive.axis(axis)).max()) for axis in AXES)
    largest = max(float(np.abs(np.diff(whole[0].scan.drive.x)).max()) for _ in AXES)
    limits = DriveLimits(peak * 1.0001, 1.02 * largest / SPEC.sample_period)
    scans = learned(InProcessSession(detuned(0.95)), limits=limits)
    for done in scans:
        limits.refuse_beyond(done.scan.drive, dict.fromkeys(AXES, 0.0))
    assert any(done.price > 0.0 for done in scans)
    assert errors(best_of(scans))[0] <= errors(scans[0])[0]


def test_a_sensor_without_noise_is_learned_from() -> None:
    plant = detuned(0.95)
    scans = learned(InProcessSession(evolve(plant, sensor=evolve(plant.sensor, noise_rms=0.0))))
    assert errors(scans[-1])[0] < 0.05 * errors(scans[0])[0]


def test_two_scans_show_nothing_to_learn() -> None:
    with pytest.raises(InputError, match="give 3 or more"):
        learned(InProcessSession(default_plant()), 2)


@define
class NoiseRepeats(InProcessSession):
    """A simulated scanner whose sensor has the same noise in each scan."""

    def _next_seed(self) -> int:
        return self.seed


def test_a_scanner_that_repeats_its_noise_is_learned() -> None:
    scans = learned(NoiseRepeats(default_plant()))
    assert errors(scans[-1])[0] < 0.5 * errors(scans[0])[0]


@define
class RepeatingDrift(InProcessSession):
    """A scanner that moves by as much along each scan, slowly beside its lines."""

    def scan(
        self, label: str, spec: ScanSpec, model: ScannerModel, correction: Correction | None = None
    ) -> Scan:
        done = super().scan(label, spec, model, correction)
        ramp = 2e-6 * np.linspace(0.0, 1.0, len(done.measured.x))
        measured, true = (
            Trace(0, t.sample_period, t.x + ramp, t.y) for t in (done.measured, done.true)
        )
        return Scan(spec, done.desired, done.drive, measured, true)


def test_a_disturbance_that_repeats_is_no_response() -> None:
    """Below the line rate x hardly moves: the drift there says nothing of the response."""
    scans = learned(RepeatingDrift(default_plant()))
    assert errors(scans[2])[0] < 0.5 * errors(scans[0])[0]
    assert errors(scans[-1])[0] < 0.05 * errors(scans[0])[0]


def test_a_sensor_that_stands_still_is_named() -> None:
    class Dead(InProcessSession):
        def scan(self, *given: Any, **further: Any) -> Scan:  # noqa: ANN401 - the session's
            done = super().scan(*given, **further)
            still = Trace(0, SPEC.sample_period, 0.0 * done.measured.x, done.measured.y)
            return Scan(SPEC, done.desired, done.drive, still)

    with pytest.raises(InputError, match="x: the measured displacement does not change"):
        learned(Dead(default_plant()))
