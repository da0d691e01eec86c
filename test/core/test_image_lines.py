"""Each line's image, however the two streams are cut and interleaved, and only on the lines."""

from itertools import pairwise
from random import Random

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.image_lines import ImageLines, frame_of
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases, total_samples
from afm_scan_ros.core.types import Trace
from afm_scan_ros.simulation.sample import HeightMap

SPEC = ScanSpec(
    range_x=10e-6,
    range_y=10e-6,
    line_rate=50.0,
    lines=3,
    samples_per_line=200,
    preparation_lower=-14e-6,
    preparation_upper=14e-6,
    approach=0.01,
)
TOTAL = total_samples(SPEC)
PATH = desired(SPEC, 0, TOTAL)
RAMP = HeightMap(np.tile(np.linspace(-6e-6, 6e-6, 13), (13, 1)), width=12e-6)
FRAME = frame_of(SPEC, 40)

edges = st.sets(st.integers(1, TOTAL - 1), max_size=12).map(lambda s: [0, *sorted(s), TOTAL])


@given(edges, edges, st.randoms(use_true_random=False))
@settings(deadline=None, max_examples=30)
def test_lines_show_the_sample_however_they_come(
    first: list[int], second: list[int], order: Random
) -> None:
    assert np.abs(PATH.x[: phases(SPEC).lines.start]).max() > 12e-6  # beyond the sample: not read
    cuts = {"desired_displacement": first, "achieved_displacement": second}
    queue = {
        name: [Trace(a, PATH.sample_period, PATH.x[a:b], PATH.y[a:b]) for a, b in pairwise(cut)]
        for name, cut in cuts.items()
    }
    imager, found = ImageLines(SPEC, FRAME, RAMP), []
    while any(queue.values()):
        name = order.choice([n for n in queue if queue[n]])
        found += imager.add(name, queue[name].pop(0))
    assert [line.number for line in found] == [0, 1, 2]
    for line in found:
        np.testing.assert_allclose(line.trace[1:-1], FRAME.centres[1:-1], atol=1e-12)
        np.testing.assert_allclose(line.retrace[1:-1], FRAME.centres[1:-1], atol=1e-12)
