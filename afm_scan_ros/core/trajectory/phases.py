"""The phases of a scan: preparation, approach, lines and settling."""

from attrs import frozen

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory.preparation import preparation_samples


@frozen
class Phases:
    """The sample numbers of each phase of a scan; each phase begins where the one before ends."""

    preparation: range
    approach: range
    lines: range
    settle: range

    @property
    def total(self) -> int:
        """Samples in the scan."""
        return self.settle.stop


def phases(spec: ScanSpec) -> Phases:
    """Return where each phase of a scan lies; the very last sample is at rest at zero."""
    prepared = preparation_samples(spec)
    approached = prepared + approach_samples(spec)
    scanned = approached + spec.lines * spec.samples_per_line
    return Phases(
        preparation=range(prepared),
        approach=range(prepared, approached),
        lines=range(approached, scanned),
        settle=range(scanned, scanned + settle_samples(spec) + 1),
    )


def total_samples(spec: ScanSpec) -> int:
    """Samples in the whole scan, preparation, approach and settling included."""
    return phases(spec).total


def approach_samples(spec: ScanSpec) -> int:
    """Samples from rest at zero to the first line."""
    return max(1, round(spec.approach / spec.sample_period))


def settle_samples(spec: ScanSpec) -> int:
    """Samples from the last line's end to rest at zero."""
    return max(1, round(spec.settle / spec.sample_period))
