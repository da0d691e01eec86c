"""A learning that repeats a scan tells how many of its scans are over."""

import numpy as np

import afm_scan_ros as afm
from afm_scan_ros.core.types import Step


def test_each_scan_is_counted_before_it_begins() -> None:
    model, noise, steps = afm.load_model(), np.random.default_rng(1), []
    spec = afm.ScanSpec(lines=3, line_rate=30.0, samples_per_line=200, preparation_cycles=2)

    def measure(drive: np.ndarray) -> np.ndarray:
        moved = 1.01 * model.predict(drive, spec.sample_period)
        return moved + 2e-9 * noise.standard_normal(moved.shape)

    afm.learn(model, spec, measure, scans=3, progress=steps.append)
    assert [(type(step), step.done, step.total) for step in steps] == [
        (Step, done, 3) for done in range(3)
    ]
    assert steps[0].left(10.0) is None
    assert [step.left(10.0) for step in steps[1:]] == [20.0, 5.0]
