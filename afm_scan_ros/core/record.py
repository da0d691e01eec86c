"""A record: drive and measured displacement of a scanner."""

import logging

from attrs import field, frozen
from numpy.typing import ArrayLike

from afm_scan_ros.core.arguments import (
    SPEC,
    axes_of,
    of_type,
    period_of,
    refuse_other_count,
    samples,
)
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.experiments import KINDS
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Array, Trace, trace_of

LOG = logging.getLogger(__name__)

STARTS = ("unknown", "depolarised")


def _drive(given: ArrayLike) -> Array:
    return samples("drive", given)


def _displacement(given: ArrayLike) -> Array:
    return samples("displacement", given)


def _shape(values: Array) -> str:
    return f"<{values.shape}>"


@frozen(eq=False)
class Record:
    """Drive and measured displacement against time, of any number of axes, evenly sampled.

    Arguments:
        drive: V, shape (n,) or (n, channels); kept as (n, channels).
        displacement: m, as long, measured just before each update of the drive. Its zero is taken
            from the record itself, so that a sensor's offset does not matter.
        sample_period: s.
        axes: the axis of each channel of the displacement, and of the drive where it has as many.
            Models of hysteresis and creep are of "x" and "y".
        kind: what the record was made for: "creep", "frequency", "hysteresis", "validation", or
            an experiment of ``afm-scan calibrate``. None where that is to be recognised.
        start: "depolarised" where the scanner's hysteresis is known to begin so; "unknown" has
            ``diagnose`` estimate its initial state.
        name: what messages and reports call it.
        scan: the scan that it is a record of, if of any. Its lines separate level and motion.
        shortcomings: what is missing in the file that it was read from, in sentences. Whatever
            uses the record logs them as warnings, or refuses it.
        info: what its bag states of it.

    Raises InputError for shapes that do not pair, for what is not finite, a sample period that is
    not positive, an axis given twice, and an unknown kind or start.

    >>> import numpy as np
    >>> import afm_scan_ros as afm
    >>> drive = np.sin(np.linspace(0.0, 6.28, 1000))
    >>> record = afm.Record(drive, 5e-6 * drive, sample_period=1e-4)
    >>> record.drive.shape, record.axes
    ((1000, 1), ('x',))
    """

    drive: Array = field(converter=_drive, repr=_shape)
    displacement: Array = field(converter=_displacement, repr=_shape)
    sample_period: float = field(converter=period_of)
    axes: tuple[str, ...] = field(default=("x",), converter=axes_of)
    kind: str | None = None
    start: str = "unknown"
    name: str = field(default="", kw_only=True)
    scan: ScanSpec | None = field(default=None, kw_only=True)
    shortcomings: tuple[str, ...] = field(default=(), kw_only=True)
    info: ScanInfo | None = field(default=None, kw_only=True, repr=False)

    def __attrs_post_init__(self) -> None:
        refuse_other_count("displacement", self.displacement, self.axes)
        if len(self.drive) != len(self.displacement):
            raise InputError(
                f"drive has {len(self.drive)} samples and displacement {len(self.displacement)}:"
                " give one displacement for each drive"
            )
        if self.kind is not None and self.kind not in KINDS:
            raise InputError(f"kind {self.kind!r} is unknown: give one of {', '.join(KINDS)}")
        if self.start not in STARTS:
            raise InputError(f"start {self.start!r} is unknown: give one of {', '.join(STARTS)}")
        if self.scan is not None:
            of_type(ScanSpec, "scan", self.scan, SPEC)

    @property
    def missing(self) -> int:
        """Samples that the record's bag announces and does not hold."""
        return 0 if self.info is None else self.info.total_samples - len(self.drive)

    def traces(self) -> tuple[Trace, Trace]:
        """Return drive (V) and displacement (m) of both axes; an absent axis is zero.

        Logs the shortcomings. Raises InputError for other axes than x and y.
        """
        if not set(self.axes) <= set(AXES):
            raise InputError(
                f"{self.name or 'record'}: its axes are {', '.join(self.axes)}: name them x and y,"
                " unless the scanner has coupled axes"
            )
        refuse_other_count("drive", self.drive, self.axes)
        for shortcoming in self.shortcomings:
            LOG.warning("%s", shortcoming)
        drive, displacement = (
            trace_of(values, self.axes, self.sample_period)
            for values in (self.drive, self.displacement)
        )
        return drive, displacement
