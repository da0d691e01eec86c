"""Diagnosis of a micromanipulator whose base model is hysteresis alone.

Base model and candidates are fitted to the first file and the first 25.5 s of the second, each
without its transient. The rest of the second file and both transients are held out. Both files
begin after a long rest at 0 V, in negative saturation. So the model is driven from sample 0 on, and
the residual is taken after the transient.
"""

from functools import cached_property

import numpy as np
from attrs import define, evolve, frozen

from afm_scan_bench.measured.micromanipulator.diagnosis_density import Density, FitRecord
from afm_scan_bench.measured.micromanipulator.study import (
    FALLING,
    PERIOD,
    SAMPLE_RATE,
    SPAN,
    STEADY,
    columns,
)
from afm_scan_bench.measured.micromanipulator.transient import end_of_transient
from afm_scan_ros.core.bands import fast_length, rms_by_band
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis, diagnose_evidence
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit, detection_limit
from afm_scan_ros.core.diagnosis.evidence import STRETCHES, Evidence
from afm_scan_ros.core.diagnosis.playback import Playback
from afm_scan_ros.core.diagnosis.records import AxisSignals
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.model import AxisModel, CreepModel, HysteresisModel, VibrationModel
from afm_scan_ros.core.model_discrepancy import ModelDiscrepancy, band_edges
from afm_scan_ros.core.types import Array

T = 1.0 / SAMPLE_RATE
FAST = 2e-4
"""Time constant of the base model's vibration, s: at 200 Hz only the converter's hold."""
COARSE, EVERY = 12, 8
"""Cells per side, and decimation, of the density while candidates are tried."""


@frozen(eq=False)
class SteadyRecord:
    """The development part of one file: V and m, (n,); its transient has ``settling`` samples."""

    name: str
    drive: Array
    displacement: Array
    settling: int

    @property
    def judged(self) -> slice:
        """Samples after the transient, of a number that transforms fast."""
        return slice(self.settling, self.settling + fast_length(len(self.drive) - self.settling))

    def fitted(self, *, blocks: bool) -> FitRecord:
        """All after the transient, or only those blocks of it to which candidates are fitted."""
        fitted = np.zeros(len(self.drive), dtype=np.bool_)
        part = fitted[self.judged]
        part[:] = np.arange(len(part)) * STRETCHES // len(part) % 2 == 0 if blocks else True
        return FitRecord(self.drive, self.displacement, fitted, T)


@define(eq=False, kw_only=True)
class FromTheStart(Playback):
    """Plays the ``whole`` record with its density identified again, and returns one part of it."""

    whole: Playback
    part: slice
    density: Density

    def displacement(self, chain: Chain) -> Array:
        """Displacement (n,) in m of the part that is viewed."""
        played = self.whole.displacement(self.density.anew(chain))
        return played[self.part]


class ManipulatorDiagnosis:
    """The base model, the diagnosis of its residual, and models with hysteresis fitted again."""

    def __init__(self, cells: int = SPAN.cells) -> None:
        sine = columns("Model_Vi_Do.dat", 1, 5)
        test = columns("Test_Vi_Do_Di.dat", 1, 5)
        self.files = (sine[0], sine[1]), (test[0], test[1])
        drive, measured = (signal[: FALLING.samples.stop] for signal in test)
        self.records = (
            SteadyRecord("sine", *self.files[0], end_of_transient(sine[1], PERIOD)),
            SteadyRecord(
                "falling", drive, measured, end_of_transient(measured[STEADY.samples], PERIOD)
            ),
        )
        everything = [record.fitted(blocks=False) for record in self.records]
        self._finest = Density(everything, evolve(SPAN, cells=cells), every=2)
        blocks = [record.fitted(blocks=True) for record in self.records]
        self._coarse = Density(blocks, evolve(SPAN, cells=COARSE), every=EVERY)

    @cached_property
    def declared(self) -> Chain:
        """Hysteresis alone."""
        slope = np.tril(0.5 * np.subtract.outer(*2 * [np.linspace(SPAN.lower, SPAN.upper, 3)]))
        straight = EverettSurface(SPAN.lower, SPAN.upper, slope, 0.0)
        bare = AxisModel(
            HysteresisModel(straight, straight),
            VibrationModel((1.0,), (FAST, 1.0)),
            CreepModel((), ()),
        )
        return self._finest.anew(Chain(bare))

    @cached_property
    def diagnosis(self) -> AxisDiagnosis:
        """Diagnosis of the effects beyond hysteresis."""
        return diagnose_evidence("x", self.declared, self.evidence, lambda _: None)

    @cached_property
    def evidence(self) -> tuple[Evidence, ...]:
        """The records that candidates are fitted to and tested on."""
        return tuple(self._evidence(i, record) for i, record in enumerate(self.records))

    def learnt(self, chain: Chain) -> Chain:
        """Chain whose hysteresis is identified again from all development data."""
        return self._finest.anew(chain)

    def left(self, chain: Chain) -> tuple[Array, Array]:
        """Measured less predicted displacement (m) of both files, whole, from sample 0.

        The sensor's zero is arbitrary, so the mean over the development data is removed.
        """
        found = []
        for record, (drive, measured) in zip(self.records, self.files, strict=True):
            error = measured - moved(chain, drive)
            found.append(error - error[record.judged].mean())
        return found[0], found[1]

    def _evidence(self, number: int, record: SteadyRecord) -> Evidence:
        still = np.zeros_like(record.drive)
        view = AxisSignals(record.name, T, record.drive, record.displacement, still, number)
        drive, measured, rest = (s[record.judged] for s in (view.drive, view.measured, still))
        seen = AxisSignals(record.name, T, drive, measured, rest, number)
        playback = FromTheStart(
            view=seen, whole=Playback(view), part=record.judged, density=self._coarse
        )
        return Evidence(playback, self.limit(record))

    def limit(self, record: SteadyRecord) -> DetectionLimit:
        """Combine sensor noise, wander of the stage, and the difference of two fits.

        Both fits are of the base model: the coarse one to the fitting blocks, the finest to all.
        Neither contains an effect, so their difference is no effect.
        """
        measured, edges = record.displacement[record.judged], np.array(self._bands)
        coarse, fine = (
            moved(density.anew(self.declared), record.drive)[record.judged]
            for density in (self._coarse, self._finest)
        )
        noise, wander = self.unrepeated
        error = np.hypot(wander, rms_by_band(coarse - fine, edges, T))
        known = ModelDiscrepancy(record.name, edges, error, noise, rms_by_band(measured, edges, T))
        return detection_limit([known], measured, T, self._resonance)

    @property
    def _resonance(self) -> float:
        return resonance_of(self.declared.model.vibration, T)

    @property
    def _bands(self) -> tuple[float, ...]:
        return band_edges(T, self._resonance)

    @cached_property
    def unrepeated(self) -> tuple[Array, Array]:
        """Noise of the sensor, and wander of the stage, rms (bands,) in m.

        From half the power of the difference of neighbouring periods. Above 30 Hz, where the drive
        has no power, it is the sensor's white noise; the excess below is the wander of the stage.
        """
        steady = self.records[0].displacement[self.records[0].judged]
        edges = np.array(self._bands)
        found = rms_by_band((steady[PERIOD:] - steady[:-PERIOD]) / np.sqrt(2.0), edges, T)
        noise = found[-1] * np.sqrt(np.diff(edges) / (edges[-1] - edges[-2]))
        return noise, np.sqrt(np.maximum(found**2 - noise**2, 0.0))


def moved(chain: Chain, drive: Array) -> Array:
    """Displacement (n,) in m under a drive (n,) in V that begins at negative saturation."""
    forward = chain.forward(T)
    return np.asarray(forward.apply(forward.at_rest(), drive)[1])
