"""Intervals hold the truth about as often as stated; `afm-scan bench coverage` counts closer."""

from scipy.stats import binom

from afm_scan_bench.accuracy.intervals.creep import coverage

SEEDS = 12


def test_truth_lies_within_its_interval_about_19_times_of_20() -> None:
    rows = coverage(range(SEEDS))
    assert {str(row["parameter"]).split(" ", 1)[0] for row in rows} == {"x", "y"}
    fewest = binom.ppf(1e-3, SEEDS, 0.95)
    for row in rows:
        assert float(row["inside_percent"]) >= 100.0 * fewest / SEEDS
