"""The joint fit of all records of an axis: derivatives, operators, tones, and what it finds."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize, signal

import afm_scan_ros as afm
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.axis import fit_axis, with_one_state
from afm_scan_ros.core.fit.estimator import AxisFit, bounded
from afm_scan_ros.core.fit.evidence import evidence, first_scales
from afm_scan_ros.core.fit.model_of_fit import from_rest, model_of
from afm_scan_ros.core.fit.modes import best_mode
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.parameters import Layout, layout_of
from afm_scan_ros.core.fit.plays import Plays as PlayBank
from afm_scan_ros.core.fit.sensitivity import jacobian, simulate
from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.fit.signals import Signals, known_from, longest_block, noise_of, signals_of
from afm_scan_ros.core.fit.uncertainty import covariance, predicted
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import Array

PERIOD = 1e-4
LIMIT = 3.6
SETTINGS = FitSettings()


def bent(value: Array) -> Array:
    """A memoryless map, of some 4 % at the limits."""
    return value + 0.01 * value**2 - 0.001 * value**3


def of_plays(drive: Array) -> Array:
    """Forty plays and the drive itself, from their middle."""
    thresholds, play = np.linspace(0.05, 3.4, 40), np.zeros(40)
    output = np.empty_like(drive)
    for k, u in enumerate(drive):
        play = np.clip(play, u - thresholds, u + thresholds)
        output[k] = u + 0.012 * play.sum()
    return output


def of_duhem(drive: Array) -> Array:
    """Coleman and Hodgdon: dF = 0.7 |du| (u - F) + 0.7 du, along each sample exactly."""
    output, f, before = np.empty_like(drive), 0.0, 0.0
    for k, u in enumerate(drive):
        way = np.sign(u - before)
        lag = way * 0.3 / 0.7
        f = u - lag + (f - before + lag) * np.exp(-0.7 * abs(u - before))
        output[k], before = f, u
    return output


def of_bouc_wen(drive: Array) -> Array:
    """Low and Guo: F = u - h, dh = 0.35 du - 0.45 |du| h - 0.1 du |h|, in steps of 2 mV or less."""
    output, h, before = np.empty_like(drive), 0.0, 0.0
    for k, u in enumerate(drive):
        steps = int(abs(u - before) / 2e-3) + 1
        du = (u - before) / steps
        for _ in range(steps):
            middle = h + 0.5 * (0.35 * du - 0.45 * abs(du) * h - 0.1 * du * abs(h))
            h += 0.35 * du - 0.45 * abs(du) * middle - 0.1 * du * abs(middle)
        output[k], before = u - h, u
    return output


Operator: TypeAlias = Callable[[Array], Array]
OPERATORS: dict[str, Operator] = {
    "plays": of_plays,
    "duhem": of_duhem,
    "bouc_wen": of_bouc_wen,
}


def applied(operator: Operator, drive: Array) -> Array:
    """Output of an operator between two maps."""
    return bent(operator(bent(drive)))


GAIN, FREQUENCY, DAMPING = 1e-6, 230.0, 0.03
CREEP = 0.03, 0.4
"""Gain and time constant, s."""


def levels(seed: int, count: int, samples: int) -> Array:
    """Random levels joined by ever faster ramps, from 0 and back."""
    rng = np.random.default_rng(seed)
    reached = np.concatenate([[0.0], rng.uniform(-LIMIT, LIMIT, count), [0.0]])
    lengths = np.geomspace(samples, samples / 20.0, count + 1).round()
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    return np.asarray(np.interp(np.arange(ends[-1] + 1), ends, reached))


def displaced(operator: Operator, drive: Array, period: float = PERIOD) -> Array:
    """Displacement (m) of a scanner whose filters are SciPy's, without noise."""
    omega = 2.0 * np.pi * FREQUENCY
    system = [omega**2], [1.0, 2.0 * DAMPING * omega, omega**2]
    above, below, _ = signal.cont2discrete(system, period)
    early = signal.lfilter(above.ravel(), below, applied(operator, drive))
    kept = np.exp(-period / CREEP[1])
    late = signal.lfilter([0.0, 1.0 - kept], [1.0, -kept], early)
    return np.asarray(GAIN * (early + CREEP[0] * late))


def record(operator: Operator, drive: Array, tone: float = 0.0) -> afm.Record:
    rng = np.random.default_rng(7)
    seconds = PERIOD * np.arange(len(drive))
    hum = tone * np.sin(2.0 * np.pi * 50.02 * seconds + 1.0)
    moved = displaced(operator, drive) + hum + rng.normal(0.0, 0.2e-9, len(drive))
    return afm.Record(drive, moved, PERIOD, start="depolarised", name="levels")


def signals(drive: Array, moved: Array, block: int) -> Signals:
    found = signals_of("a", drive, moved, PERIOD, depolarised=True, settings=SETTINGS)
    return evolve(found, block=block)


@pytest.fixture(scope="module")
def drive() -> Array:
    return levels(1, 14, 600)


@pytest.mark.parametrize(("kind", "block"), [("plays", 1), ("plays", 4), ("one state", 1)])
def test_the_jacobian_is_the_derivative(drive: Array, kind: str, block: int) -> None:
    rng = np.random.default_rng(3)
    one = signals(drive, 1e-6 * drive, block)
    operator = PlayBank(-LIMIT, LIMIT) if kind == "plays" else OneState(-LIMIT, LIMIT, (-1.5, 1.5))
    layout = layout_of(operator, 1.0, PERIOD, SETTINGS, 2.0 * np.pi * FREQUENCY)
    layout, theta = layout.with_mode(layout.start(), (2.0 * np.pi * FREQUENCY, DAMPING, 0.8, 0.1))
    for name, size in {"density": 0.3, "correction": 0.05, "slopes": 0.1, "map": 0.05}.items():
        if name in layout.parts:
            theta[layout.parts[name]] += size * rng.standard_normal(theta[layout.parts[name]].size)
    theta[layout.parts["creep"]] = 0.02 * rng.random(theta[layout.parts["creep"]].size)
    pieces = operator.pieces(layout.of_operator(theta), drive, block, rested=True)
    of_pieces = jacobian(layout, theta, one, simulate(layout, theta, one), pieces)
    found = np.concatenate([piece for _, piece in of_pieces])
    for place in rng.choice(layout.size, 60, replace=False):
        step = 1e-5 * np.eye(layout.size)[place]
        up, down = (simulate(layout, theta + way * step, one) for way in (1.0, -1.0))
        slope = (up.response.output - down.response.output)[one.used] / 2e-5
        motion = float(np.linalg.norm(slope)) + 1e-6
        # Blocks hold the input, and a Duhem operator's steps are those of its integration.
        close = 0.002 if (kind, block) == ("plays", 1) else 0.03
        assert np.linalg.norm(slope - found[:, place]) < close * motion + 1e-5, place


def test_the_plays_are_the_surface_of_the_model(drive: Array) -> None:
    rng = np.random.default_rng(5)
    bank = PlayBank(-LIMIT, LIMIT)
    plays, terms = bank.parts["density"], bank.parts["correction"]
    density = np.concatenate([[0.8], 0.3 * rng.random(plays - 1)])
    theta = np.concatenate([density, 0.02 * rng.standard_normal(terms)])
    surface = bank.surface(theta)
    model = Preisach(surface)
    of_model = model.apply(model.at_rest(), drive)[1]
    of_plays = bank.output(theta, drive, rested=True)
    apart = of_model - (of_plays - bank.output(theta, np.zeros(1), rested=True))
    assert np.abs(apart).max() < 3e-4 * np.ptp(of_plays)


@pytest.mark.parametrize(("low", "high"), [(0.0, 5.0), (-1.0, 4.0), (-3.0, 3.0)])
def test_a_model_rests_at_zero_and_moves_as_the_plays_do(low: float, high: float) -> None:
    """Also where plays move once from rest and never again: what they moved by is an offset."""
    bank = PlayBank(low, high)
    theta = bank.unbent()
    theta[: bank.parts["density"]] = np.linspace(0.9, 0.3, bank.parts["density"])
    surface, _ = from_rest(bank.surface(theta), None)
    model = Preisach(surface)
    assert model.at_rest().now[1] == pytest.approx(0.0, abs=1e-12)
    path = np.interp(np.arange(700), np.arange(0, 701, 100), [0, high, low, high, 1, 3, 0.5, 2])
    apart = model.apply(model.at_rest(), path)[1] - bank.output(theta, path, rested=True)
    assert np.ptp(apart[200:]) < 1e-3 * (high - low)


def test_the_model_answers_as_the_fit_does(drive: Array) -> None:
    """Two modes, lags and creep in parallel are the model's vibration with its creep behind."""
    layout = layout_of(PlayBank(-LIMIT, LIMIT), 1.0, PERIOD, SETTINGS, 2.0 * np.pi * FREQUENCY)
    theta = layout.start()
    for mode in ((2.0 * np.pi * FREQUENCY, DAMPING, 0.8, -0.1), (3000.0, 0.2, 0.15, 0.05)):
        layout, theta = layout.with_mode(theta, mode)
    theta[layout.parts["lags"]] += 0.03 * np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 0.0])
    theta[layout.parts["creep"]] = 0.02
    one = signals(drive, GAIN * drive, 1)
    fit = AxisFit(layout, [one], GAIN, theta)
    (simulation,) = fit.simulated(fit.theta)
    cascade = forward(model_of(fit), PERIOD)
    of_model = cascade.apply(cascade.at_rest(), drive)[1]
    apart = of_model - GAIN * simulation.response.output
    assert np.abs(apart).max() < 1e-6 * np.ptp(of_model)


def test_a_prediction_is_as_uncertain_as_its_parameters() -> None:
    """Against the spread of the responses of parameters that are drawn from the posterior."""
    drive = levels(4, 6, 300)
    noise = np.random.default_rng(5).normal(0.0, 1e-8, len(drive))
    fit = AxisFit(*_of_plays_alone(drive, GAIN * drive + noise))
    fit.settle(SETTINGS.most_steps, ("density",))
    fresh = 0.7 * levels(6, 3, 200)
    stated = predicted(fit, fresh, PERIOD).standard_deviation
    one, known = signals(fresh, fresh, 1), covariance(fit)
    rng, drawn = np.random.default_rng(6), []
    for theta in rng.multivariate_normal(fit.theta, known, 200):
        response = simulate(fit.layout, theta, one).response.output
        drawn.append(fit.gain * (response - response[0]))
    stated = np.sqrt(stated**2 - (fit.discrepancy * np.std(np.mean(drawn, axis=0))) ** 2)
    np.testing.assert_allclose(np.std(drawn, axis=0)[100:], stated[100:], rtol=0.3)


def _of_plays_alone(drive: Array, moved: Array) -> tuple[Layout, list[Signals], float, Array]:
    layout = layout_of(PlayBank(-LIMIT, LIMIT), 1.0, PERIOD, SETTINGS)
    return layout, [signals(drive, moved, 1)], GAIN, layout.start()


def test_a_prediction_begins_at_rest_and_stays_within_the_records_drive() -> None:
    drive = levels(4, 6, 300)
    fit = AxisFit(*_of_plays_alone(drive, GAIN * drive))
    with pytest.raises(InputError, match="begins at 1 V"):
        predicted(fit, drive + 1.0, PERIOD)
    with pytest.raises(InputError, match=r"but the records only -3\.6 to 3\.6 V"):
        predicted(fit, 4.0 * drive, PERIOD)


@given(seed=st.integers(0, 10_000), size=st.integers(2, 40))
def test_a_bounded_move_is_that_of_bounded_least_squares(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    columns, data = rng.standard_normal((size + 5, size)), rng.standard_normal(size + 5)
    lowest = np.where(rng.random(size) < 0.7, -0.1 * rng.random(size), -np.inf)
    free = rng.random(size) < 0.9
    move = bounded(columns.T @ columns, columns.T @ data, free, lowest)
    ends = np.where(free, lowest, -1e-12), np.where(free, np.inf, 1e-12)
    expected = optimize.lsq_linear(columns, data, ends, method="bvls", tol=1e-14).x
    np.testing.assert_allclose(move, expected, atol=1e-6)


def test_a_fit_that_overflows_says_so() -> None:
    drive = levels(4, 6, 300)
    fit = AxisFit(*_of_plays_alone(drive, GAIN * drive))
    fit.gain = 1e200
    with pytest.raises(ScanError, match="diverged"):
        fit.normal(with_operator=True)


def test_waves_about_a_resonance_say_what_the_gain_is() -> None:
    """A straight line through them has another, as the phase turns."""
    rng = np.random.default_rng(8)
    lines = np.arange(400, 900)
    spectrum = np.zeros(10_001, complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    wave = np.tile(np.fft.irfft(spectrum, 20_000), 2)
    drive = np.concatenate([[0.0], wave / np.abs(wave).max(), [0.0]])
    moved = displaced(lambda volts: volts, drive)
    layout, given, _, theta = _of_plays_alone(drive, moved)
    line = float(drive @ moved / (drive @ drive))
    fit = AxisFit(layout, given, line, theta)
    fit.weigh()
    found = best_mode(fit)
    assert abs(line / GAIN - 1.0) > 0.5
    assert line * found.gain == pytest.approx(GAIN * (1.0 + CREEP[0]), rel=0.1)
    assert found.mode[0] / (2.0 * np.pi) == pytest.approx(FREQUENCY, rel=0.01)


def test_the_evidence_is_the_marginal_likelihood_of_a_linear_model() -> None:
    """Between two scales of the prior it differs as the normal densities of the data do."""
    rng = np.random.default_rng(2)
    layout = layout_of(PlayBank(-LIMIT, LIMIT), 1.0, PERIOD, SETTINGS)
    theta, count = layout.start(), 30
    columns = rng.standard_normal((count, layout.size))
    data = columns @ theta + rng.standard_normal(count)
    values, exact = [], []
    for size in (0.01, 0.1):
        scales = {**first_scales(SETTINGS), "correction": size}
        right = columns.T @ (data - columns @ theta)
        values.append(evidence(layout, scales, theta, columns.T @ columns, right))
        precision, mean = layout.prior(scales, theta)
        precision += 1e-9 * np.eye(len(precision))
        covariance = np.eye(count) + columns @ np.linalg.solve(precision, columns.T)
        missed = data - columns @ mean
        volume = np.linalg.slogdet(covariance)[1]
        exact.append(-0.5 * (missed @ np.linalg.solve(covariance, missed) + volume))
    assert values[1] - values[0] == pytest.approx(exact[1] - exact[0], rel=1e-3)


@pytest.mark.parametrize("family", ["duhem", "bouc_wen"])
def test_one_state_follows_scanners_without_wiping_out(family: str) -> None:
    """Equation error alone is close; the fit then goes on from it."""
    path = levels(2, 60, 300)
    output = applied(OPERATORS[family], path)
    low, high = (output - path).min(), (output - path).max()
    operator = OneState(-LIMIT, LIMIT, (low - 0.05, high + 0.05))
    starts = operator.started([(path, output)])
    missed = [np.std(operator.output(one, path, rested=True) - output) for one in starts]
    assert min(missed) < 2e-3 * np.ptp(output)


def test_slopes_stay_the_same_on_cells_that_reach_further() -> None:
    path = levels(2, 60, 300)
    output = applied(OPERATORS["duhem"], path)
    operator = OneState(-LIMIT, LIMIT, (-0.3, 0.3))
    theta = operator.started([(path, output)])[5]
    before = operator.output(theta, path, rested=True)
    wider, moved = operator.covering(theta, np.array([-0.36, 0.4]))
    apart = wider.output(moved, path, rested=True) - before
    assert np.std(apart) < 2e-3 * np.ptp(before)
    assert wider.widths[0] < -0.36
    assert wider.widths[1] > 0.4
    assert wider.covering(moved, np.array([-0.36, 0.4]))[0] is wider


OVERCONFIDENT = {"plays": 3.0, "duhem": 3.0, "bouc_wen": 8.0}
"""Largest error over its stated standard deviation: the page says that it is too small."""


@pytest.mark.evidence
@pytest.mark.parametrize("family", OPERATORS)
def test_a_few_seconds_of_levels_identify_a_scanner(family: str) -> None:
    """These levels do, to 0.1 % of a fresh drive's range; the docs have others."""
    operator = OPERATORS[family]
    fit = fit_axis([record(operator, levels(11, 60, 1500), tone=5e-9)], "x")
    model = model_of(fit)
    fresh = 0.9 * levels(23, 12, 1500)
    true = displaced(operator, fresh)
    cascade = forward(model, PERIOD)
    found = cascade.apply(cascade.at_rest(), fresh)[1]
    assert np.std(found - true) < 1e-3 * np.ptp(true)
    slope = np.polyfit(true, found, 1)[0]
    assert abs(slope - 1.0) < 2e-3
    assert isinstance(fit.layout.operator, PlayBank if family == "plays" else OneState)
    assert fit.records[0].tones == pytest.approx([50.02], abs=0.02)
    omega, damping, *_ = fit.layout.of_modes(fit.theta)[0]
    assert omega / (2.0 * np.pi) == pytest.approx(FREQUENCY, rel=1e-3)
    assert damping == pytest.approx(DAMPING, rel=0.05)
    assert fit.records[0].noise == pytest.approx(0.2e-9, rel=0.1)
    stated = predicted(fit, fresh, PERIOD)
    assert np.std(stated.displacement - found) < 5e-4 * np.ptp(true)  # levels of the surface
    ratio = np.std(stated.displacement - true) / np.sqrt(np.mean(stated.standard_deviation**2))
    assert 0.2 < ratio < OVERCONFIDENT[family]


def test_noise_is_that_of_third_differences_whatever_moves_slowly() -> None:
    rng = np.random.default_rng(1)
    slow = np.sin(np.linspace(0.0, 20.0, 50_000))
    assert noise_of(slow + 1e-3 * rng.standard_normal(len(slow))) == pytest.approx(1e-3, rel=0.03)


def test_blocks_are_as_long_as_nothing_turns_within_them() -> None:
    rng = np.random.default_rng(1)
    slow = np.sin(np.linspace(0.0, 60.0, 100_000))
    moved = slow + 1e-3 * rng.standard_normal(len(slow))
    long = longest_block(slow, moved, 1e-3, SETTINGS)
    short = longest_block(np.sin(np.linspace(0.0, 600.0, 100_000)), moved, 1e-3, SETTINGS)
    assert long >= 32 > short


def test_memory_is_known_from_rest_or_from_both_ends() -> None:
    path = np.array([0.0, 1.0, -2.0, 2.0, -1.0, 2.0])
    assert known_from(path, depolarised=True) == 0
    assert known_from(path, depolarised=False) == 3


def test_a_record_whose_memory_is_never_known_is_refused_by_name() -> None:
    rise = np.linspace(0.0, 1.0, 1000)
    record = afm.Record(rise, GAIN * rise, PERIOD, name="rise")
    with pytest.raises(InputError, match="rise: its drive reaches the second of its ends only"):
        fit_axis([record], "x")


def test_no_record_that_moves_is_refused() -> None:
    still = afm.Record(np.zeros(1000), np.zeros(1000), PERIOD)
    with pytest.raises(InputError, match="no record moves x: give one whose drive changes"):
        fit_axis([still], "x")


def test_the_fit_does_not_depend_on_the_order_of_records() -> None:
    halves = [record(OPERATORS["plays"], levels(seed, 20, 1000)) for seed in (3, 4)]
    one, two = (fit_axis(list(order), "x") for order in (halves, halves[::-1]))
    assert isinstance(one, AxisFit)
    fresh = 0.8 * levels(23, 12, 1500)
    paths = []
    for fit in (one, two):
        cascade = forward(model_of(fit), PERIOD)
        paths.append(cascade.apply(cascade.at_rest(), fresh)[1])
    assert np.std(paths[0] - paths[1]) < 2e-4 * np.ptp(paths[0])
    assert with_one_state(one).layout.operator.bends == 0
