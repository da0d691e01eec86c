"""Scanners and protocols drawn at random: how many are identified, refused, or wrong.

The records of every protocol are sound: in step, of one sign, without gaps, within the drive's
range and slow where they are to be slow. So no refusal is right. A case is identified where a model
comes of it and nothing stated in it is wrong. It is silently wrong where a resonance stated as
identified is off by more than 0.1 % and by more than its interval admits, or where the hysteresis
is and one gain predicts a fresh scan better. A resonance counts where the model states one;
``unknown`` is no error where the protocol has no fast record. The resonance is the mode that peaks
highest.

    python -m afm_scan_bench.any_lab.any_lab RESULTS FIRST LAST

tries those seeds that the file RESULTS does not hold, adds a line of JSON for each, and prints the
table of all that it holds.
"""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import asdict, frozen

import afm_scan_ros as afm
from afm_scan_bench.accuracy.coverage import StatedInterval
from afm_scan_bench.any_lab.protocols import FAST, PROTOCOLS, taken, taken_with
from afm_scan_bench.any_lab.scanner import FAMILIES, DrawnScanner, draw
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.model import Status
from afm_scan_ros.report.table import Row, Table

SEEDS = range(200)
CLOSE = 1e-3
"""Relative error of a resonance that is as good as asked for."""

COLUMNS = {
    "protocol": ("records", ""),
    "cases": ("cases", "d"),
    "identified": ("identified", "d"),
    "refused": ("refused", "d"),
    "wrong": ("wrong, silently", "d"),
    "untold": ("fast record, resonance unknown", "d"),
    "resonances": ("resonances", "d"),
    "within": ("within 0.1 %", "d"),
    "inside": ("inside their interval", "d"),
    "inside_low": ("95 % of that share, from, %", ".1f"),
    "inside_high": ("to, %", ".1f"),
    "prediction_percent": ("fresh scan, median error, % of range", ".2f"),
    "gain_percent": ("by one gain", ".2f"),
    "seconds": ("CPU s, mean", ".1f"),
}


@frozen
class IdentificationOutcome:
    """What became of one case; ``refusal`` is the message, ``loops`` whether hysteresis is known.

    ``errors`` (relative) and ``inside`` are of the resonances stated, ``untold`` counts those that
    a fast record did not identify.
    """

    seed: int
    protocol: str
    family: str
    seconds: float
    refusal: str = ""
    errors: tuple[float, ...] = ()
    inside: tuple[bool, ...] = ()
    untold: int = 0
    prediction: float = 0.0
    by_gain: float = 0.0
    loops: bool = False

    @property
    def wrong(self) -> bool:
        """Whether something that the model states is wrong."""
        worse = self.loops and self.prediction > self.by_gain
        resonances = zip(self.errors, self.inside, strict=True)
        return worse or any(error > CLOSE and not inside for error, inside in resonances)


def measure() -> Table:
    """Draw, take the records, identify, and compare with the truth."""
    return table([case(seed) for seed in SEEDS])


def table(outcomes: Sequence[IdentificationOutcome]) -> Table:
    """Count outcomes, protocol by protocol and all together."""
    rows = [_row(name, [o for o in outcomes if o.protocol == name]) for name in PROTOCOLS]
    rows = [row for row in rows if row["cases"]] + [_row("all", outcomes)]
    return Table("any_lab", "Scanners and records drawn at random", COLUMNS, rows)


def resumed(results: Path, seeds: range) -> list[IdentificationOutcome]:
    """Try the seeds that a file of outcomes lacks, add them to it, and return all it holds."""
    held = results.read_text("utf-8").splitlines() if results.exists() else []
    found = [IdentificationOutcome(**json.loads(line)) for line in held]
    for seed in sorted(set(seeds) - {outcome.seed for outcome in found}):
        found.append(case(seed))
        with results.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(found[-1])) + "\n")
    return found


def case(seed: int) -> IdentificationOutcome:
    """One scanner, by the protocol and of the family whose turn it is."""
    rng = np.random.default_rng(seed)
    protocol = list(PROTOCOLS)[seed % len(PROTOCOLS)]
    family = FAMILIES[seed // len(PROTOCOLS) % len(FAMILIES)]
    scanner = draw(rng, family)
    records = taken(protocol, scanner, rng)
    begun = time.process_time()
    try:
        model = afm.identify(records)
    except (InputError, ScanError) as error:
        return IdentificationOutcome(
            seed, protocol, family, time.process_time() - begun, str(error)
        )
    seconds = time.process_time() - begun
    stated = [
        StatedInterval.of(model.effects[name].vibration, "resonance", axis.highest.frequency)
        for name, axis in zip(model.axes, scanner.axes, strict=True)
    ]
    known = [each for each in stated if each]
    prediction, by_gain = _fresh(model, scanner, _driven(records, scanner), rng)
    return IdentificationOutcome(
        seed,
        protocol,
        family,
        seconds,
        errors=tuple(abs(each.error) for each in known),
        inside=tuple(each.inside for each in known),
        untold=len(stated) - len(known) if set(PROTOCOLS[protocol]) & FAST else 0,
        prediction=prediction,
        by_gain=by_gain,
        loops=model.effects["x"].hysteresis.status is Status.IDENTIFIED,
    )


def _driven(records: list[afm.Record], scanner: DrawnScanner) -> tuple[float, float]:
    """Return the range (V) about the scanner's middle that both axes were driven over.

    The second axis goes the other way round.
    """
    drives = np.concatenate([record.drive for record in records]) - scanner.middle
    drives[:, 1:] *= -1.0
    return float(drives.min(axis=0).max()), float(drives.max(axis=0).min())


def _fresh(
    model: afm.Model,
    scanner: DrawnScanner,
    ends: tuple[float, float],
    rng: np.random.Generator,
) -> tuple[float, float]:
    """Error of a triangle over 0.6 of a range (V), at a rate no record has, % rms of its range.

    The second is that of the one gain that fits the triangle best.
    """
    rate = scanner.resonance / 400.0 * 4000.0
    seconds = np.arange(8000) / rate
    phase = (seconds * scanner.resonance / 600.0) % 1.0
    cycle = np.interp(phase, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    half, middle = 0.3 * (ends[1] - ends[0]), 0.5 * (ends[1] + ends[0])
    shape = (middle + half * cycle) / scanner.swing
    shape = np.concatenate([np.linspace(0.0, shape[0], 400), shape])
    record = taken_with(scanner, ("fresh", shape, rate), rng)
    moved = record.displacement[:, 0]
    predicted = model.predict(record.drive, record.sample_period)[:, 0]
    line = np.polyval(np.polyfit(record.drive[:, 0], moved, 1), record.drive[:, 0])
    span = float(np.ptp(moved))
    error, by_line = (100.0 * float(np.std(moved - each)) / span for each in (predicted, line))
    return error, by_line


def _row(protocol: str, outcomes: Sequence[IdentificationOutcome]) -> Row:
    done = [o for o in outcomes if not o.refusal]
    errors = [error for o in done for error in o.errors]
    inside = sum(sum(o.inside) for o in done)
    low, high = wilson(inside, len(errors))
    return {
        "protocol": protocol,
        "cases": len(outcomes),
        "identified": sum(not o.wrong for o in done),
        "refused": len(outcomes) - len(done),
        "wrong": sum(o.wrong for o in done),
        "untold": sum(o.untold for o in done),
        "resonances": len(errors),
        "within": sum(error <= CLOSE for error in errors),
        "inside": inside,
        "inside_low": 100.0 * low,
        "inside_high": 100.0 * high,
        "prediction_percent": float(np.median([o.prediction for o in done] or [np.nan])),
        "gain_percent": float(np.median([o.by_gain for o in done] or [np.nan])),
        "seconds": float(np.mean([o.seconds for o in outcomes] or [np.nan])),
    }


def wilson(successes: int, of: int) -> tuple[float, float]:
    """95 % interval of a share (E. B. Wilson, J. Am. Stat. Assoc. 22, 209, 1927)."""
    if not of:
        return 0.0, 1.0
    z, share = 1.959964, successes / of
    middle = (share + z**2 / (2 * of)) / (1 + z**2 / of)
    half = z * np.sqrt(share * (1 - share) / of + z**2 / (4 * of**2)) / (1 + z**2 / of)
    return float(middle - half), float(middle + half)


if __name__ == "__main__":
    file, first, last = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    counted = table(resumed(file, range(first, last)))
    counted.show()
    counted.save(file.parent)
