"""All that is said of a residual: the diagnosis, and what it is before and after."""

from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import UNEXPLAINED, AxisDiagnosis
from afm_scan_ros.core.diagnosis.describe import Description, describe
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.suggestion import Suggestion, suggest


@frozen(eq=False)
class ResidualReport:
    """A diagnosis with its residuals described, one description a record on each axis.

    ``before`` is of the model, ``after`` of the extended one. ``suggestions`` are of axes that
    stay unexplained.
    """

    diagnosis: ScannerDiagnosis
    before: dict[str, tuple[Description, ...]]
    after: dict[str, tuple[Description, ...]]
    suggestions: tuple[Suggestion, ...]


def report_residual(diagnosis: ScannerDiagnosis) -> ResidualReport:
    """Describe the residuals of the records that were diagnosed; suggest where nothing is found."""
    by_axis = diagnosis.by_axis
    before = {axis: _described(trace, trace.chain, diagnosis) for axis, trace in by_axis.items()}
    after = {
        axis: before[axis]
        if trace.final is trace.chain
        else _described(trace, trace.final, diagnosis)
        for axis, trace in by_axis.items()
    }
    unexplained = [trace for trace in by_axis.values() if trace.verdict == UNEXPLAINED]
    offered = [suggest(trace.axis, trace.evidence, trace.chain) for trace in unexplained]
    found = tuple(each for each in offered if each)
    return ResidualReport(diagnosis, before, after, found)


def most_excited_record(trace: AxisDiagnosis) -> int:
    """Number of the record whose residual exceeds its floor most."""
    peaks = [float(ratio.max()) for ratio in trace.ratio_before]
    return peaks.index(max(peaks))


def _described(
    trace: AxisDiagnosis, chain: Chain, diagnosis: ScannerDiagnosis
) -> tuple[Description, ...]:
    records = zip(trace.evidence, diagnosis.observations, strict=True)
    return tuple(describe(evidence, chain, observed) for evidence, observed in records)
