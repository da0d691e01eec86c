"""The effects are of their stated sizes, on a scan that shows them."""

import pytest

from afm_scan_bench.diagnosis.mechanisms import LINE_RATES, added_nm
from afm_scan_bench.diagnosis.unmodelled.sets import HELD_OUT_MECHANISMS
from afm_scan_bench.mechanisms.product_sizes import EFFECTS, SIZES
from afm_scan_bench.mechanisms.sizes import sized


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_is_seen_on_one_of_the_scans_and_grows(effect: str) -> None:
    small, medium, large = (
        max(added_nm(sized(effect, size, "x"), rate) for rate in LINE_RATES[:2]) for size in SIZES
    )
    assert 30.0 < small < 60.0
    assert 1.2 * small < medium < 200.0
    assert max(200.0, 2.0 * medium) < large < 600.0


@pytest.mark.parametrize("effect", HELD_OUT_MECHANISMS)
def test_a_held_out_mechanism_is_as_large(effect: str) -> None:
    """Where docs/evidence/unmodelled.md states that it was sized."""
    small, medium, large = (added_nm(sized(effect, size, "x"), 30.0) for size in SIZES)
    assert 30.0 < small < 60.0
    assert 90.0 < medium < 200.0
    assert 200.0 < large < 600.0
