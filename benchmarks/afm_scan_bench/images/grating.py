"""Tube scanners without a sensor: what one image pair of a grating, or two, teach of them.

Each of the scanners, gratings and images is drawn from a seed. The image counts by its places: the
rms error of a distance of one pitch, over the image, in x and in y; and the distance in x at which
a place shows in trace and in retrace. The model counts by the true error of x of scans with its
inverse, rms at constant speed. Each figure also stands for the controller's own sensitivity, and
for the one gain that fits best.

    python -m afm_scan_bench.images.grating RESULTS FIRST LAST

tries those seeds that the file RESULTS does not hold, adds a line of JSON for each outcome, and
prints the table of all that it holds.
"""

import json
import sys
from collections.abc import Sequence
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np
from attrs import asdict
from matplotlib.figure import Figure

from afm_scan_bench.images.outcomes import FIGURES, VARIANTS, Outcome, outcomes
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.picture import GREY
from afm_scan_ros.report.table import Row, Table

SEEDS = range(50)

COLUMNS = {
    "images": ("images", ""),
    "figure": ("rms of", ""),
    "scanners": ("scanners", "d"),
    "refused": ("refused, %", ".0f"),
    "without": ("an image not used, %", ".0f"),
    "plain": ("uncorrected, median", ".2f"),
    "linear": ("by one gain", ".2f"),
    "median": ("found, median", ".3f"),
    "most": ("90 %", ".3f"),
    "worst": ("worst", ".3f"),
    "target": ("target", ".2f"),
    "within": ("of those found within, %", ".0f"),
    "failed": ("scan refused", "d"),
    "left_out": ("lines left out, %", ".1f"),
    "seconds": ("CPU s a pair", ".1f"),
}


def measure() -> Table:
    """Draw, take the images, identify, and compare with the truth."""
    return table(list(chain.from_iterable(outcomes(seed) for seed in SEEDS)))


def table(found: Sequence[Outcome]) -> Table:
    """Sum up outcomes, choice of images by choice of images and figure by figure."""
    rows = [
        _row(variant, name, [each for each in found if each.variant == variant])
        for variant in VARIANTS
        for name in FIGURES
    ]
    title = "Scanners without a sensor, from images of a grating"
    return Table("grating", title, COLUMNS, rows, partial(shares, found))


def _row(variant: str, name: str, every: Sequence[Outcome]) -> Row:
    heading, target = FIGURES[name]
    done = [each for each in every if not each.refusal]
    errors = np.array([each.found[name] for each in done])
    known = errors[np.isfinite(errors)]
    median, most, worst = np.quantile(known, [0.5, 0.9, 1.0]) if known.size else [np.nan] * 3
    return {
        "images": variant,
        "figure": heading,
        "scanners": len(every),
        "refused": 100.0 * (1.0 - len(done) / len(every)) if every else np.nan,
        "without": 100.0 * sum(bool(each.not_used) for each in done) / max(1, len(every)),
        "plain": _median([each.plain[name] for each in every]),
        "linear": _median([each.linear[name] for each in every]),
        "median": float(median),
        "most": float(most),
        "worst": float(worst),
        "target": target,
        "within": 100.0 * float(np.mean(errors <= target)) if done else np.nan,
        "failed": len(errors) - len(known),
        "left_out": _median([each.left_out for each in done]),
        "seconds": _median([each.seconds for each in every]),
    }


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if len(values) else np.nan


@styled
def shares(found: Sequence[Outcome]) -> Figure:
    """Draw the share of all scanners that is within an error, a panel for each figure."""
    figure = Figure(figsize=(12.8, 9.6), dpi=150, layout="constrained")
    figure.suptitle("Share of the drawn scanners whose error is at most", x=0.01, ha="left")
    for i, (name, (heading, target)) in enumerate(FIGURES.items(), start=1):
        axes = figure.add_subplot(3, 4, i)
        axes.axvline(target, color=GREY)
        first = [each for each in found if each.variant == next(iter(VARIANTS))]
        for label, values in {
            "uncorrected": [each.plain[name] for each in first],
            "by one gain": [each.linear[name] for each in first],
            **{v: [each.found[name] for each in found if each.variant == v] for v in VARIANTS},
        }.items():
            axes.step(*_share(values), where="post", label=label)
        axes.set_xscale("log")
        axes.set_ylim(0.0, 1.0)
        axes.set_xlabel(heading)
        if i == 1:
            axes.legend()
    return figure


def _share(values: Sequence[float]) -> tuple[Array, Array]:
    """Errors in order and the share of all values that is as low; refused ones never are."""
    known = np.sort([value for value in values if np.isfinite(value)])
    return known, (np.arange(known.size) + 1.0) / max(1, len(values))


def resumed(results: Path, seeds: range) -> list[Outcome]:
    """Try the seeds that a file of outcomes lacks, add them to it, and return all it holds."""
    held = results.read_text("utf-8").splitlines() if results.exists() else []
    found = [Outcome(**json.loads(line)) for line in held]
    for seed in sorted(set(seeds) - {outcome.seed for outcome in found}):
        new = list(outcomes(seed))
        with results.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(asdict(each)) + "\n" for each in new)
        found += new
    return found


if __name__ == "__main__":
    file, first, last = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    counted = table(resumed(file, range(first, last)))
    counted.show()
    counted.save(file.parent)
