"""What a form is called in sentences, where its effect has several: its kind, or plain words."""

from afm_scan_ros.core.catalogue import entry

PLAIN = {
    "drift": {"": "exponential"},
    "hysteretic_stiffness": {"": "one threshold"},
    "periodic_disturbance": {"": "one tone"},
    "rate_dependent_hysteresis": {"": "one lag"},
    "slew_limit": {"": "even"},
    "slow_creep": {"": "one time constant"},
    "static_nonlinearity": {
        "": "of the sensor",
        "odd": "of the sensor, odd",
        "odd_quintic": "of the sensor, odd quintic",
        "quartic": "of the sensor, quartic",
        "quintic": "of the sensor, quintic",
        "drive": "of the drive",
        "drive_odd_quintic": "of the drive, odd quintic",
    },
}
"""Of the kinds that have no name, or one that does not say where the effect is."""


def kind_words(name: str, kind: str) -> str:
    """Return what tells a form of an effect from its others; nothing where it has but one."""
    if len(entry(name).forms) == 1:
        return ""
    return PLAIN.get(name, {}).get(kind, kind)
