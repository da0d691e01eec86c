"""How much a file may unfold to: as much as a recording can, and looked at before it does."""

import os

FREE = 2**28
"""Bytes that any file may unfold to, however small it is: a drive at rest folds to nothing."""
MOST_TIMES = 64
"""Times its own size that a larger file may unfold to.

A number has 64 bits at most, and a sensor's one bit of noise at least, which no compression
leaves out. What folds further holds no recording.
"""


def refuse_unfolding(unfolded: int, folded: int) -> None:
    """Raise ValueError where so many bytes are no recording, or more than the computer's memory.

    ``unfolded`` is what a file states of ``folded`` bytes.
    """
    if unfolded > max(FREE, MOST_TIMES * folded):
        raise ValueError(
            f"{folded} bytes unfold to {unfolded}, over {MOST_TIMES} times as many, as no recording"
            " does: save it without compression"
        )
    if unfolded > (there := os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")):
        raise ValueError(
            f"unfolds to {unfolded} bytes, and this computer's memory has {there}: give a part"
        )
