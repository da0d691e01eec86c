"""The mechanisms of a simulated scanner, found by the kind that a plant file states."""

from importlib.metadata import entry_points

from afm_scan_ros.simulation.mechanisms import (  # noqa: F401 - importing a module registers its kinds
    electronics,
    environment,
    material,
    structure,
)
from afm_scan_ros.simulation.mechanisms.base import Mechanism

PLUGINS = "afm_scan_ros.mechanisms"
"""Entry-point group of modules in which another package defines mechanisms."""


def mechanism_type(kind: str) -> type[Mechanism] | None:
    """Return the mechanism of a kind, of this package or of a plugin; None where there is none."""
    if kind not in Mechanism.KINDS:
        for point in entry_points(group=PLUGINS):
            point.load()
    return Mechanism.KINDS.get(kind)
