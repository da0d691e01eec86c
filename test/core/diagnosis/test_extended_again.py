"""A model that has an effect already is extended by another: the first one counts once."""

import numpy as np
import pytest
from attrs import evolve

import afm_scan_ros as afm
from afm_scan_ros.core.model import Added, ScannerModel

MODE = Added("extra_resonance", "series_mode", (0.05, 1300.0, 0.03))


@pytest.mark.evidence
def test_the_extended_model_predicts_what_was_fitted() -> None:
    default = afm.load_model()
    axis = evolve(default.scanner.axis("x"), added=(MODE,))
    model = evolve(default, scanner=ScannerModel(x=axis))
    spec = afm.ScanSpec(range_x=10e-6, range_y=10e-6, lines=4, line_rate=20.0, y_step=2e-3)
    drive = default.invert(afm.trajectory(spec), spec.sample_period)[:, 0]
    late = np.roll(model.predict(drive, spec.sample_period), 4)
    moved = late + 2e-9 * np.random.default_rng(1).standard_normal(len(late))
    found = afm.diagnose(model, [afm.Record(drive, moved, spec.sample_period, scan=spec)])
    extended = found.model.scanner.axis("x")
    assert extended.added[0] == MODE
    assert len(extended.added) == 2
    assert extended.vibration == axis.vibration
    left = moved - found.model.predict(drive, spec.sample_period)
    assert np.std(left) < 1.1 * found.scanner_diagnosis.rms_after["x"]
