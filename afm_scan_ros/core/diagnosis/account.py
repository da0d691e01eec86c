"""All that is said of a residual: the diagnosis, and what it is before and after."""

from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_trace import UNEXPLAINED, AxisTrace
from afm_scan_ros.core.diagnosis.describe import Description, describe
from afm_scan_ros.core.diagnosis.diagnosis import Diagnosis
from afm_scan_ros.core.diagnosis.suggestion import Suggestion, suggest


@frozen(eq=False)
class Account:
    """A diagnosis with its residuals described, one description a record on each axis.

    ``before`` is of the model, ``after`` of the extended one. ``suggestions`` are of axes that
    stay unexplained.
    """

    diagnosis: Diagnosis
    before: dict[str, tuple[Description, ...]]
    after: dict[str, tuple[Description, ...]]
    suggestions: tuple[Suggestion, ...]


def account(diagnosis: Diagnosis) -> Account:
    """Describe the residuals of the records that were diagnosed; suggest where nothing is found."""
    traces = diagnosis.traces
    before = {axis: _described(trace, trace.chain, diagnosis) for axis, trace in traces.items()}
    after = {
        axis: before[axis]
        if trace.final is trace.chain
        else _described(trace, trace.final, diagnosis)
        for axis, trace in traces.items()
    }
    unexplained = [trace for trace in traces.values() if trace.verdict == UNEXPLAINED]
    offered = [suggest(trace.axis, trace.evidence, trace.chain) for trace in unexplained]
    found = tuple(each for each in offered if each)
    return Account(diagnosis, before, after, found)


def loudest(trace: AxisTrace) -> int:
    """Number of the record whose residual exceeds its floor most."""
    peaks = [float(ratio.max()) for ratio in trace.ratio_before]
    return peaks.index(max(peaks))


def _described(trace: AxisTrace, chain: Chain, diagnosis: Diagnosis) -> tuple[Description, ...]:
    records = zip(trace.evidence, diagnosis.observations, strict=True)
    return tuple(describe(evidence, chain, observed) for evidence, observed in records)
