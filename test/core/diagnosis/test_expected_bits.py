"""What an experiment is expected to tell, and which one is proposed."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, FOUND
from afm_scan_ros.core.diagnosis.cells import RecordCells
from afm_scan_ros.core.diagnosis.diagnosis import diagnose
from afm_scan_ros.core.diagnosis.experiments import (
    Hypothesis,
    Proposal,
    SizedExperiment,
    assess,
    distance,
    information,
    propose,
)
from afm_scan_ros.core.diagnosis.settings import VARIANCE
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.electronics import DelayedConverter
from helpers.in_process import InProcessSession, default_model, default_plant

CHAIN = chain_of(default_model().x)
DELAY, LAG = (
    effect_type(name).form("").insert(CHAIN, np.array([1e-4])) for name in ("delay", "input_lag")
)
SAMPLES, PERIOD, EDGES = 64, 1e-3, (0.0, 50.0, 150.0, 500.0)
BANDS = len(EDGES) - 1
seeds = st.integers(0, 2**32 - 1)


def credible(*chains: object) -> list[Hypothesis]:
    return [Hypothesis(chain, -np.log(len(chains))) for chain in chains]  # type: ignore[arg-type]


def library(name: str, *chains: object) -> Proposal:
    experiment = SizedExperiment.of_library(name, default_model())
    (found,) = assess("x", experiment, default_model(), credible(*chains))
    return found


def predicted(seed: int, *counts: int) -> Array:
    """Predictions, then ``counts`` deviations of each, at random."""
    return np.random.default_rng(seed).standard_normal((len(counts) + sum(counts), SAMPLES))


def products_of(signals: Array) -> Array:
    cells = RecordCells(EDGES, signals.shape[1], PERIOD)
    found = cells.along(signals)
    return cells.products(found, found)


def told(signals: Array, *counts: int, known: float = VARIANCE.known) -> tuple[float, float]:
    products = products_of(signals)
    variances, equal = np.ones((len(counts), BANDS)), np.zeros(len(counts))
    each = np.full(BANDS, known), np.full(BANDS, VARIANCE.freedom)
    return information(products, counts, variances, *each, equal)


@given(seed=seeds, counts=st.lists(st.integers(0, 3), min_size=1, max_size=4))
def test_bits_lie_between_none_and_all_that_are_open(seed: int, counts: list[int]) -> None:
    bits, probability = told(predicted(seed, *counts), *counts)
    assert 0.0 <= bits <= np.log2(len(counts)) + 1e-9
    assert 0.0 <= probability <= 1.0 + 1e-9


@given(seed=seeds, sizes=st.tuples(st.floats(0.01, 10.0), st.floats(1.0, 10.0)))
def test_bits_never_fall_with_the_amplitude(seed: int, sizes: tuple[float, float]) -> None:
    """Of predictions that grow in proportion to it, over a noise that does not."""
    small, more = sizes
    signals = small * predicted(seed, 0, 0, 0)
    assert told(more * signals, 0, 0, 0)[0] >= told(signals, 0, 0, 0)[0] - 1e-9
    normal, signals = 1e9, small * predicted(seed, 2, 1)
    larger, smaller = (told(each, 2, 1, known=normal)[0] for each in (more * signals, signals))
    assert larger >= smaller - 1e-6


@given(seed=seeds, sure=st.floats(0.0, 1.0))
def test_what_a_parameter_absorbs_is_no_information(seed: int, sure: float) -> None:
    """The distance falls as the parameter is known less; in the end nothing is left of it."""
    moved = np.random.default_rng(seed).standard_normal(SAMPLES)
    each = np.outer((1.0, VARIANCE.known, VARIANCE.freedom), np.ones(BANDS))

    def apart(deviation: float) -> float:
        signals = np.array([moved, deviation * moved, deviation * moved])
        return distance(products_of(signals), 2, *each)

    assert apart(1.0) <= apart(sure) + 1e-9 <= apart(0.0) + 2e-9
    assert apart(1e3) == pytest.approx(0.0, abs=1e-5)


def test_distance_is_that_of_normal_distributions() -> None:
    """Against the formula with whole covariances, in one band with one amplitude a sample."""
    rng = np.random.default_rng(3)
    difference, one, other = rng.standard_normal((3, 5))
    freedom, variance = 1.4, 0.7
    noise = variance / freedom * np.eye(5)
    first, second = noise + np.outer(one, one), noise + np.outer(other, other)
    middle = 0.5 * (first + second)
    logs = [np.linalg.slogdet(each)[1] for each in (middle, first, second)]
    exact = difference @ np.linalg.solve(middle, difference) / 8.0
    exact += 0.5 * (logs[0] - 0.5 * (logs[1] + logs[2]))
    signals = np.array([difference, one, other])
    products = (signals @ signals.T)[np.newaxis]
    found = distance(products, 2, *(np.array([each]) for each in (variance, 1e9, freedom)))
    assert found == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize("name", ["rest", "broadband"])
def test_one_model_or_the_same_twice_leaves_nothing_to_learn(name: str) -> None:
    for chains in ((DELAY,), (DELAY, DELAY)):
        assert library(name, *chains).bits == pytest.approx(0.0, abs=1e-9)


def test_a_scanner_at_rest_tells_least_of_a_delay() -> None:
    assert library("rest", DELAY, LAG).bits < 0.1
    assert propose("x", default_model(), credible(DELAY, LAG), ["rest", "dither"]).settles  # type: ignore[union-attr]


@settings(max_examples=5, deadline=None)
@given(share=st.floats(0.01, 0.99))
def test_what_is_all_but_certain_leaves_little_to_learn(share: float) -> None:
    logs = np.log([share, 1.0 - share])
    pair = [Hypothesis(c, float(log)) for c, log in zip((DELAY, LAG), logs, strict=True)]
    entropy = -float(np.sum(np.exp(logs) * logs)) / np.log(2.0)
    experiment = SizedExperiment.of_library("broadband", default_model())
    (found,) = assess("x", experiment, default_model(), pair)
    assert found.bits <= entropy + 1e-9


@pytest.mark.parametrize(
    "late", [1e-5, *(pytest.param(late, marks=pytest.mark.evidence) for late in (2e-6, 1e-4))]
)
@pytest.mark.parametrize("name", [pytest.param("broadband", marks=pytest.mark.evidence), "hold"])
def test_a_free_choice_is_never_worse_than_the_library(name: str, late: float) -> None:
    names = ("delay", "input_lag")
    chains = [effect_type(n).form("").insert(CHAIN, np.array([late])) for n in names]
    own = library(name, *chains)
    found = propose("x", default_model(), credible(*chains), [name])
    assert found is not None
    assert found.settles >= own.settles
    if own.settles:
        assert found.experiment.duration <= own.experiment.duration
    else:
        assert found.settles or found.bits >= 0.95 * own.bits


def test_choices_stay_within_the_limits() -> None:
    model = default_model()
    for name in EXPERIMENTS:
        own = SizedExperiment.of_library(name, model)
        for each in own.varied(model):
            assert each.amplitude <= model.x.hysteresis.forward.upper
            assert each != own
    found = propose("x", model, credible(DELAY, LAG), EXPERIMENTS, longest=3.0)
    assert found is not None
    assert found.experiment.duration <= 3.0
    assert propose("x", model, credible(DELAY, LAG), EXPERIMENTS, longest=0.1) is None


def _gained(factor: float) -> InProcessSession:
    plant = default_plant()
    numerator = tuple(factor * each for each in plant.x.vibration.numerator)
    vibration = evolve(plant.x.vibration, numerator=numerator)
    return InProcessSession(evolve(plant, x=evolve(plant.x, vibration=vibration)))


def _late(delay: float) -> InProcessSession:
    late = (DelayedConverter(axis="x", delay=delay),)
    return InProcessSession(evolve(default_plant(), mechanisms=late))


def _scanned(session: InProcessSession) -> Record:
    scan = session.scan("scan", ScanSpec(lines=6), default_model())
    return Record.of_traces("scan", scan.drive, scan.measured, scan.spec)


@pytest.mark.evidence
def test_a_gain_is_no_stiffness_whose_hysteresis_has_no_width() -> None:
    found = diagnose(default_model(), [_scanned(_gained(1.03))])
    assert found.verdict == FOUND
    assert [effect.name for effect in found.effects] == ["parameter_shift"]


@pytest.mark.evidence
def test_an_ambiguous_effect_is_named_once_the_proposed_experiment_is_recorded() -> None:
    """A delay is like a lag."""
    session = _late(5e-5)
    first = _scanned(session)
    doubt = diagnose(default_model(), [first])
    assert doubt.verdict == AMBIGUOUS
    assert doubt.proposal is not None
    further = session.experiment(doubt.proposal.experiment.plan_for(default_model()))
    found = diagnose(default_model(), [first, further])
    assert found.verdict == FOUND
    assert [effect.name for effect in found.effects] == ["delay"]
