"""What is seen of a residual before any candidate is fitted: where to begin."""

from attrs import frozen

from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Clues:
    """Of one axis of one record: ``displacement`` and ``residual`` (m), ``drive`` (V), all (n,).

    ``sample_period`` in s. ``prominent`` are the frequencies (Hz) of the residual's largest lines
    that stand out of their neighbourhood and of the floor, the largest first.
    """

    sample_period: float
    drive: Array
    displacement: Array
    residual: Array
    prominent: tuple[float, ...]

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return len(self.residual) * self.sample_period
