"""The intervals of the vibration hold the truth about as often as stated."""

from afm_scan_bench.accuracy.intervals.vibration import coverage


def test_intervals_hold_the_truth() -> None:
    rows = coverage(range(20))
    assert [row["parameter"] for row in rows] == ["resonance", "damping", "gain"]
    for row in rows:
        assert float(row["inside_percent"]) >= 80.0
        assert 0.0 < float(row["half_width"]) < 1e-2 * float(row["true"])
