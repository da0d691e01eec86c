"""The product's mechanisms at three sizes: those of the files in config/plants, and others.

A small effect adds some 40 nm rms to a scan of 40 µm, a medium one 120 nm, a large one 400 nm.
"""

from collections.abc import Callable

from attrs import frozen

from afm_scan_ros.simulation.mechanisms import (
    electronics,
    environment,
    material,
    structure,
)
from afm_scan_ros.simulation.mechanisms.base import Mechanism

SIZES = ("small", "medium", "large")
CAPACITANCE = 100e-9  # F, of the piezo
DECADES = (0.01, 0.0316, 0.1, 0.316, 1.0, 3.16, 10.0, 31.6, 100.0)  # s
Sizes = tuple[float, float, float]


@frozen
class SizedEffect:
    """A mechanism at three sizes, from small to large.

    ``name`` is that of the catalogued effect that describes it, None where there is none.
    ``mechanism`` makes the mechanism of an axis and a value of ``sizes``.
    """

    name: str | None
    mechanism: Callable[[str, float], Mechanism]
    sizes: Sizes

    def sized(self, size: str, axis: str) -> tuple[Mechanism, ...]:
        """Mechanisms at one of the ``SIZES``, on axis "x" or "y"."""
        return (self.mechanism(axis, self.sizes[SIZES.index(size)]),)


def _of(
    name: str | None, kind: Callable[..., Mechanism], varied: str, sizes: Sizes, **same: object
) -> SizedEffect:
    """Return an effect of which one parameter is ``varied``, and the others stay the ``same``."""
    return SizedEffect(name, lambda axis, size: kind(axis=axis, **{varied: size}, **same), sizes)


def _drift(axis: str, kelvin: float) -> Mechanism:
    taus = {"frame_tau": 8.0, "stage_tau": 300.0}
    ramp = 0.02 * kelvin
    return environment.WarmingFrame(
        axis=axis, room_step=kelvin, room_ramp=ramp, expansion=1.2e-6, **taus
    )


def _floor(amplitudes: Sizes, **same: object) -> SizedEffect:
    kind = environment.FloorVibration
    return _of("periodic_disturbance", kind, "amplitude", amplitudes, **same)


def _creeping(shares: Sizes, taus: tuple[float, ...]) -> SizedEffect:
    return _of("slow_creep", material.CreepingMount, "share", shares, taus=taus)


EFFECTS = {
    "cross_coupling_tilt": _of(
        "cross_coupling", electronics.TiltedSensor, "angle", (3e-3, 9e-3, 30e-3)
    ),
    "cross_coupling_mode": _of(
        "cross_coupling",
        structure.CoupledStage,
        "share",
        (0.003, 0.009, 0.03),
        frequency=330.0,
        damping=0.02,
    ),
    "extra_resonance": _of(
        "extra_resonance",
        structure.RidingMass,
        "mass_ratio",
        (0.05, 0.15, 0.5),
        frequency=800.0,
        damping=0.01,
    ),
    "input_lag": _of(
        "input_lag",
        electronics.LaggingAmplifier,
        "resistance",
        (170.0, 500.0, 1700.0),
        capacitance=CAPACITANCE,
    ),
    "delay": _of("delay", electronics.DelayedConverter, "delay", (17e-6, 50e-6, 170e-6)),
    "rate_dependent_hysteresis": _of(
        "rate_dependent_hysteresis",
        material.ViscousBlocks,
        "time_constant",
        (30e-6, 90e-6, 300e-6),
    ),
    "drift": SizedEffect("drift", _drift, (1.0, 3.0, 10.0)),
    "slow_creep_logarithmic": _creeping((0.0017, 0.005, 0.017), DECADES),
    "slow_creep_single": _creeping((0.018, 0.055, 0.18), (0.2,)),
    "periodic_disturbance_mains": _floor(
        (0.55e-6, 1.6e-6, 5.5e-6), frequency=50.0, harmonics=(0.3,)
    ),
    "periodic_disturbance_pump": _floor((0.45e-6, 1.4e-6, 4.5e-6), frequency=23.3, harmonics=()),
    "static_nonlinearity_flexure": _of(
        "static_nonlinearity", structure.StiffeningFlexure, "length", (280e-6, 160e-6, 87e-6)
    ),
    "static_nonlinearity_sensor": _of(
        "static_nonlinearity", electronics.TiltedPlate, "wedge", (28e-6, 44e-6, 63e-6), gap=100e-6
    ),
    "backlash": _of(
        "backlash", structure.LooseJoint, "gap", (40e-9, 120e-9, 400e-9), contact_time=1e-6
    ),
    "slew_limit": _of(
        "slew_limit",
        electronics.LimitedAmplifier,
        "current",
        (73e-6, 64e-6, 46e-6),
        resistance=5.0,
        capacitance=CAPACITANCE,
    ),
    "hysteretic_stiffness": _of(
        "hysteretic_stiffness",
        structure.YieldingTube,
        "share",
        (0.01, 0.03, 0.1),
        reaches=(1e-6, 4e-6, 12e-6),
    ),
    "parameter_shift_resonance": _of(
        "parameter_shift", structure.HeavierLoad, "mass_ratio", (0.04, 0.12, 0.4)
    ),
    "parameter_shift_creep": _of("parameter_shift", material.AgedCreep, "factor", (1.7, 3.0, 7.0)),
    "parameter_shift_gain": _of(
        "parameter_shift", material.LostPoling, "loss", (0.0033, 0.01, 0.033)
    ),
    "cyclic_error": _of(
        None, electronics.CyclicEncoder, "inequality", (0.044, 0.13, 0.42), period=8e-6
    ),
    "bow": _of(None, structure.ScannerBow, "arm", (4e-3, 1.3e-3, 0.4e-3)),
}
"""By the names of the files in config/plants."""


def sized(effect: str, size: str, axis: str) -> tuple[Mechanism, ...]:
    """Mechanisms of an effect (of ``EFFECTS``) at one of the ``SIZES``, on axis "x" or "y"."""
    return EFFECTS[effect].sized(size, axis)
