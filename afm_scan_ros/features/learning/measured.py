"""Learning of a scan from its measured errors."""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
from attrs import define, field, frozen
from numpy.typing import ArrayLike

from afm_scan_ros.core.arguments import LIMITS, MODEL, SPEC, of_type, samples, whole
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import INVERSES, InverseSettings, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import AXES, Array, ProgressCallback, Step, Trace
from afm_scan_ros.features.learning.loop import SCANS, LearningScan, best_of
from afm_scan_ros.features.learning.loop import learn as learning_scans
from afm_scan_ros.files.drive_files import save_learned
from afm_scan_ros.files.paths import path_of
from afm_scan_ros.model import UNLIMITED, Model

LOG = logging.getLogger(__name__)

Measure = Callable[[Array], ArrayLike]


@frozen(eq=False)
class Learned:
    """Result of ``learn``: the correction of the best scan, and the drive that it gives.

    ``scans`` hold each scan, its correction, and the test of convergence before it.
    """

    model: Model
    scans: tuple[LearningScan, ...] = field(repr=False)

    @property
    def correction(self) -> Array:
        """What is added to the desired displacement before its inversion, m, shape (n, 2)."""
        best = best_of(list(self.scans)).correction
        return np.column_stack([best.x, best.y])

    @property
    def drive(self) -> Array:
        """Drive of the best scan, V, shape (n, 2)."""
        best = best_of(list(self.scans)).scan.drive
        return np.column_stack([best.x, best.y])

    @property
    def errors(self) -> Array:
        """Measured error of each scan, m rms on all lines but the first, shape (scans, 2)."""
        return np.array([[done.errors[axis] for axis in AXES] for done in self.scans])

    def save(self, path: Path | str) -> None:
        """Write the correction for ``afm-scan scan --learned``."""
        correction = best_of(list(self.scans)).correction
        save_learned(path_of(path, "learned.npz"), correction, self.model.scanner)


def learn(
    model: Model,
    spec: ScanSpec,
    measure: Measure,
    scans: int = SCANS,
    limits: DriveLimits | None = None,
    progress: ProgressCallback | None = None,
) -> Learned:
    """Repeat a scan, and learn a correction of its reference from the measured errors.

    Parameters
    ----------
    model
        Of x and y; its inverse makes each drive.
    spec
        The scan.
    measure
        Drives the scanner and returns what its sensor measured: V to m, both (n, 2), from rest to
        rest, at ``spec.sample_period``.
    scans
        How many; the first two have no correction, and their difference is taken as noise.
    limits
        The amplifier's voltage and slew; none where None.
    progress
        Is called before each scan with what is being done, text that also has how many scans are
        ``done`` of a ``total``; its ``left(elapsed)`` is the time that the rest takes.

    Returns
    -------
    Learned
        The correction, and the error of each scan.

    Raises
    ------
    InputError
        For fewer than three scans, a model without an axis and a measurement of another shape.
    ScanError
        Where a drive would leave the limits or the identified range.

    Notes
    -----
    The law is iterative learning control with the model's inverse: D. A. Bristow, M. Tharayil and
    A. G. Alleyne, IEEE Control Systems 26 (2006) 96.

    Examples
    --------
    >>> import numpy as np
    >>> import afm_scan_ros as afm
    >>> model, noise = afm.load_model(), np.random.default_rng(1)
    >>> spec = afm.ScanSpec(lines=3, line_rate=30.0, samples_per_line=200, preparation_cycles=2)
    >>> def measure(drive):
    ...     moved = 1.01 * model.predict(drive, spec.sample_period)
    ...     return moved + 2e-9 * noise.standard_normal(moved.shape)
    >>> learned = afm.learn(model, spec, measure, scans=3)
    >>> bool(learned.errors[-1, 0] < 0.1 * learned.errors[0, 0])
    True
    """
    of_type(Model, "model", model, MODEL)
    of_type(ScanSpec, "spec", spec, SPEC)
    of_type(DriveLimits, "limits", limits or UNLIMITED, LIMITS)
    scans = whole("scans", scans, 1)
    session = _Measured(measure, limits or UNLIMITED, progress or (lambda _: None), scans)
    found = list(learning_scans(session, model.scanner, spec, scans, session.limits))
    if not best_of(found).steps:
        LOG.warning("no scan was better than the first two: the correction is zero")
    return Learned(model, tuple(found))


@define
class _Measured:
    """A scanner that a function of the user drives."""

    measure: Measure
    limits: DriveLimits
    progress: ProgressCallback
    scans: int
    done: int = 0

    def scan(self, label: str, spec: ScanSpec, model: ScannerModel, correction: Correction) -> Scan:
        """Scan with all of a model's inverses."""
        period = spec.sample_period
        compensation = Compensation(model, period, INVERSES, InverseSettings(), self.limits)
        drive = compensation.whole(correction.reference())
        self.progress(Step(f"{label}: {len(drive.x)} samples", self.done, self.scans))
        self.done += 1
        measured = samples("measure", self.measure(np.column_stack([drive.x, drive.y])))
        count = total_samples(spec)
        if measured.shape != (count, len(AXES)):
            raise InputError(
                f"measure returned shape {measured.shape}: return ({count}, {len(AXES)}), a"
                " displacement for each drive sample"
            )
        moved = Trace(0, period, measured[:, 0], measured[:, 1])
        return Scan(spec, desired(spec, 0, count), drive, moved)
