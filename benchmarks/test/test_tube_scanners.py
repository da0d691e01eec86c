"""A drawn tube scanner: its images are scored against the truth, and identified from one pair."""

import numpy as np

import afm_scan_ros as afm
from afm_scan_bench.images.cases import draw_case
from afm_scan_bench.images.outcomes import FIGURES, VARIANTS
from afm_scan_bench.images.score import Places, score, true_places


def test_a_pair_of_images_gives_the_pitch_of_a_drawn_scanner() -> None:
    case = draw_case(0)
    taken = next(iter(case.images((case.frame,))))
    true = true_places(taken)
    exact = score(true, true, case.grating.pitch, case.frame)
    assert max(exact.pitch_x, exact.pitch_y) < 1e-12
    x, y = case.scanner.nominal
    found = afm.identify_from_images([taken.image], case.grating.pitch, (1.0 / x, 1.0 / y))
    placed = found.positions[0]
    assert placed.retrace is not None
    places = Places(np.moveaxis(placed.trace, -1, 0), np.moveaxis(placed.retrace, -1, 0))
    reached = score(places, true, case.grating.pitch, case.frame)
    assert max(reached.pitch_x, reached.pitch_y) < 0.01 * FIGURES["pitch_x"][1]
    assert next(iter(VARIANTS.values())) == (0,)
