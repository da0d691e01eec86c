"""Records of coupled axes in steady state → a model of n inputs and n outputs.

Its number of states, and the error that it states, are by records which the fit does not see: the
last one of each drive level.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from attrs import frozen
from scipy.stats import f as fisher
from scipy.stats import norm

from afm_scan_ros.core.coupled_scanner import (
    CoupledScanner,
    FeedbackEffect,
    LevelError,
    elements_of,
    valued,
)
from afm_scan_ros.core.effects.effect_type import Actuators
from afm_scan_ros.core.effects.registry import feedback_form
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.state_space.feedback import (
    FeedbackModel,
    SteadyRecords,
    fit_feedback,
)
from afm_scan_ros.core.identification.state_space.fit import COARSE_LINES, fit_state_space, refined
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel, modal_form
from afm_scan_ros.core.identification.state_space.spectra import (
    PeriodicRecords,
    Periods,
    Spectra,
    drive_rms,
    in_periods,
    joined,
    periodic_records,
    power_by_band,
    reliability,
)
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array, ProgressCallback, Step, floats

GROWTH = 1.25
"""From an order to the next that is tried."""
PATIENCE = 2
"""Orders in turn that do not help, after which no further one is tried."""
LEVEL = 0.05
"""Of the test whether one order's squared error is less than another's."""


def order_by_evidence(taught: Spectra, held_out: Spectra, progress: ProgressCallback) -> int:
    """Return the fewest states whose held-out error is not significantly above the least.

    Errors are compared line by line: lines of a random-phase drive are all but independent.
    """
    step = max(1, len(taught.omega) // COARSE_LINES)
    coarse, judge = taught.every(step), held_out.every(step)
    inputs, outputs = taught.inputs.shape[1], taught.outputs.shape[1]
    best, found, since = 0, np.full(len(judge.omega), np.inf), 0
    for order in _orders(max(inputs, outputs)):
        if since == PATIENCE or not _determined(order, coarse):
            break
        progress(f"a structure of {order} states")
        errors = _errors(coarse, judge, order)
        better = _less(errors, found)
        best, found, since = (order, errors, 0) if better else (best, found, since + 1)
    return best


def _orders(channels: int) -> Iterator[int]:
    """Even orders, from two states a channel on."""
    order = 2 * channels
    while True:
        yield order
        order = max(order + 2, 2 * round(GROWTH * order / 2.0))


def _determined(order: int, spectra: Spectra) -> bool:
    """Whether the lines are more than twice the parameters."""
    lines, inputs = spectra.inputs.shape[:2]
    outputs = spectra.outputs.shape[1]
    parameters = order * (inputs + outputs + 1) + inputs * outputs
    return bool(lines * inputs * outputs > 2 * parameters)


def _errors(taught: Spectra, held_out: Spectra, order: int) -> Array:
    """Squared simulation error of each held-out line, (lines,)."""
    model = fit_state_space(taught, order)
    error = model.response(held_out.omega) @ held_out.inputs - held_out.outputs
    return np.asarray(np.sum(np.abs(error) ** 2, axis=(1, 2)))


def _less(errors: Array, than: Array) -> bool:
    """Whether errors (lines,) are significantly less than others."""
    if not np.isfinite(than).all():
        return True
    gain = than - errors
    return bool(gain.mean() > norm.ppf(1.0 - LEVEL) * gain.std(ddof=1) / np.sqrt(len(gain)))


LEVEL_STEP = 1.1
"""Ratio of two drives' rms from which they are two levels."""

AT_REST = 50
"""Part of the lines, one in so many, in which the scanner follows its drives as at rest."""
BANDS = 16
"""Parts of the band in which the error is stated. A diagnosis counts amplitudes, not parts."""
PEAK_SCATTER = 1.25
"""Peaks of drives of one rms differ by so much: those of Gaussian ones rarely by more."""


@frozen
class CoupledSetting:
    """What a user may choose: effects in feedback by name, and states, by evidence where None."""

    effects: tuple[str, ...] = ()
    states: int | None = None


def identify_coupled(
    records: Sequence[Record],
    axes: tuple[str, ...],
    setting: CoupledSetting,
    progress: ProgressCallback,
) -> CoupledScanner:
    """Identify a structure, and the effects named by the ``setting``, from records of all axes.

    Raises InputError where a record is not periodic, records disagree, an effect is unknown, or a
    level has no more records than inputs. Raises ScanError where a simulation does not
    settle, or effects leave more than none does.
    """
    for name in setting.effects:
        feedback_form(name)
    periods = in_periods(records)
    levels = levels_of(records)
    refuse_few(records, levels, periods.drive.shape[1])
    kept, left_out = [level[:-1] for level in levels], [level[-1:] for level in levels]
    taught = Teaching.of(periods, kept)
    judge = Teaching.of(periods, left_out).middle
    order = setting.states or order_by_evidence(taught.middle, judge, progress)
    progress(Step(f"a model of {order} states, without one record of each level", 0, 2))
    trial = _fitted(taught, order, setting.effects)
    errors = tuple(_error(trial.model, periods, level) for level in left_out)
    _refuse_worse(errors, trial, periods, left_out)
    progress(Step(f"a model of {order} states", 1, 2))
    found = _fitted(Teaching.of(periods, levels), order, setting.effects)
    reach = PEAK_SCATTER * float(max(np.abs(record.drive).max() for record in records))
    model = found.model
    return CoupledScanner(
        axes, model.linear, model.band, found.effects, found.actuators, reach, errors
    )


def _refuse_worse(
    errors: Sequence[LevelError], trial: "_Fitted", periods: Periods, left_out: list[list[int]]
) -> None:
    """Raise ScanError where a model with its effects leaves more than one without."""
    plain = FeedbackModel(trial.start, (), trial.model.band)
    without = [_error(plain, periods, level) for level in left_out]
    after, before = (sum(error.relative**2 for error in each) for each in (errors, without))
    if after > before:
        raise ScanError(
            f"{', '.join(effect.name for effect in trial.effects)} with {trial.start.order} states:"
            " leaves more of a held-out record than no effect does: give fewer states, or records"
            " of more realisations"
        )


@frozen(eq=False)
class _Fitted:
    start: StateSpaceModel
    model: FeedbackModel
    effects: tuple[FeedbackEffect, ...]
    actuators: Actuators


def _fitted(taught: "Teaching", order: int, names: tuple[str, ...]) -> _Fitted:
    """Fit all levels: by one linear model where no effect is named."""
    start = fit_state_space(taught.middle, order)
    actuators = actuators_of(start, taught)
    if not names:
        linear = refined(start, joined(taught.spectra))
        return _Fitted(linear, FeedbackModel(linear, (), taught.steady().band), (), actuators)
    effects = valued(names, actuators)
    model = fit_feedback(taught.steady(), start, elements_of(effects, actuators))
    return _Fitted(start, model, effects, actuators)


@frozen(eq=False)
class Teaching:
    """Records that teach: their spectra, weighted, by level."""

    periods: Periods
    levels: list[list[int]]
    spectra: list[Spectra]
    weights: list[Array]

    @classmethod
    def of(cls, periods: Periods, levels: list[list[int]]) -> "Teaching":
        """Return those of some levels, each level counting by its error relative to its output."""
        found = [periodic_records(periods.of(level)) for level in levels]
        weights = [_weight(each) / np.linalg.norm(each.spectra.outputs) for each in found]
        spectra = [each.spectra.weighted(w) for each, w in zip(found, weights, strict=True)]
        return cls(periods, levels, spectra, weights)

    @property
    def middle(self) -> Spectra:
        """Spectra of the level in the middle."""
        return self.spectra[len(self.spectra) // 2]

    def steady(self) -> SteadyRecords:
        """Return the periods, averaged, with their weights."""
        drive, output = self.periods.of([k for level in self.levels for k in level]).mean
        weight = np.concatenate(self.weights, axis=1)
        return SteadyRecords(drive, output, self.periods.used, weight, self.periods.sample_period)


def _weight(records: PeriodicRecords) -> Array:
    """Reliability of records, (lines, records); all alike where they are too few to tell."""
    lines, inputs, count = records.spectra.inputs.shape
    return reliability(records) if count > inputs else np.ones((lines, count))


def levels_of(records: Sequence[Record]) -> list[list[int]]:
    """Records by their drive's rms, from the least; in each level in the order given."""
    order = sorted(range(len(records)), key=lambda k: drive_rms(records[k]))
    levels = [[order[0]]]
    for before, k in pairwise(order):
        if drive_rms(records[k]) > LEVEL_STEP * drive_rms(records[before]):
            levels.append([])
        levels[-1].append(k)
    return [sorted(level) for level in levels]


def refuse_few(records: Sequence[Record], levels: list[list[int]], inputs: int) -> None:
    """Raise InputError for a level that has no more records than there are inputs."""
    for level in levels:
        if len(level) <= inputs:
            names = ", ".join(records[k].name for k in level)
            raise InputError(
                f"{names}: {len(level)} realisations with"
                f" {drive_rms(records[level[0]]):.3g} V rms, of"
                f" {inputs} inputs: record {inputs + 1} or more at each amplitude"
            )


def actuators_of(linear: StateSpaceModel, taught: Teaching) -> Actuators:
    """Scales of drives and elongations in records, whose level in the middle is that of ``linear``.

    The response at rest is that measured at the lowest lines; where it has no inverse, its
    pseudoinverse is taken.
    """
    periods, lowest = taught.periods, max(1, len(taught.middle.omega) // AT_REST)
    at_rest = taught.middle.response()[:lowest].real.mean(axis=0)
    elongation = np.linalg.pinv(at_rest)
    moved = np.einsum("mp,nprk->nmrk", elongation, periods.output)
    scale, drive_scale = (
        np.sqrt(np.mean(signal**2, axis=(0, 2, 3))) for signal in (moved, periods.drive)
    )
    poles, period = modal_form(linear.a, linear.b, linear.c, linear.d).poles, linear.sample_period
    rates = np.log(poles[poles.imag > 0.0]) / period
    frequencies, dampings = np.abs(rates) / (2.0 * np.pi), -rates.real / np.abs(rates)
    decays = 1.0 / (2.0 * np.pi * frequencies * dampings)
    decay = float(np.median(decays)) if len(decays) else period
    return Actuators(drive_scale, elongation / scale[:, np.newaxis], decay, period)


def _error(model: FeedbackModel, periods: Periods, level: list[int]) -> LevelError:
    """Rms over outputs, records and samples of what the simulation leaves, of the periods' mean."""
    drive, output = periods.of(level).mean
    output = output - output.mean(axis=0)
    left = model.steady_state(drive) - output
    rms, error, moved = (float(np.sqrt(np.mean(each**2))) for each in (drive, left, output))
    lost, whole = (
        power_by_band(each, model.band, BANDS, periods.sample_period).sum(axis=(1, 2))
        for each in (left, output)
    )
    return LevelError(rms, error, moved, floats(np.sqrt(lost / whole)))


CHANCE = 1e-3
"""Probability that an axis without coupling passes for a coupled one."""


def coupling_is_seen(records: Sequence[Record]) -> bool:
    """Whether an axis follows all drives better than its own alone, by an F test.

    False where the records cannot tell: they are no multisines in steady state, or of fewer
    realisations than the drives and one more.
    """
    try:
        periods = in_periods(records)
    except InputError:
        return False
    levels = levels_of(records)
    inputs, outputs = periods.drive.shape[1], periods.output.shape[1]
    if inputs != outputs or min(map(len, levels)) <= inputs:
        return False
    spectra = periodic_records(periods.of(levels[-1])).spectra
    return any(_follows_others(spectra, axis) for axis in range(outputs))


def _follows_others(spectra: Spectra, axis: int) -> bool:
    lines, inputs, count = spectra.inputs.shape
    own, moved = spectra.inputs[:, axis], spectra.outputs[:, axis]
    gain = np.sum(moved * own.conj(), axis=1) / np.sum(np.abs(own) ** 2, axis=1)
    together = spectra.response()[:, [axis]] @ spectra.inputs
    alone, left = (
        float(np.sum(np.abs(moved - expected) ** 2))
        for expected in (gain[:, np.newaxis] * own, together[:, 0])
    )
    more, spare = 2 * lines * (inputs - 1), 2 * lines * (count - inputs)
    return bool((alone - left) / more > fisher.isf(CHANCE, more, spare) * left / spare)
