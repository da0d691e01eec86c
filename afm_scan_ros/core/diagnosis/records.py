"""The signals of a record, and those of one of its axes, as the diagnosis uses them."""

from attrs import frozen

from afm_scan_ros.core.effects.residual_features import prominent_lines
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Array, Trace


@frozen(eq=False)
class Observation:
    """Drive (V) and measured displacement (m) of one record, from its first sample on.

    ``spec`` is that of a scan, None for any other record. ``experiment`` is the name of a proposed
    experiment. ``axes`` are the recorded ones; the other one is zero. ``depolarised`` states the
    initial state. Raises InputError, which names the record, where drive and displacement differ
    in samples or period.
    """

    name: str
    drive: Trace
    displacement: Trace
    spec: ScanSpec | None = None
    experiment: str | None = None
    axes: tuple[str, ...] = AXES
    depolarised: bool = False

    def __attrs_post_init__(self) -> None:
        counts = {len(t.axis(a)) for t in (self.drive, self.displacement) for a in ("x", "y")}
        if len(counts) != 1 or self.drive.sample_period != self.displacement.sample_period:
            raise InputError(
                f"{self.name}: drive and displacement must have the same samples, found"
                f" {', '.join(str(c) for c in sorted(counts))} of them, every"
                f" {self.drive.sample_period:g} and {self.displacement.sample_period:g} s"
            )

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return self.drive.sample_period

    @property
    def rates(self) -> tuple[float, ...]:
        """Rates (Hz) at which the motion repeats: a scan's line rate, else spectral lines."""
        if self.spec:
            lines = self.spec.line_rate
            of_y = (lines * (1.0 - 1.0 / self.spec.lines),)
            return (lines, *(of_y if self.spec.pattern == "lissajous" else ()))
        lined = (prominent_lines(self.drive.axis(a), self.sample_period) for a in AXES)
        return tuple(rate for found in lined for rate in found)


@frozen(eq=False)
class AxisSignals:
    """One axis of a record: ``drive`` (V), ``measured`` (m) and ``other`` (m), all of shape (n,).

    ``other`` is the other axis' own displacement, as the model predicts it. ``number`` is the place
    of the record among those diagnosed together. ``rates`` (Hz) are those at which the motion of
    either axis repeats.
    """

    name: str
    sample_period: float
    drive: Array
    measured: Array
    other: Array
    number: int = 0
    rates: tuple[float, ...] = ()

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return len(self.drive) * self.sample_period
