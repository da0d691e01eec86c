"""Records that show no vibration give a model without one, which predicts faster scans."""

import numpy as np

import afm_scan_ros as afm
from afm_scan_ros.core.model import Status
from helpers.fit_cases import LIMIT, of_plays


def test_slow_steps_predict_a_scan_a_hundred_times_as_fast() -> None:
    """A lag of a tenth of a sample, which such steps hardly show, would be 3 % of that scan."""
    turns = [0.0, LIMIT, -LIMIT, 0.5 * LIMIT, -0.5 * LIMIT, 0.0]
    ramps = np.interp(np.arange(0.0, 60.0, 0.02), np.linspace(0.0, 55.0, 6), turns)
    drive = np.concatenate([ramps, np.repeat([1.0, -1.0, 0.0], 300)])
    moved = 1e-6 * of_plays(drive)
    moved[1:] = moved[:-1]  # read just before the next update
    moved += 1e-9 * np.random.default_rng(2).standard_normal(len(drive))
    model = afm.identify([afm.Record(drive, moved, 0.02, start="depolarised")])
    assert model.effects["x"].vibration.status is Status.UNKNOWN
    scan = LIMIT * np.interp(np.arange(4000) / 1000.0 % 1.0, [0.0, 0.25, 0.75, 1.0], [0, 1, -1, 0])
    true = 1e-6 * of_plays(scan)
    error = model.predict(scan, 2e-4)[1:] - true[:-1]
    assert np.std(error) < 2e-3 * np.ptp(true)
