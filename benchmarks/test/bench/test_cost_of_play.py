"""What a known play costs: more the wider it is, and less the slower the scan turns round."""

from itertools import pairwise

from afm_scan_bench.accuracy.play import rows_of


def test_a_wide_play_costs_more_than_a_narrow_one_and_less_where_the_turn_is_slow() -> None:
    fast, slow = (list(rows_of(30.0, turnaround)) for turnaround in (0.1, 0.3))
    for narrow, wide in pairwise(fast):
        assert float(narrow["crossing_nm"]) < float(wide["crossing_nm"])
    assert float(slow[-1]["crossing_nm"]) <= 0.7 * float(fast[-1]["crossing_nm"])
    assert float(fast[0]["ratio"]) <= 1.3
