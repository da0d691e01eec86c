"""One model of the fine steering mirror measured by others, for all its amplitudes."""

import os

import numpy as np
import pytest

from afm_scan_bench.measured.fsm_competing import products
from afm_scan_bench.measured.mirror.extended_fits import (
    MIDDLE,
    REFERENCE,
    left_out_errors,
    linear,
    percent,
    squared,
    steady_records,
)
from afm_scan_bench.measured.mirror.fits import AMPLITUDES
from afm_scan_ros.core.identification.state_space.elements import Softening
from afm_scan_ros.core.identification.state_space.feedback import fit_feedback
from afm_scan_ros.files.share import share_directory

DATA = os.environ.get("AFM_SCAN_DATA") or str(share_directory().parent / "shared/data")
with_data = pytest.mark.skipif(
    not os.path.isdir(os.path.join(DATA, "piezo_fsm")),  # noqa: PTH112, PTH118
    reason=f"no piezo_fsm in {DATA}: AFM_SCAN_DATA",
)
FOLD = (0,)
STATES = 28


@with_data
def test_one_softening_model_follows_all_amplitudes() -> None:
    """In short: fewer states, nothing at the inputs, a quarter of the lines, no second round."""
    start = linear(MIDDLE, FOLD, STATES)
    elongation = np.linalg.inv(start.response(np.zeros(1))[0].real)
    elements = (Softening(elongation, REFERENCE),)
    model = fit_feedback(steady_records(FOLD), start, elements, rounds=0)
    for amplitude in AMPLITUDES:
        assert percent(left_out_errors(model, amplitude, FOLD)) < 7.0
        if amplitude != MIDDLE:
            assert percent(left_out_errors(start, amplitude, FOLD)) > 14.0


def test_errors_are_those_of_all_outputs_about_their_means() -> None:
    output = np.random.default_rng(0).standard_normal((100, 3, 2))
    output -= output.mean(axis=0)
    squares = squared(0.9 * output + 5.0, output)
    assert percent(squares) == pytest.approx(10.0)


def test_products_are_of_one_sample_each() -> None:
    outputs = 1e-6 * np.arange(12.0).reshape(2, 3, 2)
    columns = products(outputs)
    assert columns.shape == (4, 3 + 6 + 10)
    assert columns[:, 0].tolist() == [0.0, 6.0, 1.0, 7.0]
    assert columns[:, 4] == pytest.approx(columns[:, 0] * columns[:, 1])
