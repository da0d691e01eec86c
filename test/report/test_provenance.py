"""What a report is of: as many samples as were read, at the rate that was set."""

import pytest

from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.report.page import source_of


@pytest.mark.parametrize("rate", [50_000, 49_000, 3.0])
def test_a_rate_is_what_was_set_not_what_division_leaves(rate: float) -> None:
    info = ScanInfo("one", 0, "rest", 1.0 / rate, 5000)
    source = source_of("bag", info, samples=4000)
    assert source.sample_rate == rate
    assert (source.samples, source.samples_announced) == (4000, 5000)
