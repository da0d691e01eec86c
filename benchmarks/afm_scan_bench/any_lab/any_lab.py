"""Scanners and protocols drawn at random: how many are identified, refused, or wrong."""

from collections.abc import Iterable, Iterator

import numpy as np
from attrs import frozen

import afm_scan_ros as afm
from afm_scan_bench.any_lab.protocols import PROTOCOLS, taken, taken_with
from afm_scan_bench.any_lab.scanner import FAMILIES, DrawnScanner, draw
from afm_scan_ros.core.effect_status import Status
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.report.table import Row, Table

SEEDS = range(200)
WRONG_RESONANCE = 0.01
"""Relative error of a resonance that counts as wrong."""

COLUMNS = {
    "protocol": ("records", ""),
    "cases": ("cases", "d"),
    "identified": ("identified", "d"),
    "refused": ("refused", "d"),
    "resonances": ("resonances", "d"),
    "within": ("within 0.1 %", "d"),
    "inside": ("inside their interval", "d"),
    "wrong": ("wrong, without a word", "d"),
    "prediction_percent": ("fresh scan, median error, % of range", ".2f"),
    "gain_percent": ("by one gain", ".2f"),
}


@frozen
class Outcome:
    """What became of one case; ``refusal`` is the message."""

    seed: int
    protocol: str
    family: str
    refusal: str
    resonance_errors: tuple[float, ...] = ()
    inside: tuple[bool, ...] = ()
    prediction: float = np.nan
    by_gain: float = np.nan
    loops: bool = False

    @property
    def wrong(self) -> bool:
        """Whether a resonance stated as identified is another one, or a gain predicts better.

        The latter counts where the hysteresis is stated as identified (``loops``).
        """
        worse = self.loops and self.prediction > self.by_gain
        return worse or any(error > WRONG_RESONANCE for error in self.resonance_errors)


def measure() -> Table:
    """Draw, take the records, identify, and compare with the truth."""
    outcomes = [case(seed) for seed in SEEDS]
    rows = [_row(name, [o for o in outcomes if o.protocol == name]) for name in PROTOCOLS]
    return Table("any_lab", "Scanners and records drawn at random", COLUMNS, rows)


def case(seed: int) -> Outcome:
    """One scanner, by the protocol and of the family whose turn it is."""
    rng = np.random.default_rng(seed)
    protocol = list(PROTOCOLS)[seed % len(PROTOCOLS)]
    family = FAMILIES[seed // len(PROTOCOLS) % len(FAMILIES)]
    scanner = draw(rng, family)
    records = taken(protocol, scanner, rng)
    try:
        model = afm.identify(records, order=None)
    except (InputError, ScanError) as error:
        return Outcome(seed, protocol, family, str(error))
    found = [_resonance(model, name, k, scanner) for k, name in enumerate(model.axes)]
    known = [each for each in found if each is not None]
    reach = max(float(record.drive[:, 0].max()) - scanner.middle for record in records)
    prediction, by_gain = _fresh(model, scanner, 0.6 * reach, rng)
    errors, inside = tuple(e for e, _ in known), tuple(i for _, i in known)
    loops = model.effects["x"].hysteresis.status is Status.IDENTIFIED
    return Outcome(seed, protocol, family, "", errors, inside, prediction, by_gain, loops)


def _resonance(
    model: afm.Model, axis: str, place: int, scanner: DrawnScanner
) -> tuple[float, bool] | None:
    """Relative error of an axis' resonance and whether its interval holds it; None if unknown."""
    status = model.effects[axis].vibration
    named = (each for each in status.intervals if each.name == "resonance")
    interval = next(named, None)
    if status.status is not Status.IDENTIFIED or interval is None:
        return None
    true = scanner.axes[place].modes[0].frequency
    lower, upper = interval.lower or 0.0, interval.upper or np.inf
    middle = 0.5 * (lower + upper) if np.isfinite(upper) else lower
    return abs(middle / true - 1.0), bool(lower <= true <= upper)


def _fresh(
    model: afm.Model, scanner: DrawnScanner, volts: float, rng: np.random.Generator
) -> tuple[float, float]:
    """Error of a triangle to so many V and at a rate that no record has, % rms of its range.

    The second is that of the one gain that fits the triangle best.
    """
    rate = scanner.resonance / 400.0 * 4000.0
    seconds = np.arange(8000) / rate
    phase = (seconds * scanner.resonance / 600.0) % 1.0
    shape = volts / scanner.swing * np.interp(phase, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    record = taken_with(scanner, ("fresh", shape, rate), rng)
    moved = record.displacement[:, 0]
    predicted = model.predict(record.drive, record.sample_period)[:, 0]
    line = np.polyval(np.polyfit(record.drive[:, 0], moved, 1), record.drive[:, 0])
    span = float(np.ptp(moved))
    error, by_line = (100.0 * float(np.std(moved - each)) / span for each in (predicted, line))
    return error, by_line


def _row(protocol: str, outcomes: list[Outcome]) -> Row:
    done = [o for o in outcomes if not o.refusal]
    errors = list(_all(o.resonance_errors for o in done))
    return {
        "protocol": protocol,
        "cases": len(outcomes),
        "identified": len(done),
        "refused": len(outcomes) - len(done),
        "resonances": len(errors),
        "within": sum(error <= 1e-3 for error in errors),  # noqa: PLR2004 - 0.1 %
        "inside": sum(_all(o.inside for o in done)),
        "wrong": sum(o.wrong for o in done),
        "prediction_percent": float(np.median([o.prediction for o in done] or [np.nan])),
        "gain_percent": float(np.median([o.by_gain for o in done] or [np.nan])),
    }


def _all(groups: Iterable[tuple[float, ...]]) -> Iterator[float]:
    for group in groups:
        yield from group
