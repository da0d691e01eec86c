"""Published laws of iterative learning, on a drive that begins as our feedforward does.

``p_type``: u + k e / g, with g the static gain (S. Arimoto, S. Kawamura and F. Miyazaki, J. Robotic
Systems 1 (1984) 123). ``eiic``: U + rho E / G, with G the linear model, below a corner frequency
(K. Kim, Q. Zou and C. Su, J. Dyn. Sys. Meas. Control 130 (2008) 051005). ``miic``: U Yd / Y, which
needs no model (K. Kim and Q. Zou, IEEE/ASME Trans. Mechatronics 18 (2013) 1767). Each law is given
here as its authors state its principle; corner and gain are those that serve it best.
"""

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from attrs import frozen

from afm_scan_bench.learning.repeated import RepeatingScanner
from afm_scan_bench.scans import default_model
from afm_scan_ros.core.comparison import rms_of
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.effects.vibration import first_resonance
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.features.learning.resonance_shift import ScanSpectra, Spectrum
from afm_scan_ros.simulation.scanner import PlantSpec

SHARES = (0.25, 0.5, 1.0)
"""Gains that are tried, over the inverse of the model's."""
CORNERS = (0.5, 1.0, 2.0)
"""Corner frequencies that are tried, over the first resonance."""
WEAKEST = 1e-3
"""Amplitude over its largest below which a frequency counts as not desired."""
Law: TypeAlias = Callable[["Axis", Array, Array], Array]


@frozen(eq=False)
class Axis:
    """What a law knows of an axis: its spectra, its response (m/V) and its desired displacement."""

    spectra: ScanSpectra
    gain: Spectrum
    resonance: float
    desired: Array

    @classmethod
    def of(cls, spec: ScanSpec, name: str, desired: Array) -> "Axis":
        """Take the default model's linear response."""
        vibration = default_model().axis(name).vibration
        spectra = ScanSpectra.of_scan(spec)
        gain = vibration.response(2.0 * np.pi * spectra.frequencies)
        return cls(spectra, gain, first_resonance(vibration).omega / (2.0 * np.pi), desired)

    def error(self, measured: Array) -> Spectrum:
        """Spectrum of the error on the lines."""
        return self.spectra.of(self.spectra.share * (self.desired - measured))

    def below(self, corner: float) -> Array:
        """One below a corner frequency over the first resonance, zero above it."""
        return np.asarray((self.spectra.frequencies <= corner * self.resonance).astype(float))


def p_type(share: float) -> Law:
    """Return the law with a gain over the inverse of the static gain."""

    def change(axis: Axis, _: Array, measured: Array) -> Array:
        error = axis.spectra.share * (axis.desired - measured)
        return np.asarray(share * error / np.abs(axis.gain[0]))

    return change


def eiic(share: float, corner: float) -> Law:
    """Return the law with one gain rho below a corner."""

    def change(axis: Axis, _: Array, measured: Array) -> Array:
        return axis.spectra.correction(
            share * axis.below(corner) * axis.error(measured) / axis.gain
        )

    return change


def miic(corner: float) -> Law:
    """Return the law below a corner, at the frequencies that are desired."""

    def change(axis: Axis, drive: Array, measured: Array) -> Array:
        used = axis.spectra.share
        wanted, found = (axis.spectra.of(used * each) for each in (axis.desired, measured))
        largest = WEAKEST * np.abs(wanted).max()
        both = (np.abs(wanted) > largest) & (np.abs(found) > largest) & (axis.below(corner) > 0.0)
        ratio = np.divide(wanted, found, out=np.ones_like(wanted), where=both)
        return axis.spectra.correction(axis.spectra.of(used * drive) * (ratio - 1.0))

    return change


LAWS: dict[str, Sequence[Law]] = {
    "P-type": [p_type(share) for share in SHARES],
    "EIIC": [eiic(share, corner) for share in SHARES for corner in CORNERS],
    "MIIC": [miic(corner) for corner in CORNERS],
}
"""Each law in all its settings; the best by the measured error of x is the one that is shown."""


def best_learned(
    spec: ScanSpec, plant: PlantSpec, laws: Sequence[Law], scans: int, seed: int
) -> list[Scan]:
    """Repeat a scan by each of a law's settings; return the scans of the best one."""
    courses = [learned(spec, plant, law, scans, seed) for law in laws]
    return min(courses, key=lambda course: min(_error(done) for done in course))


def learned(spec: ScanSpec, plant: PlantSpec, law: Law, scans: int, seed: int) -> list[Scan]:
    """Repeat a scan by a law; it ends early where drive or sensor would leave its limits."""
    scanner, limits = RepeatingScanner(plant, seed), plant.amplifier.limits
    drive = scanner.drive(spec, default_model(), Correction.none(spec))
    course = [scanner.driven(spec, drive)]
    axes = {name: Axis.of(spec, name, course[0].desired.axis(name)) for name in AXES}
    while len(course) < scans:
        last = course[-1]
        new = {
            name: last.drive.axis(name) + law(axis, last.drive.axis(name), last.measured.axis(name))
            for name, axis in axes.items()
        }
        drive = Trace(0, spec.sample_period, **new)
        try:
            limits.refuse_beyond(drive, dict.fromkeys(AXES, 0.0))
            course.append(scanner.driven(spec, drive))
        except ScanError:
            break
    return course


def _error(done: Scan) -> float:
    return rms_of(done.tracking("measured"), "x")
