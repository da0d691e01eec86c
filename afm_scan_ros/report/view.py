"""A few lines of a recorded scan, to be looked at."""

import numpy as np
from attrs import frozen

from afm_scan_ros.bag.reader import ScanRecording
from afm_scan_ros.core.align import end, part
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import SampleKinds, phases, sample_kinds
from afm_scan_ros.core.types import Trace
from afm_scan_ros.report.analysis import scan_spec


@frozen(eq=False)
class View:
    """The same samples of the desired and the achieved displacement, m."""

    spec: ScanSpec
    desired: Trace
    achieved: Trace

    @property
    def kinds(self) -> SampleKinds:
        """What each sample is."""
        return sample_kinds(self.spec, self.desired.first_sample, self.desired.x.size)


def view_of(recording: ScanRecording, lines: int = 3) -> View:
    """Read ``lines`` lines after the first to-and-fro; all of them if there are fewer.

    Of a simulated scan it is the true displacement, free of noise, as far as the bag has it.
    Raises InputError as reading the recording does.
    """
    spec = scan_spec(recording)
    where = phases(spec).lines
    start = where.start + spec.samples_per_line
    stop = min(where.stop, start + lines * spec.samples_per_line)
    true = "true_displacement" in recording.topics
    achieved = "true_displacement" if true else "achieved_displacement"
    found: list[tuple[Trace, ...]] = []
    for by_axis in recording.blocks("desired_displacement", achieved):
        if by_axis[0].first_sample >= stop:
            break
        if end(by_axis[0]) > start:
            first, last = max(start, by_axis[0].first_sample), min(stop, end(by_axis[0]))
            found.append(tuple(part(trace, first, last) for trace in by_axis))
    return View(spec, *(_joined(start, spec, [f[i] for f in found]) for i in range(2)))


def _joined(start: int, spec: ScanSpec, by_axis: list[Trace]) -> Trace:
    x = np.concatenate([np.empty(0), *(trace.x for trace in by_axis)])
    y = np.concatenate([np.empty(0), *(trace.y for trace in by_axis)])
    return Trace(start, spec.sample_period, x, y)
