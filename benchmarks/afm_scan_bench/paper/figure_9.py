"""Fig. 9: images of the grating at 1 Hz, without and with the inverses of creep and hysteresis."""

from afm_scan_bench.paper.images import (
    ALL,
    HOW,
    MICRO,
    drawings,
    figure_numbers,
    figure_rows,
    image,
)
from afm_scan_bench.paper.section import Compared, Section

LINE_RATE = 1.0
CASES = {
    "(a) none": (),
    "(b) creep": ("creep",),
    "(c) hysteresis": ("hysteresis",),
    "(d) all": ALL,
}

BARE = "(a) none"

TEXT = (
    "As in the paper: (a) is shifted right and up, the bars are bent, the second line starts on a"
    " bar where the first starts on glass, and more is scanned than is expected; (b) keeps the"
    " shift of hysteresis, (c) the bending of creep; (d) shows the grating straight and at its"
    " pitch. The dust moves from the middle of (d) towards the upper right corner of (a). Ours"
    " keeps drifting in x too, because its scan lies to one side of the rest all the while. Beside"
    " (a) stands its retrace, which hysteresis shifts further, and (a) drawn where the sensor saw"
    " the tip: straight again, but what was not scanned stays missing. "
)


def section(lines: int) -> Section:
    """Scan and image the four cases."""
    done = {name: image(LINE_RATE, inverses, lines) for name, inverses in CASES.items()}
    pictures = {name: each.picture for name, each in done.items()}
    none, every = pictures[BARE].figures, pictures["(d) all"].figures
    shifts = {name: each.figures.shift for name, each in pictures.items()}
    return Section(
        name="figure_9",
        title="Fig. 9: the 16 µm grating at 1 Hz",
        text=TEXT + HOW,
        compared=[
            Compared("bars in view, (a)", 4, none.bars_in_view, form="d"),
            Compared("bars in view, (d)", 3, every.bars_in_view, form="d"),
            Compared("pitch, (a)", "not stated", MICRO * (none.pitch or 0.0), "µm", ".2f"),
            Compared("pitch, (d)", 16.0, MICRO * (every.pitch or 0.0), "µm", ".2f"),
            *(
                Compared(f"shift of the second line, {name}", published, MICRO * shift, "µm", ".2f")
                for (name, shift), published in zip(shifts.items(), PUBLISHED, strict=True)
                if shift is not None
            ),
        ],
        pictures=drawings(pictures, BARE, done[BARE]),
        details=figure_rows(pictures),
        numbers=figure_numbers(pictures),
    )


PUBLISHED = ("to the right", "to the right", "mostly eliminated", "removed")
"""What the paper states of the second scanned line, case by case."""
