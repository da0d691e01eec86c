"""How a drive runs between its samples: held by a converter, or measured behind a filter.

A converter holds each voltage until the next update. A drive that was measured is band-limited
instead: an anti-aliasing filter stands before the recorder. Of such a drive v the model is given
m times as many held voltages u, of which the part below half the sample rate is v itself:

    U(f) = V(f) e^{jπfh} / sinc(fh),    h = T / m,

since a hold of h delays by h/2 and passes sinc(fh). The holds leave an image at m/T - f, of the
amplitude f/(m/T - f): a tenth at f = 0.36/T, and ten times above f, where a structure of second
order passes a hundredth of that. The names are those of the property InterSample of L. Ljung,
System Identification Toolbox, which calls them zoh and bl.
"""

from collections.abc import Callable

import numpy as np
from attrs import frozen
from scipy.fft import next_fast_len

from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array, Trace, setting

HELD, BAND_LIMITED = "held", "band_limited"
INTERSAMPLE = (HELD, BAND_LIMITED)


@frozen
class IntersampleSettings:
    """How a band-limited signal is interpolated."""

    upsampling: int = setting(
        4,
        "1",
        "held voltages for each sample of a band-limited drive",
        "their first image is a tenth of a drive at a third of the sample rate, where a structure"
        " of second order hardly responds",
    )
    edge: int = setting(
        16,
        "samples",
        "at either end of a record, which a fit leaves out unless the scanner rests there",
        "a band-limited interpolation sees some ten samples",
    )


INTERPOLATION = IntersampleSettings()


def upsampling(intersample: str) -> int:
    """Held voltages for each sample of a drive; raises InputError for an unknown behaviour."""
    if intersample not in INTERSAMPLE:
        known = ", ".join(INTERSAMPLE)
        raise InputError(f"intersample {intersample!r} is unknown: give one of {known}")
    return INTERPOLATION.upsampling if intersample == BAND_LIMITED else 1


def held_voltages(drive: Array, intersample: str) -> Array:
    """Return the voltages (n · upsampling,) whose holds make a drive (n,), in V."""
    if intersample == HELD:
        return drive
    return _interpolated(drive, lambda omega: np.exp(0.5j * omega) / np.sinc(omega / (2.0 * np.pi)))


def voltages_of(drive: Trace, intersample: str) -> Trace:
    """Return the voltages whose holds make the drive (V) of both axes."""
    both = (held_voltages(of_axis, intersample) for of_axis in (drive.x, drive.y))
    return Trace(drive.first_sample, drive.sample_period / upsampling(intersample), *both)


def read_between(displacement: Array, intersample: str) -> Array:
    """Return a displacement (n,) upsampled as its drive is, shape (n · upsampling,)."""
    return displacement if intersample == HELD else _interpolated(displacement, np.ones_like)


def moved_by(
    forward: Callable[[float], Cascade], drive: Array, sample_period: float, intersample: str
) -> Array:
    """Output (n,) at each sample of a drive (n,), from rest, of what ``forward`` makes."""
    every = upsampling(intersample)
    cascade = forward(sample_period / every)
    return cascade.apply(cascade.at_rest(), held_voltages(drive, intersample))[1][::every]


def _interpolated(signal: Array, gain: Callable[[Array], Array]) -> Array:
    """Upsample a signal (n,), with a gain at each angular frequency in rad per upsampled sample.

    Beyond either end it goes on as its odd reflection; half a cosine joins both reflections.
    """
    count, every = len(signal), INTERPOLATION.upsampling
    reflected = np.pad(signal, count - 1, mode="reflect", reflect_type="odd")
    padded = next_fast_len(len(reflected) + count, real=True)
    joining = padded - len(reflected)
    way = 0.5 - 0.5 * np.cos(np.pi * (np.arange(joining) + 0.5) / joining)
    around = np.append(reflected, reflected[-1] + (reflected[0] - reflected[-1]) * way)
    spectrum = np.fft.rfft(around)
    omega = 2.0 * np.pi * np.arange(len(spectrum)) / padded / every
    upsampled = np.zeros(every * padded // 2 + 1, complex)
    upsampled[: len(spectrum)] = every * gain(omega) * spectrum
    first = every * (count - 1)
    return np.fft.irfft(upsampled, every * padded)[first : first + every * count]
