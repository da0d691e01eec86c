"""One model of the fine steering mirror measured by others, for all its amplitudes."""

import os

import numpy as np
import pytest

from afm_scan_bench.measured.fsm_competing import products
from afm_scan_bench.measured.mirror.recordings import (
    AMPLITUDES,
    identified,
    measured,
    percent,
    predicted,
    score,
    squares,
)
from afm_scan_ros.files import share_directory

DATA = os.environ.get("AFM_SCAN_DATA") or str(share_directory().parent / "shared/data")
with_data = pytest.mark.skipif(
    not os.path.isdir(os.path.join(DATA, "piezo_fsm")),  # noqa: PTH112, PTH118
    reason=f"no piezo_fsm in {DATA}: AFM_SCAN_DATA",
)


@with_data
def test_one_softening_model_follows_all_amplitudes() -> None:
    """In short: fewer states, and no hysteresis of the stacks."""
    linear, softening = (
        identified(AMPLITUDES, (0,), effects, 28) for effects in ((), ("amplitude_softening",))
    )
    for amplitude in AMPLITUDES:
        assert percent(squares(predicted(softening, amplitude, 0), amplitude, 0)) < 7.0
    for amplitude in AMPLITUDES[::2]:
        assert percent(squares(predicted(linear, amplitude, 0), amplitude, 0)) > 14.0


@with_data
def test_the_score_is_the_mean_over_outputs_and_periods() -> None:
    output = measured(100).output[:, :, 0]
    assert score(output[:, :, 0], 100, 0) == pytest.approx(
        np.mean(np.sqrt(np.mean((output[:, :, 0] - output[:, :, 1]) ** 2, axis=0))) / 2.0
    )
    assert score(output.mean(axis=2) + 1e-6, 100, 0) == pytest.approx(1e-6, rel=0.01)


def test_errors_are_those_of_all_outputs() -> None:
    assert percent(np.array([[1.0, 2.0, 3.0], [100.0, 200.0, 300.0]])) == pytest.approx(10.0)


def test_products_are_of_one_sample_each() -> None:
    outputs = 1e-6 * np.arange(12.0).reshape(4, 3)
    columns = products(outputs)
    assert columns.shape == (4, 3 + 6 + 10)
    assert columns[:, 0].tolist() == [0.0, 3.0, 6.0, 9.0]
    assert columns[:, 4] == pytest.approx(columns[:, 0] * columns[:, 1])
