"""The response of a sampled system at the lines of a record, and how far it is known there."""

from functools import cached_property

import numpy as np
from attrs import define, evolve
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.vibration.spectra import Complex, LineResponses
from afm_scan_ros.core.types import Array

NEIGHBOURS = 9
"""Lines over which the scatter is averaged, as few waves know it badly at each."""

LOCAL = 33
"""Lines over which distortion is taken from the fourth differences."""
FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
CHANCE = 3.0
"""-ln 0.05: of noise alone, |N|² over its mean exceeds this in 5 % of lines."""


@define(frozen=True, eq=False, slots=False)
class FrequencyResponse:
    """Response of the sampled system, shape (lines,): ``omega`` in rad/s, ``response`` complex.

    ``noise`` is the response's standard deviation from period to period (sensor), ``scatter``
    that from wave to wave (sensor and what the input model does not explain), both of the mean.
    ``coherence`` is the share of the output's power that the input explains, period by period.
    ``distortion`` is the third harmonic of a sweep that it does not, over the fundamental.
    """

    omega: Array
    response: Complex
    noise: Array
    scatter: Array
    coherence: Array
    distortion: float = 0.0

    @classmethod
    def between(cls, matrix: LineResponses, output: int, given: int) -> "FrequencyResponse":
        """One entry of a matrix of responses."""
        return cls(
            matrix.omega,
            matrix.response[:, output, given],
            matrix.noise[:, output, given],
            matrix.scatter[:, output, given],
            matrix.coherence[:, output],
        )

    @property
    def frequency(self) -> Array:
        """Lines in Hz."""
        return np.asarray(self.omega / (2.0 * np.pi))

    @property
    def nonlinearity(self) -> Array:
        """Standard deviation from wave to wave beyond that from period to period."""
        return np.asarray(np.sqrt(np.maximum(self.scatter**2 - self.noise**2, 0.0)))

    @cached_property
    def deviation(self) -> Array:
        """Expected size of the response's error: noise and nonlinearity of neighbouring lines.

        The noise hardly changes from line to line, the nonlinearity as the response does.
        """
        noise, size = self.noise**2, np.abs(self.response) ** 2
        beyond = smooth((self.scatter**2 - noise) / size)
        return np.asarray(np.sqrt(smooth(noise) + size * np.maximum(beyond, 0.0)))

    @property
    def noise_share(self) -> float:
        """Noise over response, rms over the lines."""
        return float(np.sqrt(np.mean((self.noise / np.abs(self.response)) ** 2)))

    @property
    def nonlinearity_share(self) -> float:
        """Scatter beyond the noise over response, rms over the lines."""
        beyond = np.mean((self.scatter**2 - self.noise**2) / np.abs(self.response) ** 2)
        return float(np.sqrt(max(beyond, 0.0)))

    def with_distortion(self) -> "FrequencyResponse":
        """The response of one wave, its scatter that from line to line.

        Distortion by one wave repeats from period to period, but is unlike at neighbouring lines,
        where the response is smooth (Pintelon and Schoukens, 2012, section 4.3). It is taken from
        the fourth differences, relative to the response. Their median over ``LOCAL`` lines leaves
        out a resonance too sharp for them; |N|² of noise has the median ln 2 times its mean.
        """
        if len(self.omega) < LOCAL:
            return self
        bend = np.convolve(self.response, FOURTH, "valid") / np.linalg.norm(FOURTH)
        relative = np.abs(bend / self.response[2:-2]) ** 2
        level = median_filter(np.pad(relative, 2, mode="edge"), LOCAL, mode="nearest") / np.log(2.0)
        return evolve(self, scatter=np.maximum(self.noise, np.sqrt(level) * np.abs(self.response)))

    def up_to(self, highest: float) -> "FrequencyResponse":
        """The lines up to ``highest`` Hz."""
        return self.at(self.omega <= 2.0 * np.pi * highest)

    def seen(self) -> "FrequencyResponse":
        """The lines up to the last about which most stand out of the noise.

        A line stands out where chance alone would make it so large in one case of twenty. Raises
        InputError where none does.
        """
        stands_out = np.abs(self.response) ** 2 > CHANCE * self.deviation**2
        most = 2.0 * uniform_filter1d(stands_out.astype(np.float64), NEIGHBOURS) > 1.0
        if not most.any():
            raise InputError(
                "frequency record: no line of the response stands out of the noise; drive with"
                " more amplitude, or longer"
            )
        return self.at(np.arange(len(most)) <= np.flatnonzero(most)[-1])

    def advanced(self, delay: float) -> "FrequencyResponse":
        """The response as it were without a ``delay`` in s."""
        return evolve(self, response=self.response * np.exp(1j * self.omega * delay))

    def at(self, lines: NDArray[np.bool_]) -> "FrequencyResponse":
        """The lines chosen by a mask, shape (lines,)."""
        return evolve(
            self,
            omega=self.omega[lines],
            response=self.response[lines],
            noise=self.noise[lines],
            scatter=self.scatter[lines],
            coherence=self.coherence[lines],
        )


def smooth(variance: Array) -> Array:
    """Mean over neighbouring lines, (lines,)."""
    return np.asarray(uniform_filter1d(variance, NEIGHBOURS, mode="nearest"))
