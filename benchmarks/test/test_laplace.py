"""The prior of nested sampling is that of Laplace's method, and its integral is right."""

import sys

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from afm_scan_bench.diagnosis.laplace import nested
from afm_scan_bench.diagnosis.prior import LogUniform, distributions
from afm_scan_ros.core.diagnosis.parameter_layout import ParameterLayout
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.effects.registry import CATALOGUE
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

FORMS = [form for effect in CATALOGUE for form in effect.forms]
SHARES = st.floats(0.02, 0.98)


@given(
    form=st.sampled_from(FORMS),
    share=st.floats(0.02, 0.45),
    place=SHARES,
    span=st.floats(2.0, 15.0),
)
def test_its_density_is_that_of_laplace(
    form: EffectForm, share: float, place: float, span: float
) -> None:
    layout = ParameterLayout([form], 1)
    lower, upper = layout.each("lower"), layout.each("upper")
    values = lower + share * (upper - lower)
    assume(np.all(np.abs(values - layout.each("neutral")) > 1e-6 * (upper - lower)))
    widths = np.sqrt(2.0 * np.pi) * layout.prior_widths(values, span)
    found = distributions(layout, values, [place] * len(values), span)
    for value, width, one in zip(values, widths, found, strict=True):
        assert (
            (one == value)
            if isinstance(one, float)
            else (one.density(value) * width) == (pytest.approx(1.0))
        )


@given(
    centre=st.floats(-5.0, 5.0),
    least=st.floats(1e-3, 1.0),
    times=st.floats(1.5, 1e4),
    sides=st.sampled_from([(1.0,), (-1.0,), (-1.0, 1.0)]),
    quantile=SHARES,
)
def test_equal_steps_of_the_cube_hold_equal_probability(
    centre: float, least: float, times: float, sides: tuple[float, ...], quantile: float
) -> None:
    one = LogUniform(centre, least, least * times, sides)
    if abs(quantile - 0.5) > 1e-3:
        step = one.at(quantile + 1e-6) - one.at(quantile - 1e-6)
        assert abs(step) * one.density(one.at(quantile)) == pytest.approx(2e-6, rel=1e-3)


def test_a_gaussian_in_a_box_has_the_evidence_of_its_volume() -> None:
    pytest.importorskip("dynesty")
    widths = np.array([0.01, 0.03])

    def log_likelihood(values: Array) -> float:
        return float(-0.5 * np.sum(((values - 0.4) / widths) ** 2))

    found = nested(log_likelihood, np.asarray, 2)
    assert abs(found.evidence - np.sum(np.log(np.sqrt(2.0 * np.pi) * widths))) < 4.0 * found.error
    assert found.highest == pytest.approx(0.0, abs=0.01)


def test_without_dynesty_the_command_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dynesty", None)
    with pytest.raises(InputError, match=r"benchmarks\[nested\]"):
        nested(lambda _: 0.0, np.asarray, 1)
