"""Records of which each is another scan: one that is given twice would count as new data."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import AXES

SAME = 1e-6
"""Of a record's range: text with seven digits keeps as much, and no sensor repeats itself so."""


def refuse_same(infos: Sequence[ScanInfo], records: Sequence[Observation]) -> None:
    """Refuse two records of one scan: copies, parts, or what two recorders have of it.

    They are compared by the scan's id and beginning, and where these are unknown by the samples.
    Raises InputError, which names both.
    """
    for (info, record), (other, again) in combinations(zip(infos, records, strict=True), 2):
        named = info.start != 0 and (info.scan_id, info.start) == (other.scan_id, other.start)
        if named or _alike(record, again):
            raise InputError(
                f"{again.name}: holds the same scan as {record.name}, which adds nothing new and"
                " would count twice: give one of them"
            )


def _alike(record: Observation, again: Observation) -> bool:
    """Whether both hold the same samples as far as the shorter one reaches."""
    if record.sample_period != again.sample_period:
        return False
    both = min(len(each.displacement.x) for each in (record, again))
    pairs = ([each.displacement.axis(a)[:both] for each in (record, again)] for a in AXES)
    return all(np.abs(one - other).max() <= SAME * np.ptp(one) for one, other in pairs)
