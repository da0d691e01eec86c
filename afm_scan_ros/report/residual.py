"""The residual of one axis in one record: in sentences and in pictures."""

from collections.abc import Iterator

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.core.diagnosis.residual_report import Description, most_excited_record
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.picture import (
    BLUE,
    DARK_GREY,
    LIGHT_BLUE,
    LIGHT_ORANGE,
    MICRO,
    MILLI,
    NANO,
    ORANGE,
    Curve,
    Mark,
    Panel,
    Picture,
    Shade,
    Steps,
)
from afm_scan_ros.report.quantity import nanometres, significant
from afm_scan_ros.report.sentences import sentence

LARGE = 0.3
"""Share from which a dependence or a coherence is stated."""
RULES = 2.0
"""Least ratio of the common and the different part of trace and retrace for a statement."""
CHANCE = 0.05
"""Share of white noise's autocorrelation that lies outside its 95 % band."""
NEAR_LIMIT = 0.95
"""Share of the identified drive range from which on an excursion saturates."""
UNLIKE_LINES = {"speed", "amplitude", "time"}
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
    if one.repeats:
        yield sentence("residual.repeats", of=one.repeats)
    if one.sides is not None:
        yield sentence("residual.sides", of=one.sides, ratio=RULES)
    yield from _dependences(one)
    yield from _coherences(one, limit)
    if one.lines:
        lines = [f"{line:.4g} Hz ({nanometres(size)} nm rms)" for line, size in one.lines]
        yield sentence("residual.lines", lines=lines)
    yield sentence("residual.autocorrelation", of=one.own)
    if one.own.outside_white > CHANCE:
        yield sentence("residual.pattern")


def chosen_text(diagnosed: AxisDiagnosis) -> str:
    """Say which of several records is described, and why; nothing where there is but one."""
    if len(diagnosed.evidence) == 1:
        return ""
    peaks = [significant(float(ratio.max()), 2) for ratio in diagnosed.ratio_before]
    names = [evidence.playback.view.name for evidence in diagnosed.evidence]
    chosen = most_excited_record(diagnosed)
    others = [f"{peaks[i]} in {name}" for i, name in enumerate(names) if i != chosen]
    return sentence("residual.chosen", name=names[chosen], peak=peaks[chosen], others=others) + " "


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
    sizes = {"rms": one.rms, "limit": limit.total, "ratio": ratio[largest]}
    return sentence("residual.size", low=low, high=high, **sizes)


def _dependences(one: Description) -> Iterator[str]:
    shares = {name: each.share for name, each in one.dependences.items()}
    large = sorted((n for n in shares if shares[n] > LARGE), key=shares.__getitem__, reverse=True)
    if large:
        listed = [f"{QUANTITIES[name]} ({shares[name]:.0%})" for name in large]
        confounded = one.repeats and UNLIKE_LINES.intersection(large)
        yield sentence("residual.dependences", shares=listed, confounded=confounded)


def _coherences(one: Description, limit: DetectionLimit) -> Iterator[str]:
    found = []
    for name, each in one.coherences.items():
        values = np.nan_to_num(each.values)
        best = int(np.argmax(values))
        if values[best] > max(LARGE, each.chance):
            low, high = limit.edges[best], limit.edges[best + 1]
            figures = {"value": values[best], "low": low, "high": high}
            found.append(sentence("residual.coherence", name=name, **figures))
    if found:
        yield sentence("residual.coherences", found=found)


LAGS, LONGEST = 80, 16
"""Intervals of lag in the autocorrelation, and the record's length over the longest lag."""
SHADES = ((ORANGE, LIGHT_ORANGE), (BLUE, LIGHT_BLUE))
NAMES = ("model", "extended model")
LABELS = {
    "position": (MICRO, "position in µm"),
    "speed": (MILLI, "speed in mm/s"),
    "travel": (MICRO, "travel since the last turning point in µm"),
}
HERTZ = "frequency in Hz"
PICKED = "residual in nm"
"""Label of what a dependence and a course over time show."""


def residual_pictures(
    axis: str, limit: DetectionLimit, *stages: Description
) -> tuple[Picture, Picture]:
    """Show the residual of one axis in one record: of the model and, if given, the extended one.

    The first picture has it by band, by frequency and over time, the second by what it depends on.
    """
    named = [*zip(stages, SHADES, NAMES, strict=False)]
    edges = np.array([limit.edges[1] / 10.0, *limit.edges[1:]])  # of a logarithmic axis
    bands = [Steps(edges, NANO * of.bands, name, colours[0]) for of, colours, name in named]
    bands.append(Steps(edges, NANO * limit.rms, "detection limit", DARK_GREY, dash="dashed"))
    spectra, courses = ([of(*each) for each in named] for of in (_spectrum, _course))
    record, seen = stages[0].record, "frequency of the spectrum in Hz"
    first = Picture(
        f"residual_{axis}",
        sentence("caption.residual", axis=axis, record=record),
        (
            [
                Panel(bands, HERTZ, "rms by band in nm", log="xy", role="bands"),
                Panel(spectra, seen, "amplitude in nm", log="xy", role="spectrum"),
            ],
            [Panel(courses, "time in s", PICKED, level=0.0)],
        ),
    )
    second = Picture(
        f"dependence_{axis}",
        sentence("caption.dependence", axis=axis, record=record),
        (
            [_dependence(quantity, named) for quantity in ("position", "speed")],
            [_lines(named), _correlation_panel(named)],
        ),
    )
    return first, second


Named = list[tuple[Description, tuple[str, str], str]]
"""Each stage with its colours and its name."""


def _course(of: Description, colours: tuple[str, str], name: str) -> Curve:
    seconds = of.sample_period * np.arange(len(of.residual), dtype=np.float64)
    return Curve(seconds, NANO * of.residual, name, colours[0])


def _spectrum(of: Description, colours: tuple[str, str], name: str) -> Curve:
    """Return the amplitude at each frequency but zero."""
    count = len(of.residual)
    amplitude = 2.0 / count * np.abs(rfft(of.residual - of.residual.mean()))
    return Curve(rfftfreq(count, of.sample_period)[1:], NANO * amplitude[1:], name, colours[0])


def _dependence(quantity: str, named: Named) -> Panel:
    scale, label = LABELS[quantity]
    marks: list[Mark] = []
    for stage, colours, name in named:
        of = stage.dependences[quantity]
        scatter = np.sqrt(np.maximum(of.rms**2 - of.mean**2, 0.0))
        low, high = NANO * (of.mean - scatter), NANO * (of.mean + scatter)
        marks.append(Shade(scale * of.centres, low, high, "", colours[1]))
        marks.append(Curve(scale * of.centres, NANO * of.mean, f"{name}, mean ± sd", colours[0]))
    return Panel(marks, label, PICKED, level=0.0)


def _lines(named: Named) -> Panel:
    sides = [(of.sides, colours, name) for of, colours, name in named if of.sides is not None]
    if len(sides) < len(named):
        return _dependence("travel", named)
    curves = [
        Curve(of.place, NANO * getattr(of, way), f"{way}, {name}", colour)
        for of, colours, name in sides
        for way, colour in zip(("trace", "retrace"), colours, strict=True)
    ]
    return Panel(curves, "place along the line", "mean line's residual in nm", level=0.0)


def _correlation_panel(named: Named) -> Panel:
    """Show the range of the autocorrelation in each of many intervals of lag."""
    marks = [_autocorrelation(stage, colours[0], name) for stage, colours, name in named]
    own, ends = named[-1][0].own, np.array([marks[0].x[0], marks[0].x[-1]])
    label = "95 % band, block bootstrap"
    low, high = (np.full(2, sign * own.bootstrap) for sign in (-1.0, 1.0))
    band = Shade(ends, low, high, label)
    white = [
        Curve(ends, np.full(2, sign * own.white), text, DARK_GREY, dash="dashed")
        for sign, text in ((-1.0, ""), (1.0, "95 % band, white noise"))
    ]
    return Panel([band, *marks, *white], "lag in s", "autocorrelation", log="x")


def _autocorrelation(stage: Description, colour: str, name: str) -> Shade:
    values = _correlated(stage.residual)
    edges = np.unique(np.geomspace(1, len(values) - 1, LAGS).astype(int))
    low, high = (f.reduceat(values, edges) for f in (np.minimum, np.maximum))
    return Shade(edges * stage.sample_period, low, high, name, colour)


def _correlated(residual: Array) -> Array:
    """Autocorrelation of a residual at lags 0, 1, … samples."""
    centred = residual - residual.mean()
    count = len(centred)
    size = next_fast_len(2 * count)
    products = irfft(np.abs(rfft(centred, size)) ** 2, size)[: count // LONGEST]
    result: Array = products / max(products[0], np.finfo(float).tiny)
    return result
