"""The residual of one axis in one record: in sentences and in pictures."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.fft import irfft, next_fast_len, rfft

from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.core.diagnosis.residual_report import Description, most_excited_record
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.quantity import nanometres, significant
from afm_scan_ros.report.style import (
    BLUE,
    DARK_GREY,
    GREY,
    LIGHT_BLUE,
    LIGHT_ORANGE,
    MICRO,
    NANO,
    ORANGE,
    blank,
    dense,
    legend_above,
    styled,
)

LARGE = 0.3
"""Share from which a dependence or a coherence is stated."""
RULES = 2.0
"""Least ratio of the common and the different part of trace and retrace for a statement."""
CHANCE = 0.05
"""Share of white noise's autocorrelation that lies outside its 95 % band."""
NEAR_LIMIT = 0.95
"""Share of the identified drive range from which on an excursion saturates."""
PATTERN = (
    "A residual at its detection limit may do so too, because model discrepancy is not white noise."
)
UNLIKE_LINES = {"speed", "amplitude", "time"}
CONFOUNDED = (
    " The preparation of a scan differs from its lines in speed, amplitude and time at once, so"
    " these cannot be separated."
)
"""What depends on one of these may depend on another of them."""

QUANTITIES = {
    "position": "position",
    "speed": "speed",
    "travel": "the travel since the last turning point",
    "amplitude": "the amplitude of the motion nearby",
    "time": "time",
}


def residual_text(one: Description, limit: DetectionLimit) -> Iterator[str]:
    """Yield what is known of a residual, its size first."""
    yield _size(one, limit)
    yield from _repeats(one)
    yield from _sides(one)
    yield from _dependences(one)
    yield from _coherences(one, limit)
    if one.lines:
        lines = ", ".join(f"{line:.4g} Hz ({nanometres(size)} nm rms)" for line, size in one.lines)
        yield f"Spectral lines over the whole record: {lines}."
    yield (
        f"{one.own.outside_white:.0%} of its autocorrelation lies outside the 95 % band of white"
        f" noise. At long lags {one.own.outside_bootstrap:.0%} lies outside the 95 % band of a"
        " block bootstrap."
    )
    if one.own.outside_white > CHANCE:
        yield PATTERN


def chosen_text(diagnosed: AxisDiagnosis) -> str:
    """Say which of several records is described, and why; nothing where there is but one."""
    if len(diagnosed.evidence) == 1:
        return ""
    peaks = [significant(float(ratio.max()), 2) for ratio in diagnosed.ratio_before]
    names = [evidence.playback.view.name for evidence in diagnosed.evidence]
    chosen = most_excited_record(diagnosed)
    others = (f"{peaks[i]} in {name}" for i, name in enumerate(names) if i != chosen)
    return (
        f"This is {names[chosen]}, the record that exceeds its detection limit most:"
        f" {peaks[chosen]} times in its largest band, {', '.join(others)}."
        " The JSON file describes each record. "
    )


def initial_state_text(one: Description) -> str:
    """Say in what state of its hysteresis a record found the scanner."""
    turns, rest = one.initial_state.turns, one.initial_state.rest
    if not turns:
        return "depolarised" if one.initial_state.blank else f"depolarised, at rest at {rest:.2g} V"
    lower, upper = (NEAR_LIMIT * limit for limit in one.drive_limits)
    if not lower < turns[-1] < upper:
        return f"saturated at its {'upper' if turns[-1] > 0.0 else 'lower'} end"
    drives = " and then ".join(f"{turn:.2g} V" for turn in turns)
    return f"driven to {drives} before, at rest at {rest:.2g} V"


def _size(one: Description, limit: DetectionLimit) -> str:
    ratio = one.bands / limit.rms
    largest = int(np.argmax(ratio))
    low, high = limit.edges[largest], limit.edges[largest + 1]
    return (
        f"{nanometres(one.rms)} nm rms over the whole record, with a detection limit of"
        f" {nanometres(limit.total)} nm rms. Its largest band is {low:g} to {high:g} Hz,"
        f" {significant(ratio[largest], 2)} times the limit there."
    )


def _repeats(one: Description) -> Iterator[str]:
    if one.repeats:
        yield (
            f"On the lines {one.repeats.to_scan:.0%} of its mean square repeats from line to line."
            f" {one.repeats.to_time:.0%} shifts whole lines over time. {one.repeats.rest:.0%} does"
            " neither."
        )


def _sides(one: Description) -> Iterator[str]:
    if one.sides is None:
        return
    equivalent, unlike = one.sides.equivalent, one.sides.unlike
    ruled = "on position and direction alike"
    if equivalent > RULES * unlike:
        ruled = "on position"
    elif unlike > RULES * equivalent:
        ruled = "on direction"
    yield (
        f"Trace and retrace share {nanometres(equivalent)} nm rms and differ from it by"
        f" {nanometres(unlike)} nm rms, so it depends {ruled}."
    )


def _dependences(one: Description) -> Iterator[str]:
    shares = {name: each.share for name, each in one.dependences.items()}
    large = sorted((n for n in shares if shares[n] > LARGE), key=shares.__getitem__, reverse=True)
    if not large:
        return
    listed = ", ".join(f"{QUANTITIES[name]} ({shares[name]:.0%})" for name in large)
    mixed = CONFOUNDED if one.repeats and UNLIKE_LINES.intersection(large) else ""
    yield f"Share of its mean square that one quantity alone explains: {listed}.{mixed}"


def _coherences(one: Description, limit: DetectionLimit) -> Iterator[str]:
    found = []
    for name, each in one.coherences.items():
        values = np.nan_to_num(each.values)
        best = int(np.argmax(values))
        if values[best] > max(LARGE, each.chance):
            low, high = limit.edges[best], limit.edges[best + 1]
            found.append(f"the {name} ({values[best]:.2f}, {low:g} to {high:g} Hz)")
    if found:
        yield f"It is coherent with {', '.join(found)}."


LAGS, LONGEST = 80, 16
"""Intervals of lag in the autocorrelation, and the record's length over the longest lag."""
SHADES = ((ORANGE, LIGHT_ORANGE), (BLUE, LIGHT_BLUE))
NAMES = ("model", "extended model")
LABELS = {
    "position": (MICRO, "position in µm"),
    "speed": (1e3, "speed in mm/s"),
    "travel": (MICRO, "travel since the last turning point in µm"),
}


@styled
def residual_figure(limit: DetectionLimit, *stages: Description) -> Figure:
    """Draw the residual of one axis in one record: of the model and, if given, the extended one."""
    figure = blank(9.6, 8.6)
    ((bands, time), (position, speed), (last, own)) = figure.subplots(3, 2)
    label = "detection limit"
    bands.stairs(NANO * limit.rms, _edges(limit), color=DARK_GREY, ls="--", label=label, lw=1.4)
    for stage, colours, name in zip(stages, SHADES, NAMES, strict=False):
        bands.stairs(NANO * stage.bands, _edges(limit), color=colours[0], label=name, lw=1.4)
        seconds = stage.sample_period * np.arange(len(stage.residual), dtype=np.float64)
        dense(time, seconds, NANO * stage.residual, colours[0], name)
        _dependence(position, "position", stage, colours, name)
        _dependence(speed, "speed", stage, colours, name)
        _line(last, stage, colours, name)
        _autocorrelation(own, stage, colours[0], name)
    bands.set(xlabel="frequency in Hz", ylabel="rms by band in nm", xscale="log", yscale="log")
    _correlation_bands(own, stages[-1])
    time.set(xlabel="time in s", ylabel="residual in nm")
    for panel in figure.axes:
        legend_above(panel, columns=3 if panel is bands else 2)
    return figure


def _edges(limit: DetectionLimit) -> list[float]:
    """Edges in Hz, the first where a logarithmic axis can begin."""
    return [limit.edges[1] / 10.0, *limit.edges[1:]]


def _dependence(
    panel: Axes, quantity: str, stage: Description, colours: tuple[str, str], name: str
) -> None:
    of, (scale, label) = stage.dependences[quantity], LABELS[quantity]
    scatter = np.sqrt(np.maximum(of.rms**2 - of.mean**2, 0.0))
    ends = NANO * (of.mean - scatter), NANO * (of.mean + scatter)
    panel.fill_between(scale * of.centres, *ends, color=colours[1], alpha=0.3, lw=0)
    panel.plot(scale * of.centres, NANO * of.mean, color=colours[0], label=f"{name}, mean ± sd")
    panel.set(xlabel=label, ylabel="residual in nm")


def _line(panel: Axes, stage: Description, colours: tuple[str, str], name: str) -> None:
    if stage.sides is None:
        _dependence(panel, "travel", stage, colours, name)
        return
    ways = ("trace", stage.sides.trace), ("retrace", stage.sides.retrace)
    for (way, values), colour in zip(ways, colours, strict=True):
        label = f"{way}, {name}"
        panel.plot(stage.sides.place, NANO * values, color=colour, lw=0.9, label=label)
    panel.set(xlabel="place along the line", ylabel="mean line's residual in nm")


def _autocorrelation(panel: Axes, stage: Description, colour: str, name: str) -> None:
    """Draw the range of the autocorrelation in each of many intervals of lag."""
    values = _correlated(stage.residual)
    edges = np.unique(np.geomspace(1, len(values) - 1, LAGS).astype(int))
    low, high = (f.reduceat(values, edges) for f in (np.minimum, np.maximum))
    panel.fill_between(
        edges * stage.sample_period, low, high, step="post", color=colour, alpha=0.5, lw=0.8,
        label=name,
    )  # fmt: skip


def _correlated(residual: Array) -> Array:
    """Autocorrelation of a residual at lags 0, 1, … samples."""
    centred = residual - residual.mean()
    count = len(centred)
    size = next_fast_len(2 * count)
    products = irfft(np.abs(rfft(centred, size)) ** 2, size)[: count // LONGEST]
    result: Array = products / max(products[0], np.finfo(float).tiny)
    return result


def _correlation_bands(panel: Axes, stage: Description) -> None:
    own = stage.own
    label = "95 % band, block bootstrap"
    panel.axhspan(-own.bootstrap, own.bootstrap, color=GREY, alpha=0.35, lw=0, label=label)
    for sign, text in ((-1.0, None), (1.0, "95 % band, white noise")):
        panel.axhline(sign * own.white, color="black", lw=0.6, ls=":", label=text)
    panel.set(xlabel="lag in s", ylabel="autocorrelation", xscale="log", ylim=(-1.05, 1.05))
