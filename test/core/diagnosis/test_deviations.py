"""Deviations of fitted values in a further record are those of their posterior."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.candidates import Candidate, FittedCandidates
from afm_scan_ros.core.diagnosis.fit import Fit
from afm_scan_ros.core.diagnosis.likelihood import CellFit
from afm_scan_ros.core.diagnosis.parameter_layout import ParameterLayout
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.scanner import chain_of
from helpers.in_process import default_model

PARAMETERS = (
    EffectParameter("size", "m", 0.0, 1.0),
    EffectParameter("time", "s", 0.1, 1.0),
    EffectParameter("phase", "rad", -1.0, 1.0, own=True),
)
FORM = EffectForm("", ("output",), PARAMETERS, lambda chain, _: chain, example=(0.5, 0.5, 0.5))
RECORDS = 2


@given(seed=st.integers(0, 2**32 - 1))
def test_they_make_the_covariance(seed: int) -> None:
    """That of shared values is the posterior's; a value of one record alone has its prior."""
    rng = np.random.default_rng(seed)
    layout = ParameterLayout([FORM], RECORDS)
    widths, slope = rng.uniform(0.1, 1.0, layout.count), rng.normal(size=(9, layout.count))
    inner = np.eye(layout.count) + slope.T @ slope
    found = layout.of_further_record(widths, inner)
    exact = np.diag(widths) @ np.linalg.inv(inner) @ np.diag(widths)
    expected = np.diag([0.0, 0.0, widths[2] ** 2])
    expected[:2, :2] = exact[:2, :2]
    assert found.T @ found == pytest.approx(expected, abs=1e-9)


def test_what_rounding_hides_of_the_prior_is_there_all_the_same() -> None:
    """Beside a precision of 10^17 the prior's one is lost, or even negative."""
    layout = ParameterLayout([FORM], RECORDS)
    slope = 3e8 * np.ones((1, layout.count))
    inner = np.eye(layout.count) + slope.T @ slope - 20.0 * np.eye(layout.count)
    found = layout.of_further_record(np.ones(layout.count), inner)
    assert np.abs(found).max() <= 1.0


@pytest.mark.parametrize("value", [0.0, 1e-3, 5e-3])
def test_values_stay_within_their_range(value: float) -> None:
    effect: EffectType = effect_type("delay")
    form = effect.form("")
    (parameter,) = form.parameters
    start = parameter.nearest(value)
    fit = Fit(np.array([[start]]), np.ones(1), 0.0, np.array([[10.0 * parameter.upper]]))
    none = CellFit(*4 * (np.zeros(0),), 0.0)
    (near,) = FittedCandidates((Candidate(effect, form),), fit, none).deviated(
        chain_of(default_model().x), 0.1
    )
    ends = [
        form.insert(chain_of(default_model().x), np.array([v]))
        for v in (parameter.lower, parameter.upper)
    ]
    assert near.stages() in [each.stages() for each in ends]
    assert near.stages() != form.insert(chain_of(default_model().x), np.array([start])).stages()
