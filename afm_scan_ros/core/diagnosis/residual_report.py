"""The diagnosis together with descriptions of the residuals before and after."""

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
    """Describe the residuals of the diagnosed records; suggest equations where unexplained."""
    by_axis = diagnosis.by_axis
    before = {
        axis: _described(diagnosed, diagnosed.chain, diagnosis)
        for axis, diagnosed in by_axis.items()
    }
    after = {
        axis: before[axis]
        if diagnosed.final is diagnosed.chain
        else _described(diagnosed, diagnosed.final, diagnosis)
        for axis, diagnosed in by_axis.items()
    }
    unexplained = [diagnosed for diagnosed in by_axis.values() if diagnosed.verdict == UNEXPLAINED]
    offered = [
        suggest(diagnosed.axis, diagnosed.evidence, diagnosed.chain) for diagnosed in unexplained
    ]
    found = tuple(each for each in offered if each)
    return ResidualReport(diagnosis, before, after, found)


def most_excited_record(diagnosed: AxisDiagnosis) -> int:
    """Number of the record whose residual exceeds its detection limit most."""
    peaks = [float(ratio.max()) for ratio in diagnosed.ratio_before]
    return peaks.index(max(peaks))


def _described(
    diagnosed: AxisDiagnosis, chain: Chain, diagnosis: ScannerDiagnosis
) -> tuple[Description, ...]:
    records = zip(diagnosed.evidence, diagnosis.observations, strict=True)
    return tuple(describe(evidence, chain, observed) for evidence, observed in records)
