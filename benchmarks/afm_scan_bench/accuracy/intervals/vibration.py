"""How often the true resonance, damping and gain lie within their 95 % intervals.

The simulated dynamics alone, without hysteresis, modes or creep, are driven by the multisines of
the frequency record, sampled less often; only the sensor's noise differs from seed to seed.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from attrs import evolve

from afm_scan_bench.scans import default_plant
from afm_scan_ros.core.identification.drives.waveforms import Multisine, whole
from afm_scan_ros.core.identification.vibration.frequency_response import frequency_response
from afm_scan_ros.core.identification.vibration.rational_fit import fit_rational
from afm_scan_ros.core.least_squares import Interval
from afm_scan_ros.report.table import Row
from afm_scan_ros.simulation.axis import AxisSpec, Dynamics, RationalSpec

SAMPLE_RATE = 10e3
PERIOD = 5000  # samples: a line every 2 Hz
PEAK = 0.5  # V
NOISE = 20e-9  # m
UNITS = ("Hz", "", "m/V")


def coverage(seeds: Iterable[int]) -> list[Row]:
    """Share of seeds whose 95 % interval holds the truth, a row for each parameter."""
    axis = evolve(default_plant().x, modes=(), creep=RationalSpec((1.0,), (1.0,)))
    truth = true_figures(axis, default_plant().sensor_sensitivity)
    intervals = np.array(list(_intervals(axis, truth["gain"], seeds)))
    return [
        {
            "effect": "vibration",
            "parameter": name,
            "unit": unit,
            "true": true,
            "seeds": len(found),
            "half_width": float(np.mean(found[:, 1] - found[:, 0]) / 2.0),
            "inside_percent": 100.0 * float(np.mean((found[:, 0] <= true) & (true <= found[:, 1]))),
        }
        for (name, true), unit, found in zip(
            truth.items(), UNITS, intervals.swapaxes(0, 1), strict=True
        )
    ]


def multisines() -> Multisine:
    """Four draws of the phases, lines to 1 kHz, falling as 1/f from 200 Hz."""
    rng = np.random.default_rng(0)
    lines = np.arange(2, 501)
    spectrum = np.zeros((4, PERIOD // 2 + 1), dtype=np.complex128)
    phases = np.exp(2j * np.pi * rng.random((4, len(lines))))
    spectrum[:, lines] = np.minimum(1.0, 100.0 / lines) * phases
    waves = np.fft.irfft(spectrum, PERIOD)
    waves *= PEAK / np.abs(waves).max(axis=1, keepdims=True)
    return Multisine(1.0 / SAMPLE_RATE, waves, repeats=5)


def true_figures(axis: AxisSpec, sensitivity: float) -> dict[str, float]:
    """Resonance (Hz), its damping ratio and G(0) (m/V) of the simulated vibration's polynomials."""
    numerator, denominator = axis.vibration.numerator, axis.vibration.denominator
    poles = np.roots(denominator)
    least = poles[np.argmin(-poles.real / np.abs(poles))]
    return {
        "resonance": float(np.abs(least) / (2.0 * np.pi)),
        "damping": float(-least.real / np.abs(least)),
        "gain": sensitivity * numerator[-1] / denominator[-1],
    }


def _intervals(axis: AxisSpec, gauge: float, seeds: Iterable[int]) -> Iterator[list[Interval]]:
    """Intervals of the three figures, seed by seed."""
    dynamics, plan = Dynamics.from_spec(axis, default_plant().sensor_sensitivity), multisines()
    drive = whole(plan)
    clean = dynamics.apply(dynamics.at_rest(), drive, plan.sample_period)[1]
    for seed in seeds:
        measured = clean + NOISE * np.random.default_rng(seed).standard_normal(len(clean))
        response = frequency_response(drive, drive, measured, plan.sample_period)
        fit = fit_rational(response.seen(), plan.sample_period, gauge)
        low, high = fit.gain_interval
        yield [fit.resonance_interval, fit.damping_interval, (gauge * low, gauge * high)]
