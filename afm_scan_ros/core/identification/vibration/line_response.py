"""The response of a sampled system at the lines of a record, and how far it is known there."""

from functools import cached_property

import numpy as np
from attrs import define, evolve
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.vibration.spectra import Complex, LineResponses
from afm_scan_ros.core.types import Array

NEIGHBOURS = 9
"""Lines over which the scatter is averaged, as few waves know it badly at each."""

CHANCE = 3.0
"""-ln 0.05: of noise alone, |N|² over its mean exceeds this in 5 % of lines."""


@define(frozen=True, eq=False, slots=False)
class FrequencyResponse:
    """Response of the sampled system, shape (lines,): ``omega`` in rad/s, ``response`` complex.

    ``noise`` is the response's standard deviation from period to period (sensor), ``scatter``
    that from wave to wave (sensor and what the input model does not explain), both of the mean.
    ``coherence`` is the share of the output's power that the input explains, period by period.
    """

    omega: Array
    response: Complex
    noise: Array
    scatter: Array
    coherence: Array

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
        beyond = _smooth((self.scatter**2 - noise) / size)
        return np.asarray(np.sqrt(_smooth(noise) + size * np.maximum(beyond, 0.0)))

    @property
    def noise_share(self) -> float:
        """Noise over response, rms over the lines."""
        return float(np.sqrt(np.mean((self.noise / np.abs(self.response)) ** 2)))

    @property
    def nonlinearity_share(self) -> float:
        """Scatter beyond the noise over response, rms over the lines."""
        beyond = np.mean((self.scatter**2 - self.noise**2) / np.abs(self.response) ** 2)
        return float(np.sqrt(max(beyond, 0.0)))

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
        return FrequencyResponse(
            self.omega[lines],
            self.response[lines],
            self.noise[lines],
            self.scatter[lines],
            self.coherence[lines],
        )


def _smooth(variance: Array) -> Array:
    return np.asarray(uniform_filter1d(variance, NEIGHBOURS, mode="nearest"))
