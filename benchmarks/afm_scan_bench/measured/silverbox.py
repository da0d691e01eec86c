"""The closed loop on the Silverbox: a linear model, what its structure lacks, the error after."""

from functools import cached_property, partial

import numpy as np
import scipy
from attrs import frozen
from matplotlib.figure import Figure

import afm_scan_ros as afm
from afm_scan_bench.measured.recordings import measured_data
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.picture import BLUE, LIGHT_ORANGE
from afm_scan_ros.report.table import Row, Table

SAMPLE_RATE = 610.35
MOVED = 1e-6
"""m for each V of the output, so that a model of displacement is one of it."""
REST = 0.0062
"""V; the input at rest between the realisations."""
ARROW, MULTISINE = slice(150, 40_575), slice(105_762, 127_400)
"""The parts left out, as nonlinearbenchmark.org splits the record, without their first 50 samples,
which initialise a state."""
STARTS = (
    *(40_580, 49_270, 57_964, 66_660, 75_350),
    *(84_040, 92_735, 101_425, 110_118, 118_810, 127_505),
)
"""Samples at rest before each of ten realisations of the multisine, and after the last."""
LEFT_OUT = {"arrow": ARROW, "multisine": MULTISINE}
FARTHER = 0.6
"""The arrow reaches half as far again as the multisine."""
COLUMNS = {
    "model": ("model", ""),
    "arrow_mv": ("arrow, mV", ".2f"),
    "multisine_mv": ("multisine, mV", ".2f"),
}


@frozen(eq=False, slots=False)
class SilverboxLoop:
    """The models of the Silverbox, and what they leave of the parts that are left out."""

    @cached_property
    def signals(self) -> tuple[Array, Array]:
        """Input (V) less its rest, and output (m)."""
        found = scipy.io.loadmat(measured_data("silverbox/SNLS80mV.mat"))
        drive, moved = (found[name].ravel().astype(float) for name in ("V1", "V2"))
        return drive - REST, MOVED * moved

    def record(self, first: int, last: int, name: str, kind: str | None = None) -> afm.Record:
        """Return the realisations from one to before another."""
        part = slice(STARTS[first], STARTS[last])
        drive, moved = (signal[part] for signal in self.signals)
        given = drive, moved, 1.0 / SAMPLE_RATE
        return afm.Record(
            *given, kind=kind, start="depolarised", intersample="band_limited", name=name
        )

    @cached_property
    def linear(self) -> afm.Model:
        """Linear model of the first four realisations; the fifth is held out."""
        held_out = self.record(4, 5, "realisation 5", "validation")
        return afm.identify([self.record(0, 4, "realisations 1 to 4"), held_out], linear=True)

    @cached_property
    def found(self) -> afm.Diagnosis:
        """What the structure of the linear model lacks, by the next two realisations."""
        records = [self.record(5, 6, "realisation 6"), self.record(6, 7, "realisation 7")]
        return afm.diagnose(self.linear, records, structure=True)

    def left(self, model: afm.Model, part: slice) -> Array:
        """Return what a model leaves (V) of a part, predicted from the rest before it."""
        begun = max((start for start in STARTS if start < part.start), default=0)
        drive, moved = (signal[begun : part.stop] for signal in self.signals)
        given = drive, 1.0 / SAMPLE_RATE
        error = moved - model.predict(*given, beyond=FARTHER, intersample="band_limited")
        error = error[part.start - begun :]
        return np.asarray((error - error.mean()) / MOVED)


def measure() -> Table:
    """Identify, diagnose, and score both models on the arrow and on two realisations."""
    study = SilverboxLoop()
    models = ("linear", study.linear), ("extended by the diagnosis", study.found.model)
    rows = [_row(study, *each) for each in models]
    return Table("silverbox", _title(study), COLUMNS, rows, picture=partial(figure, study))


def _row(study: SilverboxLoop, name: str, model: afm.Model) -> Row:
    scores = {
        f"{part}_mv": 1e3 * float(np.std(study.left(model, samples)))
        for part, samples in LEFT_OUT.items()
    }
    return {"model": name, **scores}


def _title(study: SilverboxLoop) -> str:
    found, values = study.found, []
    for effect in found.effects:
        for value in effect.values:
            ends = [f"{end:.3g}" for end in value.interval]
            unit = value.parameter.unit
            values.append(f"{value.parameter.name} {value.value:.4g} ({' to '.join(ends)}) {unit}")
    named = ", ".join(f"{effect.name}, P = {effect.probability:.4f}" for effect in found.effects)
    return (
        "Silverbox (T. Wigren and J. Schoukens, ECC 2013, pp. 2933-2938): rms of the error, its"
        " mean removed, of the arrow and of the multisine as nonlinearbenchmark.org splits them."
        f" {found.verdict}: {named}; {', '.join(values)}"
    )


@styled
def figure(study: SilverboxLoop) -> Figure:
    """What both models leave of the arrow, along it."""
    drawn = Figure(figsize=(9.6, 3.4), dpi=120, layout="constrained")
    axes = drawn.add_subplot()
    seconds = np.arange(ARROW.start, ARROW.stop) / SAMPLE_RATE
    models = (study.linear, LIGHT_ORANGE, "linear"), (study.found.model, BLUE, "extended")
    for model, colour, name in models:
        left = study.left(model, ARROW)
        label = f"{name}: {1e3 * left.std():.2f} mV rms"
        axes.plot(seconds, 1e3 * left, color=colour, lw=0.6, label=label)
    axes.set(
        title="Silverbox: error on the arrow, which neither model was fitted to",
        xlabel="time in s",
        ylabel="error in mV",
    )
    axes.legend(loc="upper left")
    return drawn
