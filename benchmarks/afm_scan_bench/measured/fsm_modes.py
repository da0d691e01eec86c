"""How the fine steering mirror's modes move with the amplitude of the drive."""

import numpy as np
from attrs import frozen
from scipy.stats import t

from afm_scan_bench.measured.mirror.figure import fitted
from afm_scan_bench.measured.mirror.recordings import AMPLITUDES, REALISATIONS
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel, modal_form
from afm_scan_ros.core.types import Array, Complex
from afm_scan_ros.report.table import Table

RESONANT = 0.1
"""Damping ratio below which a pair of poles is called a mode."""
NEAR = 0.02
"""Relative change of frequency within which a mode is looked for again."""

COLUMNS = {
    "frequency_100_hz": ("100 mV", ".1f"),
    "frequency_200_hz": ("200 mV", ".1f"),
    "frequency_300_hz": ("300 mV", ".1f"),
    "interval_hz": ("±", ".2f"),
    "change_percent": ("%", "+.2f"),
    "damping_100_percent": ("100 mV", ".2f"),
    "damping_200_percent": ("200 mV", ".2f"),
    "damping_300_percent": ("300 mV", ".2f"),
    "damping_interval_percent": ("±", ".2f"),
}


@frozen(eq=False)
class ShapedMode:
    """A vibration: ``frequency`` in Hz, at which it would swing undamped, and damping ratio.

    ``left`` (p,) and ``right`` (m,): how it shows in the outputs and is driven, of length 1.
    """

    frequency: float
    damping: float
    left: Complex
    right: Complex

    def likeness(self, other: "ShapedMode") -> float:
        """1 where both have the same shape in inputs and outputs, 0 where they share nothing."""
        shapes = np.vdot(self.left, other.left) * np.vdot(self.right, other.right)
        return float(np.abs(shapes))


def modes(model: StateSpaceModel) -> tuple[ShapedMode, ...]:
    """Return the vibrations, from the slowest: one for each pair of complex poles."""
    form = modal_form(model.a, model.b, model.c, model.d)
    rates = np.log(form.poles) / model.sample_period
    lefts, rights = (
        shape / np.linalg.norm(shape, axis=1, keepdims=True) for shape in (form.left, form.right)
    )
    return tuple(
        ShapedMode(
            float(np.abs(rate) / (2.0 * np.pi)), float(-rate.real / np.abs(rate)), left, right
        )
        for rate, left, right in sorted(
            zip(rates, lefts, rights, strict=True), key=lambda term: float(np.abs(term[0]))
        )
        if 0.0 < rate.imag * model.sample_period < np.pi
    )


@frozen(eq=False)
class Found:
    """A mode at one amplitude: [frequency in Hz, damping ratio], and its 95 % half-widths."""

    value: Array
    half_width: Array


def measure() -> Table:
    """Modes of the models fitted to all six realisations, found again at each amplitude."""
    largest = [mode for mode in modes(fitted(AMPLITUDES[-1])) if mode.damping < RESONANT]
    rows = [_row({k: found(mode, k) for k in AMPLITUDES}) for mode in largest]
    falling = sum(row["change_percent"] + row["change_interval_percent"] < 0.0 for row in rows)
    title = (
        "Fine steering mirror (Floren et al., ISMA-USD 2024, pp. 2042-2052, CC BY 4.0)\n"
        "Modes at three amplitudes: frequency in Hz, its widest 95 % interval and its\n"
        f"change from 100 to 300 mV; damping ratio in %; {falling} of {len(rows)} certainly fall"
    )
    return Table("fsm_modes", title, COLUMNS, rows)


def found(mode: ShapedMode, amplitude: int) -> Found:
    """Find a mode again at an amplitude; the interval is the jackknife's over realisations."""
    own = alike(mode, fitted(amplitude))
    others = [alike(own, fitted(amplitude, k)) for k in REALISATIONS]
    values = np.array([[other.frequency, other.damping] for other in others])
    count = len(values)
    error = np.sqrt((count - 1) * values.var(axis=0))
    return Found(np.array([own.frequency, own.damping]), t.ppf(0.975, count - 1) * error)


def alike(mode: ShapedMode, model: StateSpaceModel) -> ShapedMode:
    """Return the model's mode of the most similar shape among those near in frequency."""
    near = [other for other in modes(model) if abs(other.frequency / mode.frequency - 1.0) < NEAR]
    return max(near, key=mode.likeness)


def _row(by_amplitude: dict[int, Found]) -> dict[str, float]:
    first, last = by_amplitude[AMPLITUDES[0]], by_amplitude[AMPLITUDES[-1]]
    width = np.hypot(first.half_width[0], last.half_width[0])
    half_widths = np.array([one.half_width for one in by_amplitude.values()]).max(axis=0)
    return {
        **{f"frequency_{k}_hz": float(one.value[0]) for k, one in by_amplitude.items()},
        **{f"damping_{k}_percent": float(100.0 * one.value[1]) for k, one in by_amplitude.items()},
        "interval_hz": float(half_widths[0]),
        "damping_interval_percent": float(100.0 * half_widths[1]),
        "change_percent": float(100.0 * (last.value[0] / first.value[0] - 1.0)),
        "change_interval_percent": float(100.0 * width / first.value[0]),
    }
