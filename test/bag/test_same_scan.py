"""One scan given twice is refused, whoever recorded it; two scans are not."""

import pytest
from attrs import evolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Trace
from afm_scan_ros.diagnosis import refuse_same
from helpers.in_process import ALL, scan

SPEC = ScanSpec(line_rate=20.0, lines=2, samples_per_line=500, preparation="none")
INFO = info_of_scan(SPEC, "20260101T000000Z", 1_720_000_000_000_000_000)
LATER = evolve(INFO, scan_id="20260101T000100Z", start=INFO.start + 60_000_000_000)


@pytest.fixture(scope="module")
def done() -> Scan:
    return scan(SPEC, ALL)


def record(done: Scan, name: str, samples: int | None = None, gain: float = 1.0) -> Record:
    def part(trace: Trace, factor: float) -> Trace:
        return evolve(trace, x=factor * trace.x[:samples], y=factor * trace.y[:samples])

    return Record.of_traces(name, part(done.drive, 1.0), part(done.measured, gain), SPEC)


def refusal(infos: tuple[ScanInfo, ScanInfo], *records: Record) -> str:
    with pytest.raises(InputError) as refused:
        refuse_same([evolve(each, info=info) for each, info in zip(records, infos, strict=True)])
    return str(refused.value)


def test_the_same_record_is_refused_by_both_names(done: Scan) -> None:
    message = refusal((INFO, INFO), record(done, "q"), record(done, "copies/q"))
    assert message == (
        "copies/q: holds the same scan as q, which adds nothing new and would count twice: give one"
        " of them"
    )


def test_a_part_that_was_given_another_name_is_refused(done: Scan) -> None:
    """As after an import of what was exported: seven digits, and no time."""
    imported = evolve(INFO, scan_id="measured", start=0)
    part = record(done, "part", samples=1500, gain=1.0 + 1e-7)
    assert "part: holds the same scan as whole" in refusal(
        (INFO, imported), record(done, "whole"), part
    )


def test_what_two_recorders_have_of_a_scan_is_refused(done: Scan) -> None:
    """The second one's sensor has another gain."""
    assert "same scan" in refusal((INFO, INFO), record(done, "a"), record(done, "b", gain=1.01))


def test_two_scans_are_two(done: Scan) -> None:
    """Also where imports of two files bear one name."""
    again = scan(SPEC, ALL, seed=2)
    records = record(done, "a"), record(again, "b")
    for infos in ((INFO, LATER), [evolve(INFO, start=0)] * 2):
        refuse_same([evolve(each, info=info) for each, info in zip(records, infos, strict=True)])
