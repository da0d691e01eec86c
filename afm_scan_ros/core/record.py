"""A record: drive and measured displacement of a scanner."""

import logging
from collections.abc import Sequence

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import ArrayLike

from afm_scan_ros.core import arguments
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.experiments import KINDS
from afm_scan_ros.core.intersample import HELD, upsampling
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Array, Trace, by_value, channels_of, trace_of

LOG = logging.getLogger(__name__)

STARTS = ("unknown", "depolarised")


def _drive(given: ArrayLike) -> Array:
    return arguments.samples("drive", given)


def _displacement(given: ArrayLike) -> Array:
    return arguments.samples("displacement", given)


def _shape(values: Array) -> str:
    return f"<{values.shape}>"


@frozen
class Record:
    """Drive and measured displacement against time, of any number of axes, evenly sampled.

    Parameters
    ----------
    drive
        V, shape (n,) or (n, channels); kept as (n, channels).
    displacement
        m, as long, measured just before each update of the drive, or at the end of the sample: a
        fit tells which, where it matters. Its zero is taken from the record itself, so that a
        sensor's offset does not matter.
    sample_period
        s.
    axes
        The axis of each channel of the displacement, and of the drive where it has as many. Models
        of hysteresis and creep are of "x" and "y".
    kind
        What the record was made for: "creep", "frequency", "hysteresis", "validation", or an
        experiment of ``afm-scan calibrate``. None where that is not stated.
    start
        "depolarised" where the scanner's hysteresis is known to begin so; "unknown" has
        ``diagnose`` estimate its initial state.
    intersample
        How the drive runs between its samples: "held" by a converter, which is so of every drive
        that was commanded, or "band_limited", of one that was measured behind an anti-aliasing
        filter.
    name
        What messages and reports call it.
    scan
        The scan that it is a record of, if of any. Its lines separate level and motion.
    shortcomings
        What is missing in the file that it was read from, in sentences. Whatever uses the record
        logs them as warnings, or refuses it.
    info
        What its bag states of it.

    Raises
    ------
    InputError
        For shapes that do not pair, for what is not finite, a sample period that is not positive,
        an axis given twice, and an unknown kind, start or intersample behaviour.

    Notes
    -----
    Records are equal where all that they hold is equal.

    Examples
    --------
    >>> import numpy as np
    >>> import afm_scan_ros as afm
    >>> drive = np.sin(np.linspace(0.0, 6.28, 1000))
    >>> record = afm.Record(drive, 5e-6 * drive, sample_period=1e-4)
    >>> record.drive.shape, record.axes
    ((1000, 1), ('x',))
    >>> record.part(0, 500) == afm.Record(drive[:500], 5e-6 * drive[:500], sample_period=1e-4)
    True
    """

    drive: Array = field(converter=_drive, repr=_shape, eq=by_value)
    displacement: Array = field(converter=_displacement, repr=_shape, eq=by_value)
    sample_period: float = field(converter=arguments.period_of)
    axes: tuple[str, ...] = field(default=("x",), converter=arguments.axes_of)
    kind: str | None = None
    start: str = "unknown"
    intersample: str = field(default=HELD, kw_only=True)
    name: str = field(default="", kw_only=True)
    scan: ScanSpec | None = field(default=None, kw_only=True)
    shortcomings: tuple[str, ...] = field(default=(), kw_only=True)
    info: ScanInfo | None = field(default=None, kw_only=True, repr=False)

    def __attrs_post_init__(self) -> None:
        arguments.refuse_other_count("displacement", self.displacement, self.axes)
        if len(self.drive) != len(self.displacement):
            raise InputError(
                f"drive has {len(self.drive)} samples and displacement {len(self.displacement)}:"
                " give one displacement for each drive"
            )
        if self.kind is not None and self.kind not in KINDS:
            raise InputError(f"kind {self.kind!r} is unknown: give one of {', '.join(KINDS)}")
        if self.start not in STARTS:
            raise InputError(f"start {self.start!r} is unknown: give one of {', '.join(STARTS)}")
        upsampling(self.intersample)
        if self.scan is not None:
            arguments.of_type(ScanSpec, "scan", self.scan, arguments.SPEC)

    @classmethod
    def of_traces(
        cls,
        name: str,
        drive: Trace,
        displacement: Trace,
        scan: ScanSpec | None = None,
        *,
        axes: Sequence[str] = AXES,
        kind: str | None = None,
        start: str = "unknown",
    ) -> "Record":
        """Return the record of a run of drive (V) and displacement (m) at one sample period."""
        period = drive.sample_period
        if displacement.sample_period != period:
            raise InputError(
                f"{name}: drive every {period:g} s, displacement every"
                f" {displacement.sample_period:g} s; record both at one sample period"
            )
        given, moved = (channels_of(trace, axes) for trace in (drive, displacement))
        return cls(given, moved, period, axes, kind, start, name=name, scan=scan)

    @property
    def depolarised(self) -> bool:
        """Whether the scanner's hysteresis is known to begin depolarised."""
        return self.start == "depolarised"

    def axis(self, name: str) -> "Record":
        """Return the record of one axis alone; raises InputError where it holds no such axis."""
        if name not in self.axes:
            raise InputError(
                f"{self.name or 'record'}: has no axis {name}: give one of {', '.join(self.axes)}"
            )
        arguments.refuse_other_count("drive", self.drive, self.axes)
        drive, displacement = self.signals(name)
        return evolve(self, drive=drive, displacement=displacement, axes=(name,))

    def part(self, first: int, last: int) -> "Record":
        """Return the samples from ``first`` to before ``last``; InputError where it lacks any."""
        if not 0 <= first < last <= len(self.drive):
            raise InputError(
                f"{self.name or 'record'}: has no samples from {first} to before {last}: it holds"
                f" {len(self.drive)}"
            )
        return evolve(
            self,
            drive=self.drive[first:last],
            displacement=self.displacement[first:last],
            start="unknown" if first else self.start,
            scan=None,
            info=None,
        )

    def signals(self, axis: str) -> tuple[Array, Array]:
        """Return drive (V) and displacement (m) of an axis, (n,) each; zero of one not held."""
        if axis not in self.axes:
            return np.zeros(len(self.drive)), np.zeros(len(self.drive))
        channel = self.axes.index(axis)
        return self.drive[:, channel], self.displacement[:, channel]

    @property
    def missing(self) -> int:
        """Samples that the record's bag announces and does not hold."""
        return 0 if self.info is None else self.info.total_samples - len(self.drive)

    def warn(self) -> None:
        """Log the shortcomings as warnings."""
        for shortcoming in self.shortcomings:
            LOG.warning("%s", shortcoming)

    def traces(self) -> tuple[Trace, Trace]:
        """Return drive (V) and displacement (m) of x and y, 0 if absent; InputError for others."""
        if not set(self.axes) <= set(AXES):
            raise InputError(
                f"{self.name or 'record'}: its axes are {', '.join(self.axes)}: name them x and y,"
                " unless the scanner has coupled axes"
            )
        arguments.refuse_other_count("drive", self.drive, self.axes)
        drive, displacement = (
            trace_of(values, self.axes, self.sample_period)
            for values in (self.drive, self.displacement)
        )
        return drive, displacement
