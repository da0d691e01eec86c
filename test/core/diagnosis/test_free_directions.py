"""The directions of a model's spread are free in every hypothesis."""

from functools import cache, partial

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, FOUND, SUFFICIENT, AxisDiagnosis
from afm_scan_ros.core.diagnosis.diagnosis import diagnose
from afm_scan_ros.core.diagnosis.fit import BaseRidge
from afm_scan_ros.core.diagnosis.free_directions import with_free_directions
from afm_scan_ros.core.diagnosis.likelihood import Likelihood, LinearResidual, Outside
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.settings import VARIANCE
from afm_scan_ros.core.diagnosis.variance import log_density, weights
from afm_scan_ros.core.effects.parameter_shift import insert_creep, insert_resonance
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from helpers.in_process import ALL, default_model, scan
from helpers.spreads import known

SPEC = ScanSpec(line_rate=20.0, lines=6, samples_per_line=500)
CHAIN = chain_of(default_model().x)
BANDS, KNOWN, FEW = 12, np.full(12, 8.0), np.full(12, VARIANCE.freedom)
SEEDS = st.integers(0, 2**32 - 1)
SIZED = st.floats(0.1, 30.0)
SETTLED = 20_000


def creep_alone(width: float) -> AxisModel:
    """A model that knows all but creep's gains."""
    axis = known(CHAIN.model, width)
    assert axis.spread is not None
    return evolve(axis, spread=evolve(axis.spread, directions=axis.spread.directions[:1]))


def answer(chain: Chain, drive: Array) -> Array:
    """Displacement (n,) of a scanner that has settled at 0 V."""
    cascade = chain.forward(SPEC.sample_period)
    moved = cascade.apply(cascade.at_rest(), np.concatenate((np.zeros(SETTLED), drive)))[1]
    return moved[SETTLED:]


@cache
def recorded(factor: float, delay: float = 0.0) -> Record:
    """A scan of x whose creep's gains are those of the model times a factor."""
    done = scan(SPEC, ALL)
    changed = insert_creep(CHAIN, np.array([factor, 1.0]))
    if delay:
        changed = effect_type("delay").form("").insert(changed, np.array([delay]))
    more = answer(changed, done.drive.x) - answer(CHAIN, done.drive.x)
    moved = evolve(done.measured, x=done.measured.x + more)
    return Record.of_traces("scan", done.drive, moved, SPEC, axes=("x",))


def diagnosed(width: float, record: Record) -> AxisDiagnosis:
    model = evolve(default_model(), x=known(default_model().x, width), y=None)
    return diagnose(model, [record]).by_axis["x"]


FACTOR, WIDE = 2.0, 1.0


@pytest.mark.evidence
def test_an_error_that_the_model_admits_is_no_effect() -> None:
    """One standard deviation of a wide interval, against many of a narrow one."""
    admitted, denied = (diagnosed(width, recorded(FACTOR)) for width in (WIDE, 1e-3))
    assert admitted.verdict == SUFFICIENT
    assert admitted.deviations[0] == pytest.approx((FACTOR - 1.0) / WIDE, rel=0.2)
    assert denied.verdict in (FOUND, AMBIGUOUS)
    assert denied.selection.posterior.of_effect("parameter_shift") > 0.1


@pytest.mark.evidence
def test_an_effect_is_named_beside_a_wide_direction() -> None:
    late = 2e-4
    found = diagnosed(WIDE, recorded(FACTOR, late))
    assert found.verdict == FOUND
    selected = found.selection.selected
    assert selected is not None
    assert selected.names == ("delay",)
    assert abs(selected.fit.values[0] - late) < selected.fit.halfwidth[0]


@pytest.mark.parametrize("width", [1e-9, None])
def test_exact_or_unstated_parameters_change_nothing(width: float | None) -> None:
    axis = default_model().x if width is None else known(default_model().x, width)
    given = evidence_of("x", default_model(), recorded(FACTOR))
    (same,) = with_free_directions([given], chain_of(axis))
    assert len(same.base) == 0


def test_a_direction_is_free_where_the_records_hold_a_hundredth_of_its_information() -> None:
    seen = evidence_of("x", default_model(), recorded(1.0))

    def free(width: float) -> int:
        (found,) = with_free_directions([seen], chain_of(creep_alone(width)))
        return len(found.base)

    (wide,) = with_free_directions([seen], chain_of(creep_alone(1.0)))
    moved = seen.cells.power(seen.cells.along(wide.base[:1])[0])
    told = float(seen.variance.weights(0.0 * seen.variance.total) @ moved)
    assert free((0.009 / told) ** 0.5) == 0
    assert free((0.011 / told) ** 0.5) == 1


def test_every_hypothesis_has_the_free_directions() -> None:
    """An error that they explain makes both no effect and something outside likelier."""
    fixed = evidence_of("x", default_model(), recorded(FACTOR))
    (free,) = with_free_directions([fixed], chain_of(known(CHAIN.model, WIDE)))
    less, more = (Likelihood((each,), CHAIN) for each in (fixed, free))
    assert more.fit(CHAIN).log_likelihood > less.fit(CHAIN).log_likelihood + 1.0
    assert more.outside() > less.outside() + 1.0


@pytest.mark.parametrize(
    ("place", "changed"),
    [
        (0, lambda chain, by: insert_creep(chain, np.array([1.0 + by, 1.0]))),
        (1, lambda chain, by: insert_resonance(chain, np.array([1.0 + 0.01 * by, 1.0]))),
    ],
)
def test_the_influence_is_one_standard_deviation_s(place: int, changed: partial[Chain]) -> None:
    """Of creep with one gain."""
    creep = evolve(CHAIN.model.creep, gains=[0.2], time_constants=[2.0])
    chain = chain_of(known(evolve(CHAIN.model, creep=creep), 0.1))
    record = recorded(1.0)
    given = evidence_of("x", default_model(), record)
    (evidence,) = with_free_directions([given], chain)
    more = answer(changed(chain, 0.1), record.signals("x")[0]) - answer(
        chain, record.signals("x")[0]
    )
    count = evidence.base.shape[1]
    np.testing.assert_allclose(evidence.base[place], more[:count], atol=0.05 * np.abs(more).max())


def residual(seed: int, size: float, parameters: int = 2) -> LinearResidual:
    """A residual and influences in bands of ten amplitudes."""
    rng = np.random.default_rng(seed)
    left, moved = size * rng.normal(size=(BANDS, 10)), rng.normal(size=(BANDS, parameters, 10))
    left += moved[:, 0] * rng.normal() * size
    slope, gram = np.einsum("bmk,bk->bm", moved, left), moved @ moved.transpose(0, 2, 1)
    return LinearResidual(np.sum(left**2, axis=1) / 10.0, slope / 10.0, gram / 10.0)


@pytest.mark.evidence
@given(seed=SEEDS, size=SIZED)
def test_the_profile_is_the_best_nearby(seed: int, size: float) -> None:
    """Of the t likelihood, and of something outside: no other deviation is likelier."""
    linear, one = residual(seed, size), np.ones(BANDS)
    outside = Outside(one, np.geomspace(2.0, 1e4, 64)[:, np.newaxis] * one, KNOWN, FEW)
    cases = (
        (
            partial(weights, variance=one, known=KNOWN, freedom=FEW),
            lambda p: log_density(p, one, KNOWN, FEW).sum(),
        ),
        (outside.weights, outside.log_evidence),
    )
    for weight, log in cases:
        found = linear.profiled(weight)

        def cost(d: Array, log=log) -> float:  # type: ignore[no-untyped-def]  # noqa: ANN001
            return float(0.5 * d @ d - log(linear.at(d)))

        best = minimize(cost, found.deviations, tol=1e-9)
        assert best.fun >= cost(found.deviations) - 1e-4


@given(seed=SEEDS, size=st.floats(0.1, 3.0))
@settings(max_examples=20)
def test_the_volume_is_laplace_s(seed: int, size: float) -> None:
    """Against quadrature over one deviation."""
    linear, one = residual(seed, size, 1), np.ones(BANDS)
    found = linear.profiled(partial(weights, variance=one, known=KNOWN, freedom=FEW))

    def log(deviation: float) -> float:
        at = linear.at(np.array([deviation]))
        return float(log_density(at, one, KNOWN, FEW).sum() - 0.5 * deviation**2)

    (centre,), top = found.deviations, log(float(found.deviations[0]))
    whole = quad(lambda d: np.exp(log(d) - top), centre - 9.0, centre + 9.0, limit=200)[0]
    expected = np.log(whole / np.sqrt(2.0 * np.pi)) - 0.5 * centre**2
    assert found.log_base == pytest.approx(expected, abs=0.5)


@given(seed=SEEDS)
def test_the_ridge_integrates_over_the_parameters(seed: int) -> None:
    """The cost is the least over them, and the volume that of all parameters together."""
    rng = np.random.default_rng(seed)
    left, base, slopes = rng.normal(size=50), rng.normal(size=(3, 50)), rng.normal(size=(50, 2))
    ridge, scaled = BaseRidge(list(base)), base
    rows = np.vstack((scaled.T, np.eye(3)))
    missed = np.append(left, np.zeros(3))
    least = missed - rows @ np.linalg.lstsq(rows, missed, rcond=None)[0]
    assert np.sum(ridge.left(left) ** 2) == pytest.approx(np.sum(least**2))
    seen = np.column_stack([ridge.left(each) for each in slopes.T])
    apart = np.eye(3) + scaled @ scaled.T
    alone = np.linalg.slogdet(np.eye(2) + seen.T @ seen)[1]
    both = np.hstack((slopes, scaled.T))
    whole = np.linalg.slogdet(np.eye(5) + both.T @ both)[1]
    assert alone + np.linalg.slogdet(apart)[1] == pytest.approx(whole)
