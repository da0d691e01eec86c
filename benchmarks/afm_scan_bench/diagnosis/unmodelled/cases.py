"""What ``afm-scan bench diagnosis_plants`` diagnoses: effects on scanners that are drawn afresh.

Which seeds belong to the development set, and which are held out, is in sets.py.
"""

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.mechanisms.product_sizes import EFFECTS, SIZES
from afm_scan_bench.mechanisms.sizes import ALL, PAIRS, sized
from afm_scan_bench.scans import spec_at
from afm_scan_ros.core.scan_spec import PATTERNS, ScanSpec
from afm_scan_ros.core.types import AXES
from afm_scan_ros.simulation.mechanisms.base import Mechanism

NOISES = (0.5, 1.0, 2.0)
"""Factors of the sensor's noise: of calibration and scan alike."""

RATE = 30.0
BETTER_AT = {
    "drift": 5.0,
    "slow_creep_logarithmic": 5.0,
    "slow_creep_single": 5.0,
    "slow_creep_solder": 5.0,
    "slow_creep_draining": 5.0,
    "parameter_shift_creep": 5.0,
    "drift_rod": 5.0,
    "drift_clamp": 5.0,
    "drift_regulated": 5.0,
    "fading_gain": 5.0,
    "extra_resonance_amplifier": 100.0,
    "extra_resonance_holder": 100.0,
    "extra_resonance_mirror": 100.0,
    "extra_resonance_cable": 100.0,
    "extra_resonance": 100.0,
    "parameter_shift_resonance": 100.0,
}
"""Line rate, Hz, at which an effect shows better than at ``RATE``: either may be drawn."""

EVERY = (*((name,) for name in EFFECTS), *PAIRS)
"""Effects of the product's plant files, alone and in pairs."""

LINES, IMAGE = (6, 16, 40), 256
"""Of a scan with an effect, of which six are for the most part a preparation, and of an image."""

HEALTHY_RATES = (5.0, 10.0, 30.0, 100.0)
SAMPLED_AS = {10.0: 5.0}
"""Line rates at which no figure is stated, and the one at whose sample rate they are scanned."""
HEALTHY_LINES = (6, 40, IMAGE)
AMPLITUDES = (10e-6, 40e-6)
"""m; the least and the largest range of a healthy scan."""


@frozen
class UnmodelledCase:
    """A scan of a scanner that ``plant`` draws, with effects (of ``ALL``) on one axis.

    ``seed`` is that of the scan's noise, ``noise`` the factor of the sensor's.
    """

    effects: tuple[str, ...]
    size: str
    axis: str
    plant: int
    noise: float
    spec: ScanSpec
    seed: int

    @property
    def mechanisms(self) -> tuple[Mechanism, ...]:
        """Mechanisms of the scanner."""
        return tuple(each for name in self.effects for each in sized(name, self.size, self.axis))

    @property
    def truth(self) -> frozenset[str | None]:
        """Names of the catalogued effects; None stands for one that is in no catalogue."""
        return frozenset(ALL[name].name for name in self.effects)

    @property
    def scanner(self) -> tuple[int, float]:
        """What distinguishes its healthy scanner from others."""
        return self.plant, self.noise


def effect_cases(
    first: int, sharing: int = 1, every: Sequence[tuple[str, ...]] = EVERY
) -> Iterator[UnmodelledCase]:
    """Effects and pairs at every size; ``sharing`` cases of a size follow on one plant."""
    for number, (size, effects) in enumerate(product(SIZES, every)):
        yield drawn_case(effects, size, first + number // sharing, number)


def image_cases(first: int, sharing: int) -> Iterator[UnmodelledCase]:
    """Single effects of a middling size, scanned for a whole image."""
    for number, name in enumerate(EFFECTS):
        case = drawn_case((name,), SIZES[1], first + number // sharing, number)
        yield evolve(case, spec=evolve(case.spec, lines=IMAGE))


def drawn_case(effects: tuple[str, ...], size: str, plant: int, number: int) -> UnmodelledCase:
    """Case of some effects; ``plant`` and ``number`` draw line rate, number of lines and noise."""
    rng = np.random.default_rng((plant, number))
    rates = (RATE, *(BETTER_AT[name] for name in effects if name in BETTER_AT))
    spec = evolve(spec_at(float(rng.choice(rates))), lines=int(rng.choice(LINES)))
    noise = NOISES[plant % len(NOISES)]
    return UnmodelledCase(effects, size, AXES[0], plant, noise, spec, seed=int(rng.integers(2**31)))


def healthy_cases(plants: Sequence[int], scans: int) -> Iterator[UnmodelledCase]:
    """Scans of scanners without an effect, of all patterns, line rates, lengths and ranges."""
    for plant in plants:
        rng = np.random.default_rng((plant, scans))
        for _ in range(scans):
            seed = int(rng.integers(2**31))
            yield UnmodelledCase(
                (), "", AXES[0], plant, NOISES[plant % len(NOISES)], _any_scan(rng), seed
            )


def _any_scan(rng: np.random.Generator) -> ScanSpec:
    rate, size = float(rng.choice(HEALTHY_RATES)), rng.uniform(*AMPLITUDES)
    known = spec_at(SAMPLED_AS.get(rate, rate))
    return evolve(
        known,
        pattern=str(rng.choice(PATTERNS)),
        line_rate=rate,
        lines=int(rng.choice(HEALTHY_LINES)),
        samples_per_line=round(known.samples_per_line * known.line_rate / rate),
        range_x=size,
        range_y=size,
    )
