"""Real records of a micromanipulator: a lag traced beside hysteresis; density identified anew."""

import numpy as np
import pytest

from afm_scan_ros.bench.manipulator_tracing import spans
from afm_scan_ros.bench.micromanipulator.tracing_density import Density, Taught
from afm_scan_ros.bench.micromanipulator.tracing_study import Tracing
from afm_scan_ros.core.catalogue import entry
from afm_scan_ros.core.catalogue.entry import Form
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.hysteresis.loops_fit import LoopRange
from afm_scan_ros.core.model import AxisModel, CreepModel, HysteresisModel, VibrationModel
from afm_scan_ros.core.tracing.fit import Problem
from afm_scan_ros.files.measured import VARIABLE

LAG = entry("input_lag").form("")
VISCOUS = entry("rate_dependent_hysteresis").form("")


@pytest.fixture(scope="module")
def tracing() -> Tracing:
    try:
        return Tracing(cells=16)
    except InputError as error:
        pytest.skip(f"{VARIABLE}: {error}")


def _fitted(tracing: Tracing, form: Form, start: float) -> tuple[float, Chain]:
    problem = Problem(tracing.evidence, tracing.declared, [form])
    found = problem.descend(np.full((len(tracing.evidence), 1), start))
    assert found is not None
    return float(found.values[0]), form.insert(tracing.declared, found.values)


def test_a_lag_halves_the_error_on_what_taught_nothing(tracing: Tracing) -> None:
    lag, chain = _fitted(tracing, LAG, 0.02)
    assert 5e-3 < lag < 20e-3  # s, some samples
    before = spans(tracing.left(tracing.declared), tracing)
    after = spans(tracing.left(tracing.learnt(chain)), tracing)
    for part in ("before_inverse_um", "with_inverse_um"):
        assert after[part] < 0.6 * before[part], part


def test_the_first_step_tells_a_lag_from_viscous_hysteresis(tracing: Tracing) -> None:
    starts = [
        spans(tracing.left(tracing.learnt(_fitted(tracing, form, start)[1])), tracing)["start_um"]
        for form, start in ((LAG, 0.02), (VISCOUS, 0.03))
    ]
    assert starts[0] < 0.5 * starts[1]


def test_the_floor_is_the_noise_and_little_more(tracing: Tracing) -> None:
    for record in tracing.records:
        floor = tracing.floor(record)
        assert np.linalg.norm(floor.noise) == pytest.approx(0.07e-6, rel=0.1)  # as at rest
        assert floor.total < 1.5 * np.linalg.norm(floor.noise)


def test_what_a_density_made_it_is_learnt_from() -> None:
    span, period = LoopRange(0.0, 2.0, cells=6), 0.005
    time = period * np.arange(2000)
    drive = 1.0 - (0.3 + 0.07 * time) * np.cos(2.0 * np.pi * time)
    density = np.tril(np.ones((6, 6)))
    values = np.zeros((7, 7))
    values[1:, :-1] = np.cumsum(np.cumsum(density, axis=0)[:, ::-1], axis=1)[:, ::-1]
    chain = LAG.insert(_chain(np.tril(values)), np.array([0.02]))
    forward = chain.forward(period)
    moved = forward.apply(forward.at_rest(), drive)[1]
    taught = Taught(drive, moved, time > 1.0, period)
    other = LAG.insert(_chain(np.tril(0.5 * np.subtract.outer(range(7), range(7)))), [0.02])
    anew = Density([taught], span).anew(other).forward(period)
    error = anew.apply(anew.at_rest(), drive)[1] - moved
    assert error[time > 1.0].std() < 0.02 * moved[time > 1.0].std()


def _chain(values: np.ndarray) -> Chain:
    surface = EverettSurface(0.0, 2.0, values, 0.0)
    model = HysteresisModel(surface, surface)
    return Chain(AxisModel(model, VibrationModel((1e-5,), (2e-4, 1.0)), CreepModel((), ())))
