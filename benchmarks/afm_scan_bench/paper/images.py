"""What Figs. 9 to 11 have in common: scans with and without inverses, imaged and measured."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from attrs import frozen

from afm_scan_bench.paper.gallery import gallery, three_ways
from afm_scan_bench.paper.picture import Picture, picture, regridded
from afm_scan_bench.paper.scanner import PaperScan, paper_spec, scan_as_paper
from afm_scan_bench.paper.section import Drawn
from afm_scan_ros.core.metrics import plain
from afm_scan_ros.core.model import INVERSES

MICRO = 1e6
ALL = INVERSES
HEADINGS = (
    "image",
    "bars in view",
    "pitch, µm",
    "its spread, %",
    "bow, µm",
    "ripple at 454 Hz, nm",
    "strongest ripple",
)

HOW = (
    "The range is 40 µm, which the paper does not state, begun at rest in the corner at the top"
    " right, on sharp triangles as in the paper. To hold it within the identified ±4 V,"
    " displacement is read at 16 µm/V here, twice what the package assumes elsewhere. The"
    " grating's angle, 25°, and its place are ours. Heights are the sample's own, where the paper"
    " shows the tip's deflection. Without the inverse hysteresis the drive takes the scanner for"
    " linear, with its gain at small signals, as the paper's over-scanned images suggest. Dashed"
    " lines mark where the middles of the chrome bars really lie."
)


@frozen(eq=False)
class Imaged:
    """One scan and its picture."""

    scan: PaperScan
    picture: Picture


def image(line_rate: float, inverses: Iterable[str], lines: int) -> Imaged:
    """Scan as the paper does and image the grating."""
    scan = scan_as_paper(paper_spec(line_rate, lines), inverses)
    return Imaged(scan, picture(scan))


def drawings(pictures: Mapping[str, Picture], bare: str, imaged: Imaged) -> Sequence[Drawn]:
    """Draw all images, and that named ``bare`` in three ways."""
    corrected = regridded(imaged.scan, imaged.picture)
    ways = f"{bare} as trace, as retrace, and drawn where the sensor saw the tip"
    return [
        Drawn("images", gallery(pictures, 2), "Heights on the expected path, the lines' traces"),
        Drawn("ways", three_ways(imaged.picture, corrected), ways),
    ]


def figure_rows(pictures: Mapping[str, Picture]) -> Sequence[Sequence[str]]:
    """Return what is measured in each image as rows of text, headings first."""
    return [HEADINGS, *(_row(name, each) for name, each in pictures.items())]


def _row(name: str, shown: Picture) -> Sequence[str]:
    found = shown.figures
    pitch, spread = found.pitch, found.pitch_spread
    strongest, resonance = shown.strongest, shown.at_resonance
    return (
        name,
        str(found.bars_in_view),
        f"{MICRO * pitch:.2f}" if pitch else "-",
        f"{100.0 * spread / pitch:.2f}" if pitch and spread else "-",
        f"{MICRO * found.bow:.2f}" if found.bow else "-",
        f"{1e9 * resonance.amplitude:.0f}" if resonance else "-",
        f"{1e9 * strongest.amplitude:.0f} nm at {strongest.frequency:.0f} Hz" if strongest else "-",
    )


def figure_numbers(pictures: Mapping[str, Picture]) -> Mapping[str, Any]:
    """Return what is measured in each image for JSON, in SI units."""
    return {
        name: {
            **plain(each.figures),
            "strongest_ripple": plain(each.strongest) if each.strongest else None,
            "ripple_at_resonance": plain(each.at_resonance) if each.at_resonance else None,
        }
        for name, each in pictures.items()
    }
