"""Effects that the fine steering mirror's base model lacks, each with its competing models.

The base model has three uncoupled axes, identified at 100 mV.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import combinations_with_replacement

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.measured.mirror.extended_fits import (
    FOLDS,
    REFERENCE,
    STATES,
    THRESHOLDS,
    elongation,
    extended,
    extended_by,
    linear,
    linear_of_all,
    percent,
    periods,
    simulated,
    spectra,
    squared,
    steady_records,
)
from afm_scan_bench.measured.mirror.fits import AMPLITUDES, SAMPLE_PERIOD
from afm_scan_ros.core.identification.state_space.elements import (
    FeedbackElement,
    Powers,
    Slips,
    Softening,
)
from afm_scan_ros.core.identification.state_space.feedback import FeedbackModel
from afm_scan_ros.core.identification.state_space.fit import fit_state_space
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

FOLD = FOLDS[0]
SMALLEST = AMPLITUDES[0]
AXIS_STATES = 12
STATES_TRIED = (12, 20, 28, 36, 44)
MEMORIES = (0.01, 0.1)
"""Of the softening, s; without end otherwise."""
EXTENDED = "softening, lasting level, and slips at the inputs"
OUTER = AMPLITUDES[::2]
ELONGATION_THRESHOLDS = (0.06, 0.2, 0.6)
"""Of slips on the elongation, V: as those at the inputs, in proportion to its larger rms."""

Simulation = Callable[[int, Array], Array]
"""Amplitude in mV and drives (samples, 3, records) → outputs (samples, 3, records)."""
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
        model = linear(SMALLEST, FOLD, states)
        yield ModelStep(f"coupled, {states} states", own, _always(model), is_base=True)


def _at_all() -> Iterator[ModelStep]:
    """Yield each competing model of all amplitudes, and last a model of each amplitude."""
    outer = (Softening(elongation(FOLD, OUTER[1]), REFERENCE), Slips(THRESHOLDS))
    one = linear_of_all(FOLD)
    yield ModelStep("one linear model", AMPLITUDES, _always(one), is_base=True)
    yield ModelStep("static nonlinearity of the output", AMPLITUDES, _bent(one))
    for name, elements in _competing_models().items():
        yield ModelStep(name, AMPLITUDES, _always(extended_by(elements, FOLD)))
    yield ModelStep(EXTENDED, AMPLITUDES, _always(extended(FOLD)))
    yield ModelStep(EXTENDED, OUTER, _always(extended_by(outer, FOLD, OUTER)))
    yield ModelStep("a linear model of each amplitude", AMPLITUDES, _of_each)


def _competing_models() -> dict[str, tuple[FeedbackElement, ...]]:
    z = elongation(FOLD)
    fleeting = {
        f"softening, level of {memory:g} s": (Softening(z, REFERENCE, memory / SAMPLE_PERIOD),)
        for memory in MEMORIES
    }
    return {
        "z², z³ of the elongation z, in feedback": (Powers((2, 3), z),),
        "slips at the inputs": (Slips(THRESHOLDS),),
        "slips on the elongation, in feedback": (Slips(ELONGATION_THRESHOLDS, z),),
        **fleeting,
        "softening, lasting level": (Softening(z, REFERENCE),),
    }


def _error(step: ModelStep, amplitude: int) -> float:
    drive, output = periods(amplitude, list(FOLD))
    return percent(squared(step.simulation(amplitude, drive), output))


def _row(step: ModelStep, errors: Errors, base: Errors) -> Row:
    """Return the row of a step; ``explained`` is the share of the power that its base leaves."""
    left, before = (sum(each.get(k, 0.0) ** 2 for k in step.fitted_at) for each in (errors, base))
    return {
        "model": step.model,
        "fitted_at": ", ".join(str(amplitude) for amplitude in step.fitted_at),
        **{f"error_{amplitude}_percent": error for amplitude, error in errors.items()},
        "explained_percent": 100.0 * (1.0 - left / before) if base else 0.0,
    }


def _always(model: StateSpaceModel | FeedbackModel) -> Simulation:
    """Simulate by one model whatever the amplitude."""
    return lambda _, drive: simulated(model, drive)


def _of_each(amplitude: int, drive: Array) -> Array:
    return simulated(linear(amplitude, FOLD), drive)


def _axes_apart() -> Simulation:
    """Each output by a model of its own input alone."""
    known = spectra(SMALLEST, FOLD)
    axes = [
        fit_state_space(
            evolve(known, inputs=known.inputs[:, [k]], outputs=known.outputs[:, [k]]), AXIS_STATES
        )
        for k in range(3)
    ]
    return lambda _, drive: np.concatenate(
        [simulated(axis, drive[:, [k]]) for k, axis in enumerate(axes)], axis=1
    )


def _bent(model: StateSpaceModel) -> Simulation:
    """Each output a polynomial of what a linear model makes of the three."""
    fitted = steady_records(FOLD)
    terms = products(simulated(model, fitted.drive))
    scale = np.repeat(1.0 / np.linalg.norm(fitted.output, axis=(0, 1)), len(fitted.output))
    wanted = np.moveaxis(fitted.output, 1, 2).reshape(-1, 3, order="F") * scale[:, np.newaxis]
    weights = np.linalg.lstsq(terms * scale[:, np.newaxis], wanted, rcond=None)[0]

    def simulation(_: int, drive: Array) -> Array:
        straight = simulated(model, drive)
        bent = products(straight) @ weights
        return np.moveaxis(bent.reshape(len(drive), -1, 3, order="F"), 2, 1)

    return simulation


def products(outputs: Array) -> Array:
    """All products of one to three outputs, in µm: (samples * records, products)."""
    columns = 1e6 * np.moveaxis(outputs, 1, 2).reshape(-1, 3, order="F")
    chosen = [c for n in (1, 2, 3) for c in combinations_with_replacement(range(3), n)]
    return np.stack([columns[:, list(c)].prod(axis=1) for c in chosen], axis=1)
