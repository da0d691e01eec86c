"""How fast hysteresis and its two inverses are, as ratios."""

from collections.abc import Callable, Iterator

import numpy as np
from attrs import frozen

from afm_scan_bench.scans import SEED, default_model
from afm_scan_bench.speed.timing.chain import chain_of_inverses, long_scan
from afm_scan_bench.speed.timing.race import Task, race
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import DirectInverse, Preisach
from afm_scan_ros.core.trajectory import desired
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row

WHITE = 3.5  # V, to either side
NOISE = 0.01  # V rms, three times the scan's own step from sample to sample


@frozen(eq=False)
class Way:
    """An operator, what is put into it, and how many times interp's cost it may have."""

    name: str
    run: Callable[[], object]
    given: Array
    target: str


def rows(samples: int, relayed: int, turns: int) -> Iterator[Row]:
    """Race each operator over each input, ``relayed`` samples of it through relays."""
    surface = default_model().axis("x").hysteresis.surface
    for kind, drive in drives(samples).items():
        relays = _relays(surface, drive[:relayed])
        for way in ways(drive):
            ours, name = Task(way.run, samples), f"{way.name}, {kind}"
            interp = _interp(way.given, len(surface.levels))
            yield race(name, ours, "numpy.interp of the same array", interp, way.target, turns)
            yield race(name, ours, "51 by 51 relays in numpy", relays, "≥ 500", turns)


def _interp(given: Array, levels: int) -> Task:
    x = np.linspace(given.min(), given.max(), levels)
    return Task(lambda: np.interp(given, x, x**3), len(given))


def _relays(surface: EverettSurface, drive: Array) -> Task:
    return Task(lambda: relay_grid(surface, drive), len(drive))


def drives(samples: int) -> dict[str, Array]:
    """Drives (V) of a scan, of a scan with noise on it, and of noise alone, all (samples,)."""
    rng = np.random.default_rng(SEED)
    scan = chain_of_inverses().whole(desired(long_scan(), 0, samples)).x
    return {
        "scan": scan,
        "noisy scan": scan + NOISE * rng.standard_normal(samples),
        "white noise": rng.uniform(-WHITE, WHITE, samples),
    }


def ways(drive: Array) -> Iterator[Way]:
    """Yield each operator on a drive, or on the effective input that it makes."""
    hysteresis = default_model().axis("x").hysteresis
    forward, direct = Preisach(hysteresis.surface), DirectInverse(hysteresis.direct)
    effective = forward.apply(forward.at_rest(), drive)[1]
    limits = hysteresis.direct.lower, hysteresis.direct.upper
    inside = np.clip(effective, *limits)
    memory, table = forward.at_rest(), direct.inverse_at_rest()
    yield Way("forward", lambda: forward.apply(memory, drive), drive, "≤ 2")
    yield Way("table inverse", lambda: direct.invert(table, inside), inside, "≤ 2")
    yield Way("exact inverse", lambda: forward.invert(memory, effective), effective, "≤ 6")


def relay_grid(surface: EverettSurface, drive: Array) -> Array:
    """Outputs (V) of a plain sum over relays, all down at first; on the levels the model itself.

    One relay stands in the middle of each cell; it weighs what E gains there.
    """
    middles = surface.levels + 0.5 * (surface.levels[1] - surface.levels[0])
    up, down = np.meshgrid(middles, middles, indexing="ij")
    gained = np.diff(-np.diff(np.tril(surface.values), axis=1), axis=0)
    weights = np.pad(np.tril(gained), ((0, 1), (0, 1)))
    state, outputs = -np.ones_like(weights), np.empty_like(drive)
    for k, u in enumerate(drive):
        state[up < u] = 1.0
        state[down > u] = -1.0
        outputs[k] = np.sum(weights * state)
    return outputs + 0.5 * (surface.output_lower + surface.output_upper)
