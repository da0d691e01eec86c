"""Diagnoses of scanners drawn at random, from records drawn at random.

Each case draws a scanner of one axis without hum, takes calibration records by one of four
protocols, and half the time two ordinary scans of the healthy scanner. Three scans of the healthy
scanner are diagnosed, and one with an effect. The effect adds 1 to 20 times the detection limit of
the first healthy scan, whose drive it has. An effect that no size makes so large gives its turn to
the next one; where none is so large, all are tried at a quarter of it, and so on. Of eight cases
one has two effects of this size, and one an effect that the catalogue does not hold.

    python -m afm_scan_bench.any_lab.diagnoses RESULTS FIRST LAST

tries those seeds that the file RESULTS does not hold, adds a line of JSON for each, and prints what
the file holds.
"""

import json
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from attrs import asdict, evolve, field, frozen
from scipy.optimize import brentq

import afm_scan_ros as afm
from afm_scan_bench.any_lab.effects import (
    EFFECTS,
    EVERY,
    UNKNOWN,
    Course,
    DrawnEffect,
    course_of,
)
from afm_scan_bench.any_lab.protocols import Drive, raised, taken
from afm_scan_bench.any_lab.scanner import DRAWN_FOR, FAMILIES, DrawnScanner, draw
from afm_scan_bench.diagnosis.unmodelled.summary import counted
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

FULL = ("curves and sweep", "steps, multisine, curves", "steps, sweep, scans", "noise and loops")
"""Protocols that tell hysteresis and resonance."""
UNTOLD = "steps, multisine, curves"
"""That which tells no model discrepancy."""
HEALTHY = 3
SMALLEST, GROWTH, PRECISION = 1e-7, 1.5, 1e-3
"""Of the search for an effect's size: its start, its steps, and its precision."""
TIMES = 1.0, 20.0
"""Rms that an effect adds over the detection limit."""
MOST = 0.3
"""Share of the motion that an effect adds at most."""
CLEAR, AGAIN = 3.0, 1.2
"""Times the detection limit from which an effect is to be named, and times the healthy residual to
which its name is to lower it."""
BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0)

RESULTS = {
    "named": "named",
    "partly": "one of two named",
    "credible": "ambiguous, the truth in the credible set",
    "uncovered": "ambiguous, the truth not in it",
    "unexplained": "unexplained",
    "missed": "sufficient or insufficient",
    "wrong": "a wrong name with confidence",
}
COLUMNS = {
    "effect": ("effect", ""),
    "cases": ("cases", "d"),
    "clear": ("from 3 limits on", "d"),
    **{name: (text, "d") for name, text in RESULTS.items()},
    "seconds": ("CPU s, median", ".0f"),
}


@frozen
class Said:
    """A diagnosis of one axis: verdict, names that it states, and probabilities by set.

    ``limit``, ``before`` and ``after`` are rms in m, ``seconds`` those of the processor.
    """

    verdict: str
    stated: str
    probabilities: dict[str, float]
    limit: float
    before: float
    after: float
    seconds: float

    def credible(self, share: float) -> list[set[str]]:
        """The most probable sets of effects, which hold a share of the probability together."""
        ranked = sorted(self.probabilities.items(), key=lambda each: -each[1])
        reached = np.cumsum([probability for _, probability in ranked])
        return [names_of(name) for name, _ in ranked[: 1 + int(np.searchsorted(reached, share))]]

    def of_effect(self, name: str) -> float:
        """Probability of an effect, alone or beside others."""
        return sum(p for names, p in self.probabilities.items() if name in names_of(names))


def names_of(joined: str) -> set[str]:
    """Names that are joined by " + "; "none" is none."""
    return set(joined.split(" + ")) - {"none", ""}


@frozen
class Outcome:
    """What became of one case; ``times`` is the effect's size over the detection limit.

    ``known_scans`` of the healthy scanner were given, ``said`` is of the effect where not refused.
    """

    seed: int
    family: str
    protocol: str
    resonance: float
    reach: float
    known_scans: int
    refusal: str = ""
    effect: str = ""
    times: float = 0.0
    healthy: tuple[Said, ...] = ()
    said: Said | None = None
    seconds: float = field(default=0.0)

    @property
    def truth(self) -> set[str]:
        """Names of the effects in the catalogue, or "outside"."""
        return {EVERY[name].name for name in names_of(self.effect)}

    @property
    def result(self) -> str:
        """Return what was said of the effect: one of ``RESULTS``."""
        if self.said is None:
            return "refused"
        stated = names_of(self.said.stated)
        if self.said.verdict == "effect_found":
            return "named" if stated == self.truth else "partly" if stated < self.truth else "wrong"
        if self.said.verdict == "ambiguous":
            return "credible" if self.truth in self.said.credible(0.95) else "uncovered"
        return "unexplained" if self.said.verdict == "unexplained" else "missed"


@frozen(eq=False)
class Laboratory:
    """A drawn scanner, what is drawn of it, and the model that came of its records."""

    scanner: DrawnScanner
    model: afm.Model
    rng: np.random.Generator
    known: tuple[afm.Record, ...] = ()

    def scan(self) -> Drive:
        """Draw triangles: their size, their rate, and how many."""
        speed = self.scanner.resonance / 400.0 * 10.0 ** self.rng.uniform(-0.3, 0.7)
        rate, cycles = 10.0 * self.scanner.resonance, int(self.rng.integers(3, 9))
        phase = (speed * np.arange(round(cycles * rate / speed)) / rate) % 1.0
        cycle = np.interp(phase, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
        return "scan", float(self.rng.uniform(0.3, 0.8)) * cycle, rate

    def record(self, moved: Array, drive: Array, rate: float) -> afm.Record:
        """Measure a displacement (n,) in m under a drive (n,) in V."""
        noise = self.scanner.noise * self.rng.standard_normal(len(moved))
        seen = (moved + noise)[:, np.newaxis]
        name = f"scan {self.rng.integers(2**31)}"
        return afm.Record(
            drive[:, np.newaxis], seen, 1.0 / rate, axes=("x",), start="depolarised", name=name
        )

    def driven(self, drive: Drive) -> tuple[Array, Course]:
        """Voltages (n,) of a drive, and the course of the scanner under them."""
        _, shape, rate = drive
        volts = raised(self.scanner.swing * shape, self.scanner.middle)
        return volts, course_of(self.scanner, 1.0 / rate, len(volts), float(self.rng.random()))

    def healthy_record(self, drive: Drive) -> afm.Record:
        """Record a scan of the healthy scanner."""
        volts, course = self.driven(drive)
        return self.record(course.moved(self.scaled(volts)), volts, drive[2])

    def scaled(self, volts: Array) -> Array:
        """Drive scaled to that of the operators."""
        return np.asarray(DRAWN_FOR / self.scanner.upper * volts)

    def diagnosed(self, record: afm.Record) -> Said:
        """Diagnose one record."""
        begun = time.process_time()
        found = afm.diagnose(self.model, [record], self.known)
        report = found.residual_report.diagnosis
        return Said(
            found.verdict,
            " + ".join(sorted(effect.name for effect in found.effects)),
            found.probabilities["x"],
            report.noise_floor["x"],
            report.rms_before["x"],
            report.rms_after["x"],
            time.process_time() - begun,
        )


def case(seed: int) -> Outcome:
    """Draw, calibrate, and diagnose healthy scans and one with an effect."""
    rng, scanner, protocol, known = drawn(seed)
    base = Outcome(
        seed,
        FAMILIES[seed % len(FAMILIES)],
        protocol,
        scanner.resonance,
        2.0 * DRAWN_FOR * scanner.axes[0].gain,
        known,
    )
    begun = time.process_time()
    try:
        laboratory = calibrated(rng, scanner, protocol, known)
        drives = [laboratory.scan() for _ in range(HEALTHY)]
        healthy = tuple(laboratory.diagnosed(laboratory.healthy_record(each)) for each in drives)
        effect, times, record = with_effect(laboratory, seed, drives[0], healthy[0].limit)
        said = laboratory.diagnosed(record)
    except (InputError, ScanError) as error:
        return evolve(base, refusal=str(error), seconds=time.process_time() - begun)
    spent = time.process_time() - begun
    return evolve(base, effect=effect, times=times, healthy=healthy, said=said, seconds=spent)


def drawn(seed: int) -> tuple[np.random.Generator, DrawnScanner, str, int]:
    """Draw a scanner of one axis, its protocol, and how many healthy scans are known."""
    rng = np.random.default_rng((2026, seed))
    family, protocol = FAMILIES[seed % len(FAMILIES)], FULL[seed // len(FAMILIES) % len(FULL)]
    scanner = draw(rng, family)
    scanner = evolve(scanner, axes=scanner.axes[:1], hum=(50.0, 0.0))
    return rng, scanner, protocol, 2 * int(rng.integers(2) or protocol == UNTOLD)


def calibrated(
    rng: np.random.Generator, scanner: DrawnScanner, protocol: str, known: int
) -> Laboratory:
    """Take calibration records, identify, and take the healthy scans that are known."""
    records = taken(protocol, scanner, rng)
    laboratory = Laboratory(scanner, afm.identify(records, order=None), rng)
    scans = tuple(laboratory.healthy_record(laboratory.scan()) for _ in range(known))
    return evolve(laboratory, known=scans)


def with_effect(
    laboratory: Laboratory, seed: int, drive: Drive, limit: float
) -> tuple[str, float, afm.Record]:
    """Record a scan with the effects whose turn it is, or the next that can be so large.

    Returns their names, their size over the detection ``limit`` (m), and the record.
    """
    sized = float(np.exp(laboratory.rng.uniform(*np.log(TIMES))))
    volts, course = laboratory.driven(drive)
    scaled, turn = laboratory.scaled(volts), seed // 3
    for less, step in product((1.0, 4.0, 16.0, 64.0, 256.0), range(len(EFFECTS))):
        names, times = _names(seed, turn + step), sized / less
        added = [_added(EVERY[name], course, scaled, times * limit) for name in names]
        if all(each is not None for each in added):
            moved = course.moved(scaled) + sum(each for each in added if each is not None)
            return " + ".join(names), times, laboratory.record(moved, volts, drive[2])
    raise ScanError("no effect adds as much as was drawn")


def _names(seed: int, turn: int) -> tuple[str, ...]:
    """One effect; two in the seventh case of eight; one that is not known in the eighth."""
    known, unknown = list(EFFECTS), list(UNKNOWN)
    first, second = known[turn % len(known)], known[(turn + 1 + seed % 7) % len(known)]
    if seed % 8 == 7:  # noqa: PLR2004 - the eighth
        return (unknown[turn % len(unknown)],)
    pair = seed % 8 == 6 and EFFECTS[first].name != EFFECTS[second].name  # noqa: PLR2004
    return (first, second) if pair else (first,)


def _added(effect: DrawnEffect, course: Course, drive: Array, goal: float) -> Array | None:
    """What the least size of an effect adds (m) whose rms is ``goal`` (m), where there is one."""
    healthy = course.moved(drive)
    if goal > MOST * float(np.std(healthy)):
        return None

    def missing(size: float) -> float:
        return float(np.std(effect.change(course, drive, size) - healthy)) - goal

    size = SMALLEST
    while missing(GROWTH * size) < 0.0:
        size *= GROWTH
        if size > effect.largest:
            return None
    found = brentq(missing, size, GROWTH * size, rtol=PRECISION)
    return effect.change(course, drive, float(found)) - healthy


def resumed(results: Path, seeds: range) -> list[Outcome]:
    """Try the seeds that a file of outcomes lacks, add them to it, and return all it holds."""
    held = results.read_text("utf-8").splitlines() if results.exists() else []
    found = [_read(json.loads(line)) for line in held]
    for seed in sorted(set(seeds) - {outcome.seed for outcome in found}):
        found.append(case(seed))
        with results.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(found[-1])) + "\n")
    return found


def _read(row: dict[str, object]) -> Outcome:
    said, healthy = row.pop("said"), row.pop("healthy")
    outcome = Outcome(**row)  # type: ignore[arg-type]
    if said is None:
        return outcome
    return evolve(outcome, said=Said(**said), healthy=tuple(Said(**each) for each in healthy))  # type: ignore[arg-type,attr-defined]


def table(outcomes: Sequence[Outcome]) -> Table:
    """Count by effect, with a summary in the title."""
    done = [o for o in outcomes if o.said]
    single = {name: [o for o in done if o.effect == name] for name in EVERY}
    groups = {**single, "two effects": [o for o in done if " + " in o.effect], "all": done}
    rows = [_row(name, some) for name, some in groups.items() if some]
    return Table("diagnoses", "\n".join(_title(outcomes, done)), COLUMNS, rows)


def _row(effect: str, outcomes: Sequence[Outcome]) -> Row:
    results = [o.result for o in outcomes if o.times >= CLEAR]
    counts = {name: results.count(name) for name in RESULTS}
    counts["wrong"] = sum(o.result == "wrong" for o in outcomes)
    seconds = float(np.median([o.said.seconds for o in outcomes if o.said]))
    sizes = {"cases": len(outcomes), "clear": len(results)}
    return {"effect": effect, **sizes, **counts, "seconds": seconds}


def _title(outcomes: Sequence[Outcome], done: Sequence[Outcome]) -> Iterator[str]:
    yield "Diagnoses of scanners and records drawn at random"
    yield counted("refused", len(outcomes) - len(done), len(outcomes))
    healthy = [said for o in done for said in o.healthy]
    for verdict in ("effect_found", "ambiguous", "unexplained"):
        found = sum(said.verdict == verdict for said in healthy)
        yield counted(f"a healthy scan called {verdict}", found, len(healthy))
    floors = [said.limit / said.before for said in healthy]
    yield f"detection limit over what healthy scans leave: median {np.median(floors):.2f}"
    yield from _after(done)
    yield from _coverage(done)
    pairs = [(p, n in o.truth) for o in done for n, p in _stated(o)]
    for low, high in pairwise(BINS):
        inside = [true for p, true in pairs if low < p <= high]
        mean = np.mean([p for p, _ in pairs if low < p <= high]) if inside else 0.0
        if inside:
            yield counted(f"there, at a mean probability of {mean:.2f}", sum(inside), len(inside))


def _after(done: Sequence[Outcome]) -> Iterator[str]:
    """Residual with the named effects over that of the healthy scan of the same drive."""
    left = [o.said.after / o.healthy[0].before for o in done if o.said and o.result == "named"]
    yield counted(
        "named, residual after at most 1.2 of healthy", sum(np.array(left) <= AGAIN), len(left)
    )


def _coverage(done: Sequence[Outcome]) -> Iterator[str]:
    sets = [(o, o.said.credible(0.9)) for o in done if o.said and o.times >= CLEAR]
    covered = sum(o.truth in credible for o, credible in sets)
    yield counted("from 3 limits on, the truth in the 90 % credible set", covered, len(sets))
    if sets:
        yield f"sets in it: mean {np.mean([len(credible) for _, credible in sets]):.2f}"


def _stated(outcome: Outcome) -> Iterator[tuple[str, float]]:
    said = outcome.said
    names = {n for names in said.probabilities for n in names_of(names)} if said else set()
    for name in sorted(names):
        yield name, said.of_effect(name) if said else 0.0


if __name__ == "__main__":
    file, first, last = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    summary = table(resumed(file, range(first, last)))
    summary.show()
    summary.save(file.parent)
