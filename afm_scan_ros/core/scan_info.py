"""What is needed to reproduce a scan and to image it."""

from attrs import frozen

from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import total_samples


@frozen
class ScanInfo:
    """What is needed to reproduce and to image a scan.

    ``start`` in ns since the epoch is the time of sample 0. ``spec`` is None for a record that is
    not a scan, as those of a calibration are; ``pattern`` then names what it is. ``model_hash`` is
    empty where no model was used. ``trigger_offset`` in s runs from the converter's update to the
    sensor's sample.
    """

    scan_id: str
    start: int
    pattern: str
    sample_period: float
    total_samples: int
    spec: ScanSpec | None = None
    inverses: tuple[str, ...] = ()
    model_hash: str = ""
    sampling_instant: str = "before_update"
    trigger_offset: float = 0.0
    window: int = 0
    nodes: tuple[str, ...] = ()

    def stamp(self, sample: int) -> int:
        """Time of a sample, ns: the same on all topics, whatever the clock does."""
        return self.start + round(sample * self.sample_period * 1e9)


def info_of_scan(spec: ScanSpec, scan_id: str, start: int) -> ScanInfo:
    """Describe a scan; ``attrs.evolve`` adds what else is known of it."""
    return ScanInfo(
        scan_id, start, spec.pattern, spec.sample_period, total_samples(spec), spec=spec
    )
