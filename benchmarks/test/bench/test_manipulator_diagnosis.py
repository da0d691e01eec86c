"""Real records of a micromanipulator: a lag found beside hysteresis; density identified again."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.measured.manipulator_diagnosis import spans
from afm_scan_bench.measured.micromanipulator.diagnosis_density import Density, FitRecord
from afm_scan_bench.measured.micromanipulator.diagnosis_study import ManipulatorDiagnosis
from afm_scan_bench.measured.micromanipulator.film_shares import shares_behind_film
from afm_scan_bench.measured.micromanipulator.recent import Recent
from afm_scan_bench.measured.recordings import VARIABLE
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.fit import Problem
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.effects.viscous_plays import ViscousPlays
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.joint.cells import CellGrid, cell_count, surface_of
from afm_scan_ros.core.model import AxisModel, CreepModel, HysteresisModel, VibrationModel

LAG = effect_type("input_lag").form("")
VISCOUS = effect_type("rate_dependent_hysteresis").form("")


@pytest.fixture(scope="module")
def study() -> ManipulatorDiagnosis:
    try:
        return ManipulatorDiagnosis(cells=16)
    except InputError as error:
        pytest.skip(f"{VARIABLE}: {error}")


def _fitted(study: ManipulatorDiagnosis, form: EffectForm, start: float) -> tuple[float, Chain]:
    problem = Problem(study.evidence, study.declared, [form])
    found = problem.descend(np.full((len(study.evidence), 1), start))
    assert found is not None
    return float(found.values[0]), form.insert(study.declared, found.values)


def test_a_lag_halves_the_held_out_error(study: ManipulatorDiagnosis) -> None:
    lag, chain = _fitted(study, LAG, 0.02)
    assert 5e-3 < lag < 20e-3  # s, some samples
    before = spans(study.left(study.declared), study)
    after = spans(study.left(study.learnt(chain)), study)
    for part in ("before_inverse_um", "with_inverse_um"):
        assert after[part] < 0.6 * before[part], part


def test_the_first_step_tells_a_lag_from_viscous_hysteresis(study: ManipulatorDiagnosis) -> None:
    starts = [
        spans(study.left(study.learnt(_fitted(study, form, start)[1])), study)["start_um"]
        for form, start in ((LAG, 0.02), (VISCOUS, 0.03))
    ]
    assert starts[0] < 0.5 * starts[1]


def test_the_floor_is_the_noise_and_little_more(study: ManipulatorDiagnosis) -> None:
    for record in study.records:
        limit = study.limit(record)
        assert np.linalg.norm(limit.noise) == pytest.approx(0.07e-6, rel=0.1)  # as at rest
        assert limit.total < 1.5 * np.linalg.norm(limit.noise)


def test_what_a_density_made_it_is_learnt_from() -> None:
    span, period = CellGrid(0.0, 2.0, cells=6), 0.005
    time = period * np.arange(2000)
    drive = 1.0 - (0.3 + 0.07 * time) * np.cos(2.0 * np.pi * time)
    density = np.tril(np.ones((6, 6)))
    values = np.zeros((7, 7))
    values[1:, :-1] = np.cumsum(np.cumsum(density, axis=0)[:, ::-1], axis=1)[:, ::-1]
    chain = LAG.insert(_chain(np.tril(values)), np.array([0.02]))
    forward = chain.forward(period)
    moved = forward.apply(forward.at_rest(), drive)[1]
    fitted = FitRecord(drive, moved, time > 1.0, period)
    other = LAG.insert(_chain(np.tril(0.5 * np.subtract.outer(range(7), range(7)))), [0.02])
    anew = Density([fitted], span).anew(other).forward(period)
    error = anew.apply(anew.at_rest(), drive)[1] - moved
    assert error[time > 1.0].std() < 0.02 * moved[time > 1.0].std()


@settings(deadline=None, max_examples=10)
@given(
    lag=st.floats(1e-4, 0.1),
    activation=st.one_of(st.just(np.inf), st.floats(1e-3, 1.0)),
    seed=st.integers(0, 1000),
)
def test_behind_a_film_each_cell_gives_its_share(lag: float, activation: float, seed: int) -> None:
    span, rng = CellGrid(0.0, 2.0, cells=6), np.random.default_rng(seed)
    weights = rng.uniform(0.1, 1.0, cell_count(span.cells))
    surface = surface_of(weights, span, offset=0.0)
    film = ViscousPlays(surface, lag, 0.005, activation)
    drive = np.repeat(rng.uniform(0.0, 2.0, 40), 5)
    forced = film.apply(film.at_rest(), drive)[1]
    assert shares_behind_film(film, drive, span) @ weights == pytest.approx(forced, abs=1e-9)


@pytest.mark.parametrize("kind", ["", "film"])
def test_a_density_does_not_depend_on_what_was_asked_before(kind: str) -> None:
    form, span = effect_type("rate_dependent_hysteresis").form(kind), CellGrid(0.0, 2.0, cells=6)
    drive = 1.0 - (0.3 + 0.0003 * np.arange(2000)) * np.cos(0.03 * np.arange(2000))
    straight = _chain(np.tril(0.5 * np.subtract.outer(range(7), range(7))))
    moved = 1e-5 * (drive**2 + np.roll(drive, 9))
    fitted = [FitRecord(drive, moved, np.arange(2000) > 100, 0.005)]
    slow = evolve(straight.model, creep=CreepModel((0.1,), (2.0,)))
    asked = [
        form.insert(chain, np.array([lag]))
        for chain in (straight, evolve(straight, model=slow))
        for lag in (0.02, 0.03, 0.02)
    ]
    density = Density(fitted, span)
    for chain in asked:
        found, alone = (each.anew(chain).model for each in (density, Density(fitted, span)))
        assert np.array_equal(found.hysteresis.forward.values, alone.hysteresis.forward.values)
        assert found.vibration == alone.vibration


def test_what_was_asked_for_of_late_is_not_found_again() -> None:
    found: list[str] = []

    def find(key: str) -> np.ndarray:
        found.append(key)
        return np.zeros(2)

    recent = Recent(room=2 * np.zeros(2).nbytes)
    for key in "abacab":
        recent.of(key, lambda key=key: find(key))
    assert "".join(found) == "abcb"


def _chain(values: np.ndarray) -> Chain:
    surface = EverettSurface(0.0, 2.0, values, 0.0)
    model = HysteresisModel(surface, surface)
    return Chain(AxisModel(model, VibrationModel((1e-5,), (2e-4, 1.0)), CreepModel((), ())))
