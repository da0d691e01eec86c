"""Each number that decides a verdict decides it where the page of the constants says.

The numbers are written out here, and each case lies on either side of one: a constant that is
doubled or halved fails a test.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from attrs import evolve, frozen
from scipy.stats import f as fisher

from afm_scan_ros.core.diagnosis.axis_diagnosis import FOUND, UNEXPLAINED, AxisDiagnosis
from afm_scan_ros.core.diagnosis.candidates import LOG_ODDS, Candidate, FittedCandidates
from afm_scan_ros.core.diagnosis.discrepancy import (
    DetectionLimit,
    detection_limit,
    places_moved,
    untested_motion,
)
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.fit import Fit
from afm_scan_ros.core.diagnosis.likelihood import CellFit
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import AxisSignals, Playback
from afm_scan_ros.core.diagnosis.search import Posterior, Selection
from afm_scan_ros.core.diagnosis.settings import LIKELIHOOD
from afm_scan_ros.core.diagnosis.variance import CellVariance, log_density
from afm_scan_ros.core.effects.registry import CATALOGUE, effect_type
from afm_scan_ros.core.model import ModelDiscrepancy, band_edges
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from helpers.in_process import default_model
from helpers.posteriors import no_effect

NU, KAPPA, UNTESTED = 1.4, 8.0, 2.0
PERIOD, RESONANCE = 1e-4, 1000.0
EDGES = np.array(band_edges(PERIOD, RESONANCE))


def fit_of_tails(*tails: float) -> CellFit:
    """Bands of healthy variance 1 m² whose residual is exceeded with these probabilities."""
    power = fisher.isf(np.array(tails), NU, KAPPA)
    return CellFit(power, *np.outer((1.0, KAPPA, NU), np.ones(len(tails))), 0.0)


@pytest.mark.parametrize("power", [0.0, 0.5, 4.0, 100.0])
def test_the_density_is_that_of_the_page(power: float) -> None:
    variance = 3.0
    by_hand = -NU / 2 * np.log(variance) - (NU + KAPPA) / 2 * np.log1p(
        NU * power / KAPPA / variance
    )
    found = log_density(np.array(power), np.array(variance), np.array(KAPPA), np.array(NU))
    assert found == pytest.approx(by_hand)


def test_the_prior_odds_are_half_an_effect_a_scanner() -> None:
    assert pytest.approx(np.log(0.5 / len(CATALOGUE))) == LOG_ODDS


def test_a_formula_is_exact_or_wrong_by_a_tenth() -> None:
    assert LIKELIHOOD.formula_error == 0.1


def limit(rms: float, noise: float) -> DetectionLimit:
    return DetectionLimit((0.0, 10.0), np.array([rms]), np.array([noise]), RESONANCE)


def test_the_variance_is_noise_and_three_tenths_of_the_discrepancy() -> None:
    found = CellVariance.of_motion(limit(5.0, 3.0), KAPPA)
    assert found.total == pytest.approx([9.0 + 0.3 * 16.0])
    assert found.freedom == pytest.approx([NU])


def test_an_untested_error_is_known_from_two_amplitudes() -> None:
    view = AxisSignals("record", PERIOD, *(np.zeros(100) for _ in range(3)))
    tested = Evidence(Playback(view), limit(1.0, 1.0))
    assert tested.variance.known == pytest.approx([KAPPA])
    moved = untested_motion((), np.sin(np.arange(1000.0)), PERIOD, RESONANCE)
    untested = Evidence(tested.playback, tested.limit, moved)
    assert untested.variance.known == pytest.approx([UNTESTED])


@pytest.mark.parametrize(("tail", "searched"), [(0.007, True), (0.014, False)])
def test_effects_are_searched_from_one_healthy_scan_in_a_hundred_on(
    tail: float,
    searched: bool,  # noqa: FBT001 - a parameter
) -> None:
    assert fit_of_tails(0.5, tail).unremarkable != searched


@pytest.mark.parametrize(("tail", "adequate"), [(0.0035, False), (0.007, True)])
def test_the_false_discovery_rate_is_a_hundredth(
    tail: float,
    adequate: bool,  # noqa: FBT001 - a parameter
) -> None:
    """Of two bands, the smaller tail is compared with half the rate."""
    assert fit_of_tails(0.5, tail).adequate == adequate


@frozen
class Motion:
    """Motion (m rms) and its relative error in each band, as in a record."""

    moved: Array
    share: Array

    def known(self, *, fitted: bool = False) -> ModelDiscrepancy:
        bands = tuple(EDGES)
        return ModelDiscrepancy(
            "record", bands, self.share * self.moved, 0.0 * self.moved, self.moved, fitted
        )


def signal_of(moved: Array) -> Array:
    """A sine in the middle of each band, of these rms values (m)."""
    time = PERIOD * np.arange(200_000)
    centres = 0.5 * (EDGES[1:] + EDGES[:-1])
    waves = (m * 2**0.5 * np.sin(2 * np.pi * c * time) for m, c in zip(moved, centres, strict=True))
    return np.asarray(sum(waves))


COUNT = len(EDGES) - 1
FLAT = np.full(COUNT, 1e-6)
TEST = Motion(FLAT, np.full(COUNT, 0.01))


def limit_of(moved: Array, *known: ModelDiscrepancy) -> Array:
    return detection_limit(known, signal_of(moved), PERIOD, RESONANCE).rms


@pytest.mark.parametrize(("ratio", "alike"), [(1.3, True), (1.6, False), (0.75, True)])
def test_motions_of_one_kind_differ_by_less_than_the_root_of_two(
    ratio: float,
    alike: bool,  # noqa: FBT001 - a parameter
) -> None:
    """A fitted record tells the error of motion of its kind alone."""
    fitted = TEST.known(fitted=True)
    assert (untested_motion([fitted], signal_of(ratio * FLAT), PERIOD, RESONANCE) is None) == alike


def test_a_fifth_of_the_largest_band_counts_as_motion() -> None:
    assert places_moved(np.array([1.0, 0.15, 0.25])).tolist() == [0, 2]


VIBRATING = int(np.argmax(EDGES >= 0.65 * RESONANCE))


def test_modes_may_be_missed_from_two_thirds_of_the_resonance_on() -> None:
    """There the largest share of any record counts, one and a half times."""
    assert EDGES[VIBRATING] == pytest.approx(660.0)
    other = Motion(3.0 * FLAT, np.full(COUNT, 0.05))
    found = limit_of(0.4 * FLAT, TEST.known(), other.known()) / (0.4 * FLAT)
    assert found[VIBRATING:] == pytest.approx(np.full(COUNT - VIBRATING, 1.5 * 0.05), rel=0.05)
    assert np.all(found[:VIBRATING] < 0.03)


def test_half_an_error_may_lie_in_the_band_above() -> None:
    """Of a slow motion that errs in the third band, at rest in the fourth."""
    moved, share = np.full(COUNT, 1e-9), np.full(COUNT, 0.01)
    moved[2], share[2] = 1e-6, 0.1
    found = limit_of(2.0 * moved, Motion(moved, share).known())
    assert found[3] == pytest.approx(0.5 * found[2], rel=0.1)


def test_half_of_that_half_may_lie_in_the_next_band_up_to_the_resonance() -> None:
    moved = np.where(np.arange(COUNT) == 2, 1e-6, 1e-12)
    found = limit_of(2.0 * moved, Motion(moved, np.full(COUNT, 0.1)).known())
    assert found[4 : VIBRATING + 1] == pytest.approx(
        found[2] * 0.5 ** np.arange(2, VIBRATING - 1), rel=0.01
    )
    assert np.all(found[VIBRATING + 1 :] < 0.1 * found[VIBRATING])


@pytest.mark.parametrize(("size", "share"), [(0.5, 0.01), (2.0, 0.04), (6.0, 0.07)])
def test_a_share_is_that_of_the_nearest_amplitudes_of_records_that_moved(
    size: float, share: float
) -> None:
    """Between two records it lies as the logarithm of the amplitude, beyond them it stays."""
    small, large = (Motion(k * FLAT, np.full(COUNT, s)) for k, s in ((1.0, 0.01), (4.0, 0.07)))
    first = np.arange(COUNT) == 0
    still = Motion(np.where(first, 5e-5, 1e-12), np.where(first, 0.01, 0.5))
    found = limit_of(size * FLAT, small.known(), large.known(), still.known()) / (size * FLAT)
    assert found[1:VIBRATING] == pytest.approx(np.full(VIBRATING - 1, share), rel=0.05)


def test_where_no_record_moved_the_largest_share_counts() -> None:
    moved = np.where(np.arange(COUNT) < 3, 1e-6, 1e-12)
    share = np.where(np.arange(COUNT) == 1, 0.07, 0.01)
    found = limit_of(3.0 * FLAT, Motion(moved, share).known()) / (3.0 * FLAT)
    assert found[3:VIBRATING] == pytest.approx(np.full(VIBRATING - 3, 0.07), rel=0.05)


def test_at_rest_in_a_band_the_least_error_of_any_record_scales_with_the_whole_motion() -> None:
    moved = np.where(np.arange(COUNT) == 0, 1e-6, 1e-12)
    known = [
        evolve(Motion(size * moved, 0.0 * FLAT).known(), rms=np.full(COUNT, rms))
        for size, rms in ((1.0, 3e-9), (4.0, 8e-9))
    ]
    found = limit_of(2.0 * moved, *known)[2:VIBRATING]
    assert found == pytest.approx(np.full(VIBRATING - 2, 4e-9), rel=0.05)


def test_what_a_model_states_beyond_its_parameters_adds_to_what_its_records_tell() -> None:
    spread: Any = SimpleNamespace(bands=EDGES, shares=np.full(COUNT, 0.04))
    known = [Motion(FLAT, np.full(COUNT, 0.03)).known()]
    found = detection_limit(known, signal_of(3.0 * FLAT), PERIOD, RESONANCE, spread)
    shares = found.rms[:VIBRATING] / (3.0 * FLAT[:VIBRATING])
    assert shares == pytest.approx(np.full(VIBRATING, 0.05), rel=0.05)


def test_bands_end_below_seven_tenths_of_half_the_sample_rate() -> None:
    """The edge at 5.3 resonances lies above 70 % of it here, that at 3.74 below."""
    edges = band_edges(0.5 / (5.3 * RESONANCE / 0.72), RESONANCE)
    assert edges[-2] == pytest.approx(3740.0)
    assert band_edges(0.5 / (5.3 * RESONANCE / 0.68), RESONANCE)[-2] == pytest.approx(5300.0)


@pytest.mark.parametrize(("seconds", "bands"), [(2.9, 2), (3.1, 1)])
def test_a_record_without_a_preparation_may_err_thrice_in_its_first_three_cycles(
    seconds: float, bands: int
) -> None:
    found = DetectionLimit((0.0, 1.0, 3.0, 10.0), np.ones(3), np.zeros(3), RESONANCE)
    assert found.unprepared(seconds).rms == pytest.approx([3.0] * bands + [1.0] * (3 - bands))


LAG = effect_type("rate_dependent_hysteresis").form("")
"""Its time constant is from 0 to 1 s."""


def verdict_of(left: CellFit, seconds: float) -> str:
    """Verdict where a lag of so many seconds leaves so much."""
    fit = Fit(np.array([[seconds]]), np.array([0.1]))
    trial = FittedCandidates((Candidate(effect_type("rate_dependent_hysteresis"), LAG),), fit, left)
    without = no_effect(evolve(left, log_likelihood=-100.0))
    selection = Selection(without, (trial,), Posterior.of(without, [trial]))
    view = AxisSignals("record", PERIOD, *(np.zeros(100) for _ in range(3)))
    chain, evidence = chain_of(default_model().x), Evidence(Playback(view), limit(1.0, 1.0))
    return AxisDiagnosis("x", (evidence,), chain, chain, chain, selection, ()).verdict


@pytest.mark.parametrize(
    ("power", "seconds", "verdict"),
    [(30.0, 0.5, FOUND), (30.0, 1.0, UNEXPLAINED), (1.0, 1.0, FOUND)],
)
def test_the_error_of_a_formula_counts_inside_the_range_alone(
    power: float, seconds: float, verdict: str
) -> None:
    """At an end of its range an effect must explain the residual as if its formula were exact."""
    left = CellFit(*(np.array([each]) for each in (power, 30.0, KAPPA, NU)), 0.0)
    assert verdict_of(left, seconds) == verdict


@pytest.mark.parametrize(("tail", "verdict"), [(0.007, UNEXPLAINED), (0.014, FOUND)])
def test_what_an_effect_leaves_is_judged_as_beside_a_known_error(tail: float, verdict: str) -> None:
    power = fisher.isf(tail, NU, KAPPA)
    left = CellFit(*(np.array([each]) for each in (power, 1.0, UNTESTED, NU)), 0.0)
    assert left.adequate
    assert verdict_of(left, 0.5) == verdict


def test_a_record_that_begins_depolarised_errs_no_more_at_its_first_move() -> None:
    time, model = PERIOD * np.arange(2000), default_model()
    drive = np.sin(20.0 * np.pi * time)
    moved = 4e-6 * drive
    limits = [
        evidence_of("x", model, Record(drive, moved, PERIOD, start=start)).limit.rms
        for start in ("depolarised", "unknown")
    ]
    assert limits[1].max() == pytest.approx(3.0 * limits[0].max(), rel=0.01)
