"""How a drive runs between its samples: held by a converter, or measured behind a filter.

A converter holds each voltage until the next update. A drive that was measured is band-limited
instead: an anti-aliasing filter stands before the recorder. Of such a drive v the model is given
``finer`` times as many held voltages u, of which the part below half the sample rate is v itself:

    U(f) = V(f) e^{jπfh} / sinc(fh),    h = T / finer,

since a hold of h delays by h/2 and passes sinc(fh). The holds leave an image at finer/T - f, of the
amplitude f/(finer/T - f): a tenth at f = 0.36/T, and ten times above f, where a structure of second
order passes a hundredth of that. The names are those of the property InterSample of L. Ljung,
System Identification Toolbox, which calls them zoh and bl.
"""

from collections.abc import Callable

import numpy as np
from attrs import frozen
from scipy.fft import next_fast_len

from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.settings import setting
from afm_scan_ros.core.types import Array, Trace

HELD, BAND_LIMITED = "held", "band_limited"
INTERSAMPLE = (HELD, BAND_LIMITED)


@frozen
class IntersampleSettings:
    """How a band-limited signal is interpolated."""

    finer: int = setting(
        4,
        "1",
        "held voltages for each sample of a band-limited drive",
        "their first image is a tenth of a drive at a third of the sample rate, where a structure"
        " of second order hardly responds",
    )
    edge: int = setting(
        16,
        "samples",
        "at either end of a record, between which what lies beyond counts",
        "a band-limited interpolation sees some ten samples",
    )


INTERPOLATION = IntersampleSettings()


def finer(intersample: str) -> int:
    """Held voltages for each sample of a drive of an intersample behaviour.

    Raises InputError for an unknown one.
    """
    if intersample not in INTERSAMPLE:
        known = ", ".join(INTERSAMPLE)
        raise InputError(f"intersample {intersample!r} is unknown: give one of {known}")
    return INTERPOLATION.finer if intersample == BAND_LIMITED else 1


def held_voltages(drive: Array, intersample: str) -> Array:
    """Return the voltages (n · finer,) whose holds make a drive (n,), in V."""
    if intersample == HELD:
        return drive
    return _interpolated(drive, lambda turn: np.exp(0.5j * turn) / np.sinc(turn / (2.0 * np.pi)))


def voltages_of(drive: Trace, intersample: str) -> Trace:
    """Return the voltages whose holds make the drive (V) of both axes."""
    both = (held_voltages(of_axis, intersample) for of_axis in (drive.x, drive.y))
    return Trace(drive.first_sample, drive.sample_period / finer(intersample), *both)


def read_between(displacement: Array, intersample: str) -> Array:
    """Return a displacement (n,) at ``finer`` times as many samples, between those measured."""
    return displacement if intersample == HELD else _interpolated(displacement, np.ones_like)


def moved_by(
    forward: Callable[[float], Cascade], drive: Array, sample_period: float, intersample: str
) -> Array:
    """Output (n,) of a model at each sample of a drive (n,), from rest at zero.

    ``forward`` makes the model at a sample period (s).
    """
    every = finer(intersample)
    cascade = forward(sample_period / every)
    return cascade.apply(cascade.at_rest(), held_voltages(drive, intersample))[1][::every]


def _interpolated(signal: Array, gain: Callable[[Array], Array]) -> Array:
    """Interpolate a signal (n,), with a gain at each angle a sample of the finer one, in rad.

    Beyond either end the signal goes on as its image in the end's own sample, which keeps value and
    slope, and then turns smoothly into what is beyond the other end.
    """
    count, every = len(signal), INTERPOLATION.finer
    beyond = min(count - 1, 8 * INTERPOLATION.edge)
    imaged = np.pad(signal, beyond, mode="reflect", reflect_type="odd")
    padded = next_fast_len(len(imaged) + count, real=True)
    turned = padded - len(imaged)
    way = 0.5 - 0.5 * np.cos(np.pi * (np.arange(turned) + 0.5) / turned)
    around = np.concatenate([imaged, imaged[-1] + (imaged[0] - imaged[-1]) * way])
    spectrum = np.fft.rfft(around)
    turn = 2.0 * np.pi * np.arange(len(spectrum)) / padded / every
    fine = np.zeros(every * padded // 2 + 1, complex)
    fine[: len(spectrum)] = every * gain(turn) * spectrum
    first = every * beyond
    return np.fft.irfft(fine, every * padded)[first : first + every * count]
