"""The initial hysteresis state of a record is estimated."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import DEPOLARISED, InitialState, Playback
from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.simulation.scanner import Piezoscanner
from helpers.in_process import ALL, SEED, default_model, default_plant, lines_of

LIMITS = -4.0, 4.0
SCAN = ScanSpec(lines=3, samples_per_line=2000)
UNPREPARED = evolve(SCAN, preparation="none")
HYSTERESIS = Cascade((Preisach(default_model().x.hysteresis.forward),))


def drive_of(spec: ScanSpec) -> Trace:
    limits = default_plant().amplifier.limits
    inverse = Compensation(default_model(), spec.sample_period, ALL, InverseSettings(), limits)
    return inverse.whole(desired(spec, 0, total_samples(spec)))


def last_of(*specs: ScanSpec) -> Record:
    """The last of several scans, one after the other on the same scanner."""
    scanner = Piezoscanner(default_plant(), SCAN.sample_period, SEED)
    first = 0
    for spec in specs:
        drive = drive_of(spec)
        measured, _ = scanner.advance(evolve(drive, first_sample=first))
        first += len(drive.x)
    return Record.of_traces("scan", drive, evolve(measured, first_sample=0), specs[-1])


def largest(evidence: Evidence, initial_state: InitialState) -> float:
    """Largest residual in x (m) had the record begun with another memory."""
    other = Evidence(Playback(evidence.playback.view, initial_state), evidence.limit)
    return float(np.abs(other.residual(chain_of(default_model().x))).max())


@pytest.mark.parametrize("specs", [(SCAN,), (UNPREPARED,), (evolve(SCAN, preparation="saturate"),)])
def test_a_fresh_scanner_is_depolarised(specs: tuple[ScanSpec, ...]) -> None:
    assert evidence_of("x", default_model(), last_of(*specs)).playback.initial_state == DEPOLARISED


def test_an_initial_state_that_is_ignored_costs_a_micrometre() -> None:
    evidence = evidence_of("x", default_model(), last_of(SCAN, evolve(UNPREPARED, range_x=20e-6)))
    initial_state = evidence.playback.initial_state
    lowest = lines_of(SCAN, drive_of(SCAN).x).min()
    assert largest(evidence, DEPOLARISED) > 1e-6
    assert largest(evidence, initial_state) < 0.25e-6
    assert initial_state.turns[-1] == pytest.approx(lowest, abs=0.1)


def saturated(limit: float) -> Record:
    """A scan on a scanner that went to a limit and came back, before it was recorded."""
    path = np.interp(np.linspace(0.0, 3.0, 40_000), [0.0, 1.0, 2.0, 3.0], [0.0, limit, 0.0, 0.0])
    scanner = Piezoscanner(default_plant(), SCAN.sample_period, SEED)
    scanner.advance(Trace(0, SCAN.sample_period, path, path))
    drive = drive_of(UNPREPARED)
    measured, _ = scanner.advance(evolve(drive, first_sample=len(path)))
    return Record.of_traces("scan", drive, evolve(measured, first_sample=0), UNPREPARED)


@pytest.mark.parametrize(("limit", "end"), [(-4.0, 0), (4.0, 1)])
def test_a_saturated_scanner_is_recognised(limit: float, end: int) -> None:
    evidence = evidence_of("x", default_model(), saturated(limit))
    (last,) = evidence.playback.initial_state.turns[-1:]
    assert last == pytest.approx(LIMITS[end], abs=0.2)
    assert largest(evidence, DEPOLARISED) > 1e-6
    assert largest(evidence, evidence.playback.initial_state) < 0.25e-6


def test_effective_input_counts_from_the_rest() -> None:
    drive = np.full(10, 1.0)
    np.testing.assert_allclose(InitialState((3.0,), 1.0).played(HYSTERESIS, drive), 0.0, atol=1e-12)


def test_the_initial_state_is_that_of_the_drive_before() -> None:
    before, then = InitialState((3.0, -2.0), 0.5), 1.5 * np.sin(np.linspace(0.0, 9.0, 500))
    whole = HYSTERESIS.apply(HYSTERESIS.at_rest(), np.concatenate([before.path(), then]))[1]
    played: Array = before.played(HYSTERESIS, then)
    count = len(before.path())
    np.testing.assert_allclose(played, whole[count:] - whole[count - 1], atol=1e-12)
