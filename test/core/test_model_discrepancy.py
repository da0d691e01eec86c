"""A model discrepancy pairs its bands with an rms each."""

import numpy as np
import pytest

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ModelDiscrepancy, band_edges


def test_bands_end_at_the_nyquist_frequency() -> None:
    assert band_edges(1e-3, 500.0) == (0.0, 1.1, 3.3, 11.0, 33.0, 110.0, 330.0, 500.0)
    assert band_edges(1e-3, 123.456)[1:3] == (0.272, 0.815)


@pytest.mark.parametrize(
    ("bands", "rms", "reason"),
    [
        ((0.0, 1.0), (1e-9, 1e-9), "2 edges"),
        ((0.0,), (), "1 edges"),
        ((1.0, 0.5), (1e-9,), "ascend"),
        ((-1.0, 0.5), (1e-9,), "ascend"),
        ((0.0, 1.0), (-1e-9,), "no rms"),
        ((0.0, 1.0), (np.nan,), "no rms"),
        ((0.0, np.inf), (1e-9,), "no rms"),
    ],
)
def test_what_is_no_model_discrepancy_is_refused(
    bands: tuple[float, ...], rms: tuple[float, ...], reason: str
) -> None:
    with pytest.raises(InputError, match=reason):
        ModelDiscrepancy("record", bands, rms, rms, rms)
