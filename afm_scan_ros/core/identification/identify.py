"""Records of a scanner → the model of each axis, by one fit of all that there are of it."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from attrs import frozen

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.fitted_axis import FittedAxis, identify_axis
from afm_scan_ros.core.identification.records.recording import checked
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES, ProgressCallback, Step


@frozen(eq=False)
class Identification:
    """The identified scanner, by axis."""

    axes: Mapping[str, FittedAxis]

    @property
    def model(self) -> ScannerModel:
        """The model of all axes."""
        return ScannerModel(**{name: axis.model for name, axis in self.axes.items()})


def identify_records(
    records: Sequence[Record],
    progress: ProgressCallback = lambda _: None,
    *,
    linear: bool = False,
) -> Identification:
    """Identify each axis from whatever records of it there are, of any number and kinds.

    A ``linear`` scanner has no hysteresis. Those of the kind "validation" are held out and give the
    model's error. What the others do not identify is unknown in the model. Raises InputError where
    records are not of one scanner or show nothing, ScanError where a fit diverges.
    """
    axes: dict[str, FittedAxis] = {}
    given = [checked(record) for record in records]
    present = [axis for axis in AXES if any(axis in record.axes for record in given)]
    for axis in present:
        of_axis = [record.axis(axis) for record in given if axis in record.axes]
        counted = _counted(progress, axis, len(axes), len(present))
        with _naming(axis):
            axes[axis] = identify_axis(of_axis, axis, counted, linear=linear)
    return Identification(axes)


def _counted(progress: ProgressCallback, axis: str, done: int, total: int) -> ProgressCallback:
    """Name the axis in each message, and count the axes that are over."""
    return lambda message: progress(Step(f"{axis}: {message}", done, total))


@contextmanager
def _naming(axis: str) -> Iterator[None]:
    """Begin what is raised by the axis' name."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{axis}: {error}") from error
    except ScanError as error:
        raise ScanError(f"{axis}: {error}") from error
