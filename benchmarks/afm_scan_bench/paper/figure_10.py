"""Fig. 10: images of the grating at 5, 30 and 100 Hz, without and with compensation."""

from afm_scan_bench.paper.images import ALL, HOW, drawings, figure_numbers, figure_rows, image
from afm_scan_bench.paper.picture import RESONANCE
from afm_scan_bench.paper.section import Compared, Section

CASES = {
    "(a) 5 Hz, none": (5.0, ()),
    "(b) 5 Hz, all": (5.0, ALL),
    "(c) 30 Hz, none": (30.0, ()),
    "(d) 30 Hz, all": (30.0, ALL),
    "(e) 100 Hz, none": (100.0, ()),
    "(f) 100 Hz, all": (100.0, ALL),
}
BARE = "(c) 30 Hz, none"

TEXT = (
    "As in the paper: at 5 Hz creep and hysteresis bend and shift the bars, at 30 Hz ripples"
    " appear, at 100 Hz they destroy the image; with all inverses all three images show the"
    " grating. The ripple's frequency is found in the image, by the phase of the grating down each"
    " column, and is the first resonance's. In a line of 5 ms two periods of it fit, so at 100 Hz"
    " it is found less exactly. At 30 Hz the tip goes back and forth: the dust is seen more than"
    " once. The simulated ripples are strong because nothing but the scanner's own damping, 1.2 %,"
    " takes them away, and the triangles are sharp. "
)


def section(lines: int) -> Section:
    """Scan and image the six cases."""
    done = {name: image(rate, inverses, lines) for name, (rate, inverses) in CASES.items()}
    pictures = {name: each.picture for name, each in done.items()}
    compared = [
        Compared(f"ripple, {name}", RESONANCE, each.strongest.frequency, "Hz", ".0f")
        for name, each in pictures.items()
        if each.strongest and "none" in name and not name.startswith("(a)")
    ]
    compared += [
        Compared(
            f"ripple at 454 Hz, {name}", published, 1e9 * each.at_resonance.amplitude, "nm", ".0f"
        )
        for (name, each), published in zip(pictures.items(), PUBLISHED, strict=True)
        if each.at_resonance
    ]
    bare = done[BARE]
    return Section(
        name="figure_10",
        title="Fig. 10: the grating at 5, 30 and 100 Hz",
        text=TEXT + HOW,
        compared=compared,
        pictures=drawings(pictures, BARE, bare),
        details=figure_rows(pictures),
        numbers=figure_numbers(pictures),
    )


PUBLISHED = ("negligible", "reduced", "ripples", "not seen", "severe", "reduced")
"""What the paper states of the vibrations in each image."""
