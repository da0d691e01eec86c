"""What any drive could reach that a scanner's amplifier gives, over the size of an effect."""

from collections.abc import Iterator
from math import hypot

from attrs import evolve, frozen

from afm_scan_bench.accuracy.learning import AXIS, error, learned
from afm_scan_bench.curve import TableCurve
from afm_scan_bench.mechanisms.product_sizes import SIZES, sized
from afm_scan_bench.scans import default_model, default_plant, spec_at
from afm_scan_bench.session import InProcessSession
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.closed_loop import FIRST
from afm_scan_ros.core.model import Added
from afm_scan_ros.report.table import Row, Table


@frozen
class Asked:
    """Effects (of ``sizes.EFFECTS``) from small to large, at line rates in Hz.

    ``known`` is what each size is to the catalogue, where that has the very equation.
    """

    effects: tuple[str, ...]
    rates: tuple[float, ...]
    known: tuple[tuple[Added, ...], ...] = ((), (), ())


PLAYS = tuple((Added("backlash", "", (width,)),) for width in (80e-9, 240e-9, 800e-9))
MASSES = tuple(
    (Added("extra_resonance", "absorber_mode", (mass, 800.0, 0.01)),) for mass in (0.05, 0.15, 0.5)
)
FILMS = tuple(
    (Added("rate_dependent_hysteresis", "film", (lag,)),) for lag in (30e-6, 90e-6, 300e-6)
)
ASKED = (
    Asked(("backlash",), (30.0, 100.0), PLAYS),
    Asked(("extra_resonance",), (100.0,), MASSES),
    Asked(("rate_dependent_hysteresis",), (30.0,), FILMS),
    Asked(
        ("extra_resonance", "rate_dependent_hysteresis"),
        (30.0,),
        tuple(mass + film for mass, film in zip(MASSES, FILMS, strict=True)),
    ),
    Asked(("hysteretic_stiffness",), (30.0,)),
    Asked(("cross_coupling_mode", "hysteretic_stiffness"), (30.0,)),
)

COLUMNS = {
    "effect": ("effect", ""),
    "line_rate_hz": ("lines a second", ".0f"),
    "size": ("size", ""),
    "healthy_nm": ("without it, nm", ".1f"),
    "ignored_nm": ("effect ignored, nm", ".0f"),
    "began_nm": ("first scan, nm", ".1f"),
    "learnt_nm": ("learned, nm", ".1f"),
    "began_ratio": ("first scan", ".2f"),
    "learnt_ratio": ("learned", ".2f"),
    "least_ratio": ("least of a model", ".2f"),
}


def measure() -> Table:
    """Scan 40 µm with each effect, and learn from the inverse that knows it, or that of none."""
    title = (
        "True tracking error of x with an effect, before and after iterative learning of the drive;"
        " the last three columns are relative to the error without the effect"
    )
    rows: list[Row] = []
    with working("learning") as report:
        for row in _rows():
            rows.append(row)
            report(f"{row['effect']}, {row['size']}, {row['line_rate_hz']:g} Hz")
    curve = TableCurve("ignored_nm", "learnt_nm", "line_rate_hz", logarithmic=True, panel="effect")
    return Table("reach", title, COLUMNS, rows, curve.picture(title, COLUMNS, rows))


def _rows() -> Iterator[Row]:
    for asked in ASKED:
        for rate in asked.rates:
            for size, known in zip(SIZES, asked.known, strict=True):
                yield row_of(asked.effects, size, rate, known)


def row_of(effects: tuple[str, ...], size: str, rate: float, known: tuple[Added, ...]) -> Row:
    """Errors with effects of a size at a line rate (Hz); ``known`` of them is inverted."""
    spec, model = spec_at(rate), default_model()
    mechanisms = tuple(each for name in effects for each in sized(name, size, AXIS))
    plant = evolve(default_plant(), mechanisms=mechanisms)
    extended = evolve(model, x=evolve(model.axis("x"), added=known))
    began = InProcessSession(plant).scan(FIRST, spec, extended)
    healthy = error(InProcessSession(default_plant()).scan(FIRST, spec, model))
    best = error(learned(began, plant))
    return {
        "effect": " + ".join(effects).replace("_", " "),
        "line_rate_hz": rate,
        "size": size,
        "healthy_nm": 1e9 * healthy,
        "ignored_nm": 1e9 * error(InProcessSession(plant).scan(FIRST, spec, model)),
        "began_nm": 1e9 * error(began),
        "learnt_nm": 1e9 * best,
        "began_ratio": error(began) / healthy,
        "learnt_ratio": best / healthy,
        "least_ratio": hypot(best, healthy) / healthy,
    }
