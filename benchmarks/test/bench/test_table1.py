"""The paper's Table 1 and ours: a third order is enough for both, ours down to the noise."""

from afm_scan_bench.accuracy.table1 import PAPER, measure
from afm_scan_bench.scans import default_plant


def test_third_order_is_chosen_and_misses_by_the_noise_alone() -> None:
    rows = {int(row["order"]): row for row in measure().rows}
    assert sorted(rows) == sorted(PAPER)
    assert [order for order, row in rows.items() if row["chosen"]] == [3]
    noise = 1e9 * default_plant().sensor.noise_rms
    assert float(rows[3]["held_out_nm"]) <= 1.1 * noise < float(rows[2]["held_out_nm"])
    assert all(float(row["sigma_mv"]) < row["paper_sigma_mv"] for row in rows.values())
