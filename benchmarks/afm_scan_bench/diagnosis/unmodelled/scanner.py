"""A scanner drawn afresh, and the model that was identified on it while it was healthy."""

from functools import lru_cache

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.diagnosis.unmodelled.cases import UnmodelledCase
from afm_scan_bench.draw import drawn
from afm_scan_bench.in_process import calibrate_in_process
from afm_scan_bench.scans import default_plant
from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.identification.identify import identify_records
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import ScannerModel, band_edges
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec

CARRIED = 0.9
"""Share of an effect's mean square that lies in what is called its bands."""


@lru_cache(maxsize=1)
def healthy_scanner(seed: int, noise: float) -> tuple[PlantSpec, ScannerModel]:
    """Scanner that a seed draws, its sensor ``noise`` times as noisy, and its model."""
    plant = drawn(default_plant(), np.random.default_rng(seed))
    sensor = evolve(plant.sensor, noise_rms=noise * plant.sensor.noise_rms)
    plant = evolve(plant, sensor=sensor)
    records = calibrate_in_process(plant, seed)
    return plant, identify_records(list(records.values())).model


@frozen(eq=False)
class Size:
    """Rms (m) of the effects on a scan, and of the residual without them.

    ``residual`` is taken in the effects' bands alone, the fewest that hold most of their power.
    """

    added: float
    residual: float

    @property
    def ratio(self) -> float:
        """Effect over residual."""
        return self.added / self.residual


def size_of(case: UnmodelledCase, healthy: PlantSpec, model: ScannerModel, done: Scan) -> Size:
    """Compare a scan with the same drive on the healthy scanner."""
    period = done.spec.sample_period
    bands = band_edges(period, resonance_of(model.axis(case.axis).vibration, period))
    measured, true = Piezoscanner(healthy, period, case.seed).advance(done.drive)
    added = done.true.axis(case.axis) - true.axis(case.axis)
    left = measured.axis(case.axis) - predict(model, done.drive).axis(case.axis)
    by_band, residual = (rms_by_band(s, bands, period) ** 2 for s in (added, left))
    loudest = np.argsort(by_band)[::-1]
    count = 1 + np.searchsorted(np.cumsum(by_band[loudest]), CARRIED * by_band.sum())
    powers = by_band.sum(), residual[loudest[:count]].sum()
    return Size(*(float(np.sqrt(each)) for each in powers))
