"""How far corrected places of pixels are from the true ones: pitch, and trace against retrace.

Places are (2, lines, pixels), x then y, in m. An image does not show where the sample lies, nor how
the grating is turned on it. So places count as one rigid body does: turned and shifted at will.
"""

import numpy as np
from attrs import frozen

from afm_scan_bench.images.acquire import Acquired, Frame
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class Places:
    """Places of the pixels of a trace and of its retrace."""

    trace: Array
    retrace: Array

    def lines(self, known: slice) -> "Places":
        """Return the places of some lines."""
        return Places(self.trace[:, known], self.retrace[:, known])

    @property
    def all(self) -> Array:
        """Both, one below the other, (2, 2 * lines, pixels)."""
        return np.concatenate([self.trace, self.retrace], axis=1)


@frozen
class Score:
    """Rms over an image: local error of the pitch (1) in x and y, and what parts the two ways.

    ``shift`` is the distance in x, in pixels, at which a place shows in trace and in retrace.
    """

    pitch_x: float
    pitch_y: float
    shift: float


def commanded(frame: Frame) -> Places:
    """Return where the controller takes the pixels to be."""
    x = frame.range_x * ((np.arange(frame.pixels) + 0.5) / frame.pixels - 0.5)
    y = frame.range_y * ((np.arange(frame.lines) + 0.5) / frame.lines - 0.5)
    places = np.stack(np.meshgrid(x, y))
    return Places(places, places)


def true_places(taken: Acquired) -> Places:
    """Return where the pixels of an image were."""
    return Places(taken.true_trace, taken.true_retrace)


def scaled(places: Places, true: Places) -> Places:
    """Return places whose axes each have the one scale that serves best."""
    shape = (2, 1, 1)
    given, wanted = (
        each.all - each.all.mean(axis=(1, 2), keepdims=True) for each in (places, true)
    )
    scales = np.reshape((given * wanted).sum(axis=(1, 2)) / (given**2).sum(axis=(1, 2)), shape)
    return Places(scales * places.trace, scales * places.retrace)


def score(
    places: Places, true: Places, pitch: float, frame: Frame, known: slice | None = None
) -> Score:
    """Compare places with the true ones, a ``pitch`` (m) apart, in lines that are ``known``.

    By default all lines are but the one scanned first: it begins at rest, and no image shows how it
    moved. Raises InputError where less than a pitch is in view.
    """
    if known is None:
        known = slice(1, None) if frame.upward else slice(None, -1)
    places, true = places.lines(known), true.lines(known)
    turned = aligned(places, true)
    return Score(
        _pitch_error(turned, true, pitch, 0),
        _pitch_error(turned, true, pitch, 1),
        _shift(turned, true) * frame.pixels / frame.range_x,
    )


def aligned(places: Places, true: Places) -> Places:
    """Turn and shift places, trace and retrace together, to lie nearest to the true ones."""
    middle, to = (each.all.mean(axis=(1, 2))[:, None, None] for each in (places, true))
    given, wanted = places.all - middle, true.all - to
    cross = np.sum(given[0] * wanted[1] - given[1] * wanted[0])
    angle = np.arctan2(cross, np.sum(given * wanted))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    trace, retrace = (
        np.tensordot(turn, each - middle, 1) + to for each in (places.trace, places.retrace)
    )
    return Places(trace, retrace)


def _pitch_error(places: Places, true: Places, pitch: float, axis: int) -> float:
    """Rms over trace and retrace of a distance of a pitch over the true one, less 1."""
    along = 1 - axis
    errors = []
    for found, right in ((places.trace, true.trace), (places.retrace, true.retrace)):
        spacing = abs(float(np.mean(np.diff(right[axis], axis=along))))
        apart = round(pitch / spacing)
        if not 0 < apart < right.shape[1 + along]:
            raise InputError(
                f"a pitch of {pitch:g} m is {apart} pixels of an image of"
                f" {right.shape[1 + along]}: give an image that shows several"
            )
        distance, wanted = (_apart(each[axis], apart, along) for each in (found, right))
        errors.append((distance / wanted - 1.0).ravel())
    return float(np.sqrt(np.mean(np.square(np.concatenate(errors)))))


def _apart(values: Array, count: int, along: int) -> Array:
    first, last = (
        np.split(values, [count], axis=along)[1],
        np.split(values, [-count], axis=along)[0],
    )
    return np.asarray(first - last)


def _shift(places: Places, true: Places) -> float:
    """Rms difference (m) of the errors of x of trace and retrace at equal true places of a line."""
    squares, count = 0.0, 0
    for row in range(true.trace.shape[1]):
        there, back = true.trace[0, row], true.retrace[0, row]
        order = np.argsort(back)
        error = (places.retrace[0, row] - back)[order]
        seen = (there >= back[order[0]]) & (there <= back[order[-1]])
        opposite = np.interp(there[seen], back[order], error)
        apart = (places.trace[0, row] - there)[seen] - opposite
        squares, count = squares + float(apart @ apart), count + apart.size
    return float(np.sqrt(squares / count)) if count else float("nan")
