"""A model from records of any kinds, fitted together: what it predicts, and what it states."""

from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from scipy import signal

import afm_scan_ros as afm
from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.creep import Creep, CreepModel
from afm_scan_ros.core.effects.hysteresis.duhem import DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.vibration import Vibration, VibrationModel
from afm_scan_ros.core.fit.stretches import averaged
from afm_scan_ros.core.identification.findings import (
    Hum,
    NotValidated,
    UncertainScan,
)
from afm_scan_ros.core.identification.identify import FittedAxis, identify_axis
from afm_scan_ros.core.model import ParameterInterval, Status
from afm_scan_ros.core.prediction import apart, discrepancy
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.loops.density import CellGrid, surface_of
from helpers.fit_cases import CREEP, OPERATORS, PERIOD, displaced, levels, of_bouc_wen, record

LOWER, UPPER = -1.0, 2.5
SAMPLE_PERIOD = 5e-3
NOISE = 70e-9  # m rms


def truth() -> Cascade:
    """Hysteresis of random density, a lag of 12 ms, 3 % of creep in 8 s; displacement in m."""
    rng = np.random.default_rng(1)
    grid = CellGrid(LOWER, UPPER, 9)  # in none of the grids that are fitted
    density = rng.uniform(0.2, 1.0, (grid.cells, grid.cells)) + 6.0 * np.eye(grid.cells)
    weights = density[np.tril_indices(grid.cells)]
    surface = surface_of(weights / weights.sum(), grid, offset=0.0)
    from_rest = evolve(surface, offset=-float(Preisach(surface).at_rest().now[1]))
    lag = VibrationModel((10e-6,), (0.012, 1.0))  # F runs over 2 V
    creep = CreepModel((0.03,), (8.0,))
    parts = Preisach(from_rest), Vibration(lag, SAMPLE_PERIOD), Creep(creep, SAMPLE_PERIOD)
    return Cascade(parts)


TRUTH = truth()


def moved(drive: Array) -> Array:
    """True displacement (m) from depolarised rest on, but for where that is."""
    return TRUTH.apply(TRUTH.at_rest(), drive)[1]


def swinging(seconds: float, envelope: Array, rate: float = 1.0) -> Array:
    """Drive that swings about zero; the envelope from 0 to 1 at equal times."""
    time = np.arange(0.0, seconds, SAMPLE_PERIOD)
    size = np.interp(time, np.linspace(0.0, seconds, len(envelope)), envelope)
    wave = size * np.sin(2.0 * np.pi * rate * time)
    return np.asarray(np.where(wave > 0.0, UPPER * wave, -LOWER * wave))


LOOPS = swinging(30.0, np.array([1.0, 1.0, 0.1, 0.9]))
FRESH = swinging(20.0, np.array([0.9, 0.2, 0.7, 0.1, 0.8]), rate=0.7)
LOWEST = int(np.argmin(LOOPS))
ORIGIN = -96e-6  # m


def measured(name: str, drive: Array, seed: int, start: str = "unknown", kind: str = "") -> Record:
    """Record of a sensor with noise, whose zero is elsewhere."""
    noise = np.random.default_rng(seed).normal(0.0, NOISE, len(drive))
    moved_there = ORIGIN + moved(drive) + noise
    return Record(drive, moved_there, SAMPLE_PERIOD, name=name, start=start, kind=kind or None)


def error_on(found: FittedAxis, drive: Array) -> float:
    """Standard deviation (m) of what a model misses, once its memory is that of the scanner."""
    model = forward(found.model, SAMPLE_PERIOD)
    return float(np.std((model.apply(model.at_rest(), drive)[1] - moved(drive))[400:]))


@pytest.fixture(
    scope="module", params=["depolarised", pytest.param("unknown", marks=pytest.mark.evidence)]
)
def fit(request: pytest.FixtureRequest) -> FittedAxis:
    given = measured("loops", LOOPS, 2, request.param)
    held_out = measured("fresh", FRESH, 5, request.param, "validation")
    return identify_axis([given, held_out], "x", lambda _: None)


def test_records_are_matched_to_the_noise(fit: FittedAxis) -> None:
    assert 0.9 * NOISE < fit.records[0].misfit.sigma < 1.1 * NOISE


def test_what_is_left_of_a_record_is_that_of_the_model_that_is_saved(fit: FittedAxis) -> None:
    """As ``predict`` gives it from depolarised rest, but for what is free in the record."""
    record, model = fit.records[0], forward(fit.model, SAMPLE_PERIOD)
    given = measured("loops", LOOPS, 2)
    left = given.displacement[:, 0] - model.apply(model.at_rest(), LOOPS)[1]
    length = record.seconds[1] - record.seconds[0]
    blocks = averaged(left, round(length / SAMPLE_PERIOD))[
        round(record.seconds[0] / length - 0.5) :
    ]
    assert len(record.left) == len(blocks)
    assert np.corrcoef(record.left, blocks)[0, 1] > 0.95


def test_fit_and_model_are_both_stated_where_they_leave_otherwise(fit: FittedAxis) -> None:
    record = fit.records[0]
    assert not record.fitted_otherwise
    for share, otherwise in ((0.85, True), (0.95, False), (1.15, True)):
        by_fit = evolve(record.by_fit, sigma=record.misfit.sigma / share)
        assert evolve(record, by_fit=by_fit).fitted_otherwise == otherwise


def within(interval: ParameterInterval, true: float) -> bool:
    """Whether a value lies within one and a half times the 95 % interval: chance leaves 0.3 %."""
    assert interval.lower is not None
    assert interval.upper is not None
    middle, half = 0.5 * (interval.lower + interval.upper), 0.5 * (interval.upper - interval.lower)
    return abs(true - middle) < 1.5 * half


def test_lag_and_creep_lie_within_their_intervals(fit: FittedAxis) -> None:
    effects = fit.model.effects
    (lag,), (gain,) = effects.vibration.intervals, effects.creep.intervals
    assert (lag.name, gain.name) == ("lag", "gain")
    assert within(lag, 0.012)
    assert within(gain, 0.03)


def test_fresh_loops_of_another_rate_are_predicted_close_to_the_noise(fit: FittedAxis) -> None:
    assert error_on(fit, FRESH) < NOISE


def stated_of(found: FittedAxis, drive: Array) -> float:
    """Standard deviation (m) that is stated of the same."""
    spread = found.model.spread
    assert spread is not None
    apart_by = np.var(apart(found.model, spread, drive, SAMPLE_PERIOD)[:, 400:], axis=1)
    return float(
        np.hypot(np.sqrt(apart_by.sum()), discrepancy(spread, moved(drive), SAMPLE_PERIOD))
    )


def test_a_motion_is_as_uncertain_as_is_stated(fit: FittedAxis) -> None:
    """Of a fresh one over nine tenths of the drive, within a factor of 2.5."""
    assert error_on(fit, FRESH) / 2.5 < stated_of(fit, FRESH) < 2.5 * error_on(fit, FRESH)


def test_the_record_held_out_gives_the_error(fit: FittedAxis) -> None:
    assert [one.record for one in fit.validations] == ["fresh"]
    known, *fitted = fit.model.model_discrepancies
    assert known.record.startswith("fresh")
    assert [each.fitted for each in fitted] == [True]
    assert not any(isinstance(each, NotValidated) for each in fit.warnings)


@pytest.mark.evidence
def test_records_of_unlike_rates_and_sizes_are_fitted_together() -> None:
    size = np.array([1.0, 1.0])
    records = [
        measured("slow", swinging(12.0, size), 3),
        measured("fast", swinging(6.0, 0.5 * size, rate=4.0), 4),
    ]
    found = identify_axis(records, "x", lambda _: None)
    fresh = swinging(10.0, 0.75 * size, rate=2.0)
    assert error_on(found, fresh) < 3e-3 * np.ptp(moved(fresh))


@pytest.mark.evidence
def test_curves_that_turn_in_part_of_the_drive_predict_those_between() -> None:
    """A scanner without lag or creep: a sample later the displacement is where the drive led."""

    def curves(turns: Array) -> Array:
        each = [np.linspace(turn, UPPER, 50) for turn in turns]
        return np.concatenate([[UPPER], *each, [UPPER]])

    def answer(drive: Array) -> Array:
        plays = np.full(20, UPPER) - (widths := np.linspace(0.0, 1.5, 20))
        rows_of_record = []
        for each in drive:
            plays = np.clip(plays, each - widths, each + widths)
            rows_of_record.append(1e-6 * plays.sum())
        return np.roll(rows_of_record, 1)

    drive, fresh = (curves(np.linspace(LOWER, top, count)) for top, count in ((1.0, 21), (0.9, 14)))
    found = identify_axis([Record(drive, answer(drive), 1.0)], "x", lambda _: None)
    assert found.model.effects.hysteresis.status is Status.IDENTIFIED
    model = forward(found.model, 1.0)
    error = (model.apply(model.at_rest(), fresh)[1] - answer(fresh))[1:]
    assert np.std(error) < 1e-2 * np.ptp(answer(fresh)[1:])


@pytest.mark.parametrize(
    ("operator", "kind"), [("plays", EverettSurface), ("bouc_wen", DuhemSlopes)]
)
def test_a_model_of_either_operator_is_saved_and_predicts_the_same(
    operator: str, kind: type, tmp_path: Path
) -> None:
    drive = levels(1, 14, 600)
    model = afm.identify([record(OPERATORS[operator], drive)])
    model.save(tmp_path / "model.yaml")
    loaded = afm.load_model(tmp_path / "model.yaml")
    assert isinstance(loaded.scanner.axis("x").hysteresis.forward, kind)
    expected, found = (each.predict(0.9 * drive, PERIOD) for each in (model, loaded))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-6 * np.ptp(expected))


@pytest.mark.evidence
def test_steps_alone_tell_creep_and_not_hysteresis() -> None:
    period = 0.01
    drive = np.repeat([0.0, 0.6, 1.2, 0.3], [500, 3000, 3000, 3000])
    noise = np.random.default_rng(8).normal(0.0, 1e-9, len(drive))
    measured_there = displaced(OPERATORS["bouc_wen"], drive, period) + noise
    steps = Record(drive, measured_there, period, start="depolarised", name="steps")
    found = identify_axis([steps], "x", lambda _: None)
    statuses = {name: each.status for name, each in found.model.effects.each()}
    assert statuses == {
        "creep": Status.IDENTIFIED,
        "hysteresis": Status.UNKNOWN,
        "vibration": Status.UNKNOWN,
    }
    (interval,) = found.model.effects.creep.intervals
    assert within(interval, CREEP[0])
    (finding,) = (each for each in found.warnings if isinstance(each, UncertainScan))
    assert finding.share == found.deviation


def test_loops_of_one_size_do_not_tell_smaller_ones() -> None:
    """Of one state they look like those of plays, which open otherwise where they are smaller."""
    seconds = 1e-3 * np.arange(3000)
    drive = 3.5 * signal.sawtooth(2.0 * np.pi * seconds + 0.5 * np.pi, 0.5)
    noise = np.random.default_rng(3).normal(0.0, 5e-10, len(drive))
    triangles = Record(drive, 1e-6 * of_bouc_wen(drive) + noise, 1e-3, name="triangles")
    found = identify_axis([triangles], "x")
    assert any(isinstance(each, UncertainScan) for each in found.warnings)


def test_hum_in_a_record_is_named_with_its_amplitude() -> None:
    tone = 20e-9
    found = identify_axis([record(OPERATORS["plays"], levels(1, 14, 600), tone)], "x", print)
    (hum,) = (each for each in found.warnings if isinstance(each, Hum))
    ((frequency, amplitude),) = hum.lines
    assert frequency == pytest.approx(50.02, abs=0.15)  # half a bin of 3.3 s
    assert amplitude == pytest.approx(tone, rel=0.1)


@pytest.mark.evidence
def test_scans_alone_tell_a_scanner_of_one_state_from_plays() -> None:
    """Plays miss it by residuals that go on over whole lines, but one state leaves noise."""
    cycles = 2e-4 * np.arange(16_000)
    triangle = 2.0 * np.abs(2.0 * ((cycles + 0.25) % 1.0) - 1.0) - 1.0
    scans = [record(OPERATORS["bouc_wen"], size * triangle) for size in (3.0, 1.3)]
    found = identify_axis(scans, "x", lambda _: None)
    assert found.operator == "one state"
    fresh = 2.2 * triangle
    model = forward(found.model, PERIOD)
    predicted, true = model.apply(model.at_rest(), fresh)[1], displaced(of_bouc_wen, fresh)
    assert np.std((predicted - true)[4000:]) < 1e-2 * np.ptp(true)  # one rate tells no creep
