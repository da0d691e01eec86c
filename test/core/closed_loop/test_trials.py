"""The scans that judge a model differ from the fitted one in one thing each."""

import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.closed_loop import FIRST, validation_specs
from afm_scan_ros.core.scan_spec import PATTERNS, ScanSpec

specs = st.builds(
    ScanSpec,
    pattern=st.sampled_from(PATTERNS),
    line_rate=st.floats(5.0, 240.0),
    lines=st.integers(3, 20),
    samples_per_line=st.integers(100, 2000).map(lambda half: 2 * half),
    turnaround=st.floats(0.0, 0.5),
    preparation_rate=st.just(2.0),
    approach=st.just(0.2),
    settle=st.just(0.2),
)


@given(specs)
def test_each_trial_differs_in_what_it_is_called_after(spec: ScanSpec) -> None:
    comparisons = validation_specs(spec)
    assert comparisons[FIRST] is spec
    amplitude = evolve(spec, range_x=0.5 * spec.range_x, range_y=0.5 * spec.range_y)
    assert comparisons["amplitude"] == amplitude
    rate = comparisons["rate"]
    ratio = rate.line_rate / spec.line_rate
    assert ratio == pytest.approx(0.5 if spec.line_rate > 20.0 else 2.0, rel=0.03)
    kept = evolve(
        rate,
        line_rate=spec.line_rate,
        samples_per_line=spec.samples_per_line,
        y_step=spec.y_step,
    )
    assert kept == spec
    other = comparisons["pattern"]
    assert other.pattern != spec.pattern
    assert evolve(other, pattern=spec.pattern, y_step=spec.y_step) == spec
    for trial in comparisons.values():
        assert trial.sample_period == pytest.approx(spec.sample_period, rel=1e-12)
