"""Effects that the fine steering mirror's base model lacks, each with its competing models.

The base model has three uncoupled axes, identified at 100 mV.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from itertools import combinations_with_replacement

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.measured.mirror.recordings import (
    AMPLITUDES,
    FOLDS,
    REALISATIONS,
    measured,
    percent,
    record,
    squares,
)
from afm_scan_ros.core.effects.amplitude_softening import Softening
from afm_scan_ros.core.effects.effect_type import Actuators, FeedbackElement
from afm_scan_ros.core.effects.maxwell_slip import DriveSlips, ElongationSlips
from afm_scan_ros.core.identification.state_space.feedback import FeedbackModel, fit_feedback
from afm_scan_ros.core.identification.state_space.fit import fit_state_space
from afm_scan_ros.core.identification.state_space.identify import Teaching, actuators_of
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.core.identification.state_space.spectra import in_periods, joined
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

FOLD = FOLDS[0]
STATES = 36
SMALLEST = AMPLITUDES[0]
AXIS_STATES = 12
STATES_TRIED = (12, 20, 28, 36, 44)
THRESHOLDS = (0.15, 0.42, 1.2)
"""Of slips, over the rms of what slips."""
EXTENDED = "softening, both levels, and slips of both"
OUTER = AMPLITUDES[::2]

Simulation = Callable[[int, Array], Array]
"""Amplitude in mV and drive (samples, 3) → output (samples, 3)."""
Errors = Mapping[int, float]
"""Error in % by amplitude in mV."""

COLUMNS = {
    "model": ("", ""),
    "fitted_at": ("fitted at, mV", ""),
    "error_100_percent": ("100 mV", ".2f"),
    "error_200_percent": ("200 mV", ".2f"),
    "error_300_percent": ("300 mV", ".2f"),
    "explained_percent": ("explained", ".1f"),
}
TITLE = (
    "Fine steering mirror (Floren et al., ISMA-USD 2024, pp. 2042-2052, CC BY 4.0)\n"
    f"Simulation error on the held-out realisations {FOLD[0]} and {FOLD[1]},\n"
    f"rms in % of the output's rms; {STATES} states unless stated. Explained: share in % of\n"
    "the residual's power at the amplitudes of the fit. The reference is the row before,\n"
    "and from the one linear model on that model"
)


@frozen
class ModelStep:
    """A model's name, the amplitudes it is fitted at, and its simulation."""

    model: str
    fitted_at: tuple[int, ...]
    simulation: Simulation
    is_base: bool = False


def measure() -> Table:
    """Held-out errors of each step from the base model to the extended one."""
    rows: list[Row] = []
    base: Errors = {}
    for step in (*_at_smallest(), *_at_all()):
        errors = {amplitude: _error(step, amplitude) for amplitude in AMPLITUDES}
        rows.append(_row(step, errors, base))
        base = errors if step.is_base else base
    return Table("fsm_competing", TITLE, COLUMNS, rows)


def _at_smallest() -> Iterator[ModelStep]:
    """Yield three uncoupled axes, then coupled models of growing order."""
    own = (SMALLEST,)
    yield ModelStep(f"three axes, {AXIS_STATES} states each", own, _axes_apart(), is_base=True)
    for states in STATES_TRIED:
        model = _linear(SMALLEST, states)
        yield ModelStep(f"coupled, {states} states", own, _always(model), is_base=True)


def _at_all() -> Iterator[ModelStep]:
    """Yield each competing model of all amplitudes, and last a model of each amplitude."""
    one = fit_state_space(joined(_fitting_data().spectra), STATES)
    yield ModelStep("one linear model", AMPLITUDES, _always(one), is_base=True)
    yield ModelStep("static nonlinearity of the output", AMPLITUDES, _bent(one))
    scales = actuators_of(_linear(AMPLITUDES[1]), _fitting_data())
    for name, elements in _competing_models(scales).items():
        yield ModelStep(name, AMPLITUDES, _always(_extended(elements)))
    yield ModelStep(EXTENDED, OUTER, _always(_extended(_all(scales), OUTER)))
    yield ModelStep("a linear model of each amplitude", AMPLITUDES, _of_each)


def _competing_models(scales: Actuators) -> dict[str, tuple[FeedbackElement, ...]]:
    softened = {
        "softening, level of the decay": (_fleeting(scales),),
        "softening, lasting level": (Softening(scales),),
        "softening, both levels": (Softening(scales), _fleeting(scales)),
    }
    return {
        "z², z³ of the elongation z, in feedback": (Powers(scales),),
        "slips of the drives": (DriveSlips(scales, THRESHOLDS),),
        "slips of the elongations": (ElongationSlips(scales, THRESHOLDS),),
        **softened,
        EXTENDED: _all(scales),
    }


def _all(scales: Actuators) -> tuple[FeedbackElement, ...]:
    slips = DriveSlips(scales, THRESHOLDS), ElongationSlips(scales, THRESHOLDS)
    return Softening(scales), _fleeting(scales), *slips


def _fleeting(scales: Actuators) -> Softening:
    return Softening(scales, scales.decay_time / scales.sample_period)


@frozen
class Powers:
    """Stiffness without memory: square and cube of each elongation."""

    actuators: Actuators

    def added(self, drive: Array, output: Array, run: int) -> Array:  # noqa: ARG002 - feedback's
        """Return the powers: (samples, 2 m)."""
        z = self.actuators.elongations(output)
        return np.hstack([z**2, z**3])


@cache
def _fitting_data(amplitudes: tuple[int, ...] = AMPLITUDES) -> Teaching:
    """All realisations of some amplitudes but the fold's."""
    kept = [record(amplitude, k) for amplitude in amplitudes for k in REALISATIONS if k not in FOLD]
    count = len(kept) // len(amplitudes)
    levels = [list(range(k, k + count)) for k in range(0, len(kept), count)]
    given = kept
    return Teaching.of(in_periods(given), levels)


@cache
def _linear(amplitude: int, states: int = STATES) -> StateSpaceModel:
    return fit_state_space(_fitting_data((amplitude,)).middle, states)


def _extended(
    elements: tuple[FeedbackElement, ...], amplitudes: tuple[int, ...] = AMPLITUDES
) -> FeedbackModel:
    return fit_feedback(_fitting_data(amplitudes).steady(), _linear(amplitudes[1]), elements)


def _error(step: ModelStep, amplitude: int) -> float:
    """Mean over the fold's realisations, %."""
    errors = []
    for k in FOLD:
        drive = measured(amplitude).drive[:, :, k].mean(axis=2)
        errors.append(percent(squares(step.simulation(amplitude, drive), amplitude, k)))
    return float(np.mean(errors))


def _row(step: ModelStep, errors: Errors, base: Errors) -> Row:
    """Return the row of a step; ``explained`` is the share of the power that its base leaves."""
    residual, before = (
        sum(each.get(k, 0.0) ** 2 for k in step.fitted_at) for each in (errors, base)
    )
    return {
        "model": step.model,
        "fitted_at": ", ".join(str(amplitude) for amplitude in step.fitted_at),
        **{f"error_{amplitude}_percent": error for amplitude, error in errors.items()},
        "explained_percent": 100.0 * (1.0 - residual / before) if base else 0.0,
    }


def _always(model: StateSpaceModel | FeedbackModel) -> Simulation:
    """Simulate by one model whatever the amplitude."""
    if isinstance(model, StateSpaceModel):
        return lambda _, drive: model.steady_state(drive)
    return lambda _, drive: model.steady_state(drive[:, :, np.newaxis])[:, :, 0]


def _of_each(amplitude: int, drive: Array) -> Array:
    return _linear(amplitude).steady_state(drive)


def _axes_apart() -> Simulation:
    """Each output by a model of its own input alone."""
    known = _fitting_data((SMALLEST,)).middle
    axes = [
        fit_state_space(
            evolve(known, inputs=known.inputs[:, [k]], outputs=known.outputs[:, [k]]), AXIS_STATES
        )
        for k in range(3)
    ]
    return lambda _, drive: np.concatenate(
        [axis.steady_state(drive[:, [k]]) for k, axis in enumerate(axes)], axis=1
    )


def _bent(model: StateSpaceModel) -> Simulation:
    """Each output a polynomial of what a linear model makes of the three."""
    steady_periods = _fitting_data().steady()
    straight = [model.steady_state(drive) for drive in np.moveaxis(steady_periods.drive, 2, 0)]
    scales = 1.0 / np.linalg.norm(steady_periods.output, axis=(0, 1))
    terms = np.concatenate([products(s) * w for s, w in zip(straight, scales, strict=True)])
    wanted = np.concatenate(
        [o * w for o, w in zip(np.moveaxis(steady_periods.output, 2, 0), scales, strict=True)]
    )
    weights = np.linalg.lstsq(terms, wanted, rcond=None)[0]
    return lambda _, drive: products(model.steady_state(drive)) @ weights


def products(outputs: Array) -> Array:
    """All products of one to three of outputs (samples, 3), in µm: (samples, products)."""
    columns = 1e6 * outputs
    chosen = [c for n in (1, 2, 3) for c in combinations_with_replacement(range(3), n)]
    return np.stack([columns[:, list(c)].prod(axis=1) for c in chosen], axis=1)
