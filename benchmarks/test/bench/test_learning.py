"""A learned drive removes the residual of a model, and is no worse than the first drive."""

from attrs import evolve

from afm_scan_bench.accuracy.learning import error, learned
from afm_scan_bench.mechanisms.product_sizes import sized
from afm_scan_bench.scans import ALL, default_plant, scan, spec_at

SPEC = evolve(spec_at(30.0), lines=2, preparation="none")


def test_what_a_linear_response_explains_is_unlearnt() -> None:
    began = scan(SPEC, ALL)
    assert error(learned(began, default_plant())) <= 0.1 * error(began)


def test_a_play_is_not_unlearnt_but_never_made_worse() -> None:
    loose = evolve(default_plant(), mechanisms=sized("backlash", "large", "x"))
    began = scan(SPEC, ALL, plant=loose)
    best = error(learned(began, loose))
    assert 3e-9 <= best <= 0.5 * error(began)
