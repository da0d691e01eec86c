"""The residual of one axis in one record: in sentences and in pictures."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.core.diagnosis.account import loudest
from afm_scan_ros.core.diagnosis.axis_trace import AxisTrace
from afm_scan_ros.core.diagnosis.describe import Description
from afm_scan_ros.core.diagnosis.floor import Floor
from afm_scan_ros.core.numerals import significant
from afm_scan_ros.report.quantity import nanometres
from afm_scan_ros.report.style import BLUE, GREY, LIGHT_BLUE, LIGHT_ORANGE, ORANGE, styled

TOLD = 0.3
"""Share from which a dependence or a coherence is worth a sentence."""
RULES = 2.0
"""How many times larger one of trace and retrace's parts is than the other, to be called so."""

CHANCE = 0.05
"""Share of white noise's autocorrelation that lies outside its 95 % band."""
PATTERN = (
    "What is at its floor may do so too: a model's known error is a pattern, and no white noise."
)
UNLIKE_LINES = {"speed", "amplitude", "time"}
CONFOUNDED = (
    "; in a scan the preparation differs from the lines in speed, amplitude and time at once"
)
"""What goes with one of these may be of another of them."""

QUANTITIES = {
    "position": "position",
    "speed": "speed",
    "travel": "the way since the motion last turned round",
    "amplitude": "the amplitude of the motion nearby",
    "time": "time",
}


def residual_words(one: Description, floor: Floor) -> Iterator[str]:
    """Yield what is known of a residual, the size of it first."""
    yield _size(one, floor)
    yield from _repeats(one)
    yield from _sides(one)
    yield from _goes_with(one)
    yield from _coheres(one, floor)
    if one.lines:
        lines = ", ".join(f"{line:.4g} Hz ({nanometres(size)} nm)" for line, size in one.lines)
        yield f"Lines stand out, with so much rms over the whole record: {lines}."
    yield (
        f"{one.own.outside_white:.0%} of its autocorrelation lies outside the 95 % band of white"
        f" noise, {one.own.outside_bootstrap:.0%} of what is beyond its own memory outside that of"
        " a block bootstrap."
    )
    if one.own.outside_white > CHANCE:
        yield PATTERN


def chosen_words(trace: AxisTrace) -> str:
    """Say which of several records is described, and why; nothing where there is but one."""
    if len(trace.evidence) == 1:
        return ""
    peaks = [significant(float(ratio.max()), 2) for ratio in trace.ratio_before]
    names = [evidence.playback.view.name for evidence in trace.evidence]
    chosen = loudest(trace)
    others = (f"{peaks[i]} in {name}" for i, name in enumerate(names) if i != chosen)
    return (
        f"Described is {names[chosen]}, where the residual stands highest above its floor:"
        f" {peaks[chosen]} times in its loudest band, {', '.join(others)}."
        " The JSON describes each. "
    )


def _size(one: Description, floor: Floor) -> str:
    ratio = one.bands / floor.rms
    loudest = int(np.argmax(ratio))
    low, high = floor.edges[loudest], floor.edges[loudest + 1]
    return (
        f"{nanometres(one.rms)} nm rms over the whole record, of a floor of"
        f" {nanometres(floor.total)} nm; loudest from {low:g} to {high:g} Hz,"
        f" {significant(ratio[loudest], 2)} times its floor there."
    )


def _repeats(one: Description) -> Iterator[str]:
    if one.repeats:
        yield (
            f"On the lines {one.repeats.to_scan:.0%} of it repeats from line to line,"
            f" {one.repeats.to_time:.0%} moves whole lines in the course of time, and"
            f" {one.repeats.rest:.0%} does neither."
        )


def _sides(one: Description) -> Iterator[str]:
    if one.sides is None:
        return
    alike, unlike = one.sides.alike, one.sides.unlike
    ruled = "place and direction alike"
    if alike > RULES * unlike:
        ruled = "place"
    elif unlike > RULES * alike:
        ruled = "direction"
    yield (
        f"Trace and retrace share {nanometres(alike)} nm rms and lie {nanometres(unlike)} nm rms"
        f" to either side of that: a matter of {ruled}."
    )


def _goes_with(one: Description) -> Iterator[str]:
    shares = {name: each.share for name, each in one.dependences.items()}
    told = sorted((n for n in shares if shares[n] > TOLD), key=shares.__getitem__, reverse=True)
    if not told:
        return
    listed = ", ".join(f"{QUANTITIES[name]} ({shares[name]:.0%})" for name in told)
    mixed = CONFOUNDED if one.repeats and UNLIKE_LINES.intersection(told) else ""
    yield f"Of its mean square so much goes with one quantity alone: {listed}{mixed}."


def _coheres(one: Description, floor: Floor) -> Iterator[str]:
    heard = []
    for name, each in one.coherences.items():
        values = np.nan_to_num(each.values)
        best = int(np.argmax(values))
        if values[best] > max(TOLD, each.chance):
            low, high = floor.edges[best], floor.edges[best + 1]
            heard.append(f"the {name} ({values[best]:.2f}, {low:g} to {high:g} Hz)")
    if heard:
        yield f"It coheres with {', '.join(heard)}."


NANO, MICRO = 1e9, 1e6
POINTS = 1500
"""Stretches of a drawn signal: as many as show."""
SHADES = ((ORANGE, LIGHT_ORANGE), (BLUE, LIGHT_BLUE))
NAMES = ("before", "after")
LABELS = {
    "position": (MICRO, "position in µm"),
    "speed": (1e3, "speed in mm/s"),
    "travel": (MICRO, "way since the last turn in µm"),
}


@styled
def residual_figure(floor: Floor, *stages: Description) -> Figure:
    """Draw the residual of one axis in one record: before (orange) and, if given, after (blue)."""
    figure = Figure(figsize=(9.6, 8.0), layout="constrained")
    ((bands, time), (position, speed), (last, own)) = figure.subplots(3, 2)
    bands.stairs(NANO * floor.rms, _edges(floor), color=GREY, label="floor", lw=1.4)
    for stage, colours, name in zip(stages, SHADES, NAMES, strict=False):
        bands.stairs(NANO * stage.bands, _edges(floor), color=colours[0], label=name, lw=1.4)
        _time(time, stage, colours[0])
        _dependence(position, "position", stage, colours)
        _dependence(speed, "speed", stage, colours)
        _line(last, stage, colours, name)
        own.plot(stage.own.lags, stage.own.values, color=colours[0])
    bands.set(xlabel="frequency in Hz", ylabel="rms in nm", xscale="log", yscale="log")
    _legend_above(bands)
    _correlation_bands(own, stages[-1])
    return figure


def _edges(floor: Floor) -> list[float]:
    """Edges in Hz, the first where a logarithmic axis can begin."""
    return [floor.edges[1] / 10.0, *floor.edges[1:]]


def _time(panel: Axes, stage: Description, colour: str) -> None:
    every = max(1, len(stage.residual) // POINTS)
    whole = len(stage.residual) // every * every
    stretches = NANO * stage.residual[:whole].reshape(-1, every)
    seconds = np.arange(0, whole, every) * stage.sample_period
    ends = stretches.min(axis=1), stretches.max(axis=1)
    panel.fill_between(seconds, *ends, color=colour, lw=0.4)
    panel.set(xlabel="time in s", ylabel="residual in nm")


def _dependence(panel: Axes, name: str, stage: Description, colours: tuple[str, str]) -> None:
    of, (scale, label) = stage.dependences[name], LABELS[name]
    scatter = np.sqrt(np.maximum(of.rms**2 - of.mean**2, 0.0))
    ends = NANO * (of.mean - scatter), NANO * (of.mean + scatter)
    panel.fill_between(scale * of.centres, *ends, color=colours[1], alpha=0.3, lw=0)
    panel.plot(scale * of.centres, NANO * of.mean, color=colours[0])
    panel.set(xlabel=label, ylabel="mean and scatter in nm")


def _line(panel: Axes, stage: Description, colours: tuple[str, str], name: str) -> None:
    if stage.sides is None:
        _dependence(panel, "travel", stage, colours)
        return
    ways = ("trace", stage.sides.trace), ("retrace", stage.sides.retrace)
    for (way, values), colour in zip(ways, colours, strict=True):
        label = way if name == NAMES[0] else f"{way}, {name}"
        panel.plot(stage.sides.place, NANO * values, color=colour, lw=0.9, label=label)
    panel.set(xlabel="place along the line", ylabel="mean line in nm")
    _legend_above(panel)


def _correlation_bands(panel: Axes, stage: Description) -> None:
    panel.axhspan(-stage.own.bootstrap, stage.own.bootstrap, color=GREY, alpha=0.35, lw=0)
    for sign in (-1.0, 1.0):
        panel.axhline(sign * stage.own.white, color=GREY, lw=0.8)
    panel.set(xlabel="lag in s", ylabel="autocorrelation", xscale="log", ylim=(-1.05, 1.05))


def _legend_above(panel: Axes) -> None:
    panel.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, borderaxespad=0.2, columnspacing=1.0
    )
