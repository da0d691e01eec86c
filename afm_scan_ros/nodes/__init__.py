"""The nodes: each a module of its name with a function ``main``."""

NODES = (
    "trajectory_generator",
    "excitation_generator",
    "inversion_compensator",
    "piezoscanner_sim",
    "scanner_driver",
    "scan_recorder",
    "scan_imager",
    "tracking_monitor",
    "residual_monitor",
)
