"""Checks of what a user gives, and of fits to it, with errors that say what to give instead."""

from collections.abc import Iterable, Sequence
from numbers import Integral, Real
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

Kind = TypeVar("Kind")

MODEL = "a model, as afm.load_model(path)"
RECORDS = "a list of records, as [afm.read_record(path)]"
IMAGE = "an image, as afm.read_image(path)"
IMAGES = "a list of images, as [afm.read_image(path)]"
SPEC = "a scan, as afm.ScanSpec(range_x=10e-6)"
LIMITS = "limits, as afm.DriveLimits(10.0, 1e5)"


def of_type(kind: type[Kind], name: str, given: object, fix: str) -> Kind:
    """Return an argument; raises InputError, with the ``fix``, where it is of another type."""
    if not isinstance(given, kind):
        raise InputError(f"{name} is of type {type(given).__name__}: give {fix}")
    return given


def all_of_type(kind: type[Kind], name: str, given: Iterable[Kind], fix: str) -> tuple[Kind, ...]:
    """Return all that an argument holds; raises InputError where anything is of another type."""
    if not isinstance(given, Iterable) or isinstance(given, str):
        raise InputError(f"{name} is of type {type(given).__name__}: give {fix}")
    return tuple(of_type(kind, f"{name}[{k}]", each, fix) for k, each in enumerate(given))


def samples(what: str, given: ArrayLike) -> Array:
    """Return numbers (n,) or (n, channels) as the latter; an InputError names ``what`` is wrong."""
    try:
        array = np.asarray(given)
    except ValueError as error:
        raise InputError(f"{what} is no array: {error}") from error
    refuse_masked(what, given)
    if array.dtype.kind not in "fiu":
        raise InputError(f"{what} is of type {array.dtype}: give real numbers, as float64")
    if array.ndim not in (1, 2) or not array.size:
        raise InputError(f"{what} has shape {array.shape}: give (n,) or (n, channels)")
    values = np.asfortranarray(array.reshape(len(array), -1), dtype=np.float64)
    wrong = np.argwhere(~np.isfinite(values))
    if len(wrong):
        sample, channel = wrong[0]
        raise InputError(
            f"{what} is {values[sample, channel]} at sample {sample}, channel {channel}: give"
            " finite numbers"
        )
    return values


def refuse_masked(what: str, given: ArrayLike) -> None:
    """Raise InputError for a masked array that lacks a value: what lies under a mask is none."""
    if np.ma.is_masked(given):
        place = tuple(int(k) for k in np.argwhere(np.ma.getmaskarray(np.ma.asarray(given)))[0])
        raise InputError(
            f"{what} is masked at {place[0] if len(place) == 1 else place}: give the part without"
            " gaps, or fill them"
        )


def positive(name: str, given: object, fix: str) -> float:
    """Return a number; raises InputError, with the ``fix``, unless it is finite and positive."""
    number = np.asarray(given if isinstance(given, Real | np.ndarray) else np.nan)
    if number.ndim or number.dtype.kind not in "fiu" or not 0.0 < number < np.inf:
        raise InputError(f"{name} is {given!r}: give a positive number, {fix}")
    return float(number)


def whole(name: str, given: object, least: int) -> int:
    """Return a whole number; raises InputError for any other, and for one below the least."""
    if isinstance(given, bool) or not isinstance(given, Integral) or given < least:
        raise InputError(f"{name} is {given!r}: give a whole number, {least} or more")
    return int(given)


def period_of(given: float) -> float:
    """Return a sample period in s; raises InputError unless it is finite and positive."""
    return positive("sample_period", given, "in s, as 1e-5")


def axes_of(given: Sequence[str]) -> tuple[str, ...]:
    """Return names of axes; raises InputError for none, one given twice, and what is no name."""
    axes = all_of_type(str, "axes", given, "names of axes, as ('x', 'y')")
    for name in axes:
        if axes.count(name) > 1:
            raise InputError(f"axes names {name!r} twice: name each channel's own axis")
    if not axes:
        raise InputError("axes is empty: name the axis of each channel, as ('x',)")
    return axes


def refuse_other_count(what: str, values: Array, axes: Sequence[str]) -> None:
    """Raise InputError unless values (n, channels) have one channel for each axis."""
    channels = values.shape[1]
    if channels != len(axes):
        raise InputError(
            f"{what} has {channels} channel{'s' * (channels > 1)}, but the axes are"
            f" {', '.join(axes)}: give shape (n, {len(axes)})"
        )


def require_converged(found: "OptimizeResult", what: str) -> Array:
    """Return what ``least_squares`` found; raises ScanError where it has not converged."""
    if not found.success:
        raise ScanError(
            f"{what}: the fit has not converged after {found.nfev} evaluations: see that drive and"
            " displacement of the record belong together, or record it longer"
        )
    parameters: Array = found.x
    return parameters
