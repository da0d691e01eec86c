"""Effects of three sizes to test against: the mechanisms of the files in config/plants.

A small effect adds some 40 nm rms to a scan of 40 µm, a medium one 120 nm, a large one 400 nm.
"""

from collections.abc import Callable

from attrs import frozen

from afm_scan_ros.simulation.mechanisms.amplifier import (
    DelayedConverter,
    LaggingAmplifier,
    LimitedAmplifier,
)
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.mechanisms.creep import AgedCreep, CreepingMount
from afm_scan_ros.simulation.mechanisms.disturbance import FloorVibration
from afm_scan_ros.simulation.mechanisms.hysteresis import LostPoling, ViscousBlocks
from afm_scan_ros.simulation.mechanisms.sensor import CyclicEncoder, TiltedPlate, TiltedSensor
from afm_scan_ros.simulation.mechanisms.structure import (
    CoupledStage,
    HeavierLoad,
    LooseJoint,
    RidingMass,
    ScannerBow,
    StiffeningFlexure,
    YieldingTube,
)
from afm_scan_ros.simulation.mechanisms.thermal import WarmingFrame

SIZES = ("small", "medium", "large")
CAPACITANCE = 100e-9  # F, of the piezo
DECADES = (0.01, 0.0316, 0.1, 0.316, 1.0, 3.16, 10.0, 31.6, 100.0)  # s


@frozen
class SizedEffect:
    """A mechanism at three sizes, from small to large.

    ``name`` is that of the catalogued effect that describes it, None where there is none.
    ``mechanism`` makes the mechanism of an axis and a value of ``sizes``.
    """

    name: str | None
    mechanism: Callable[[str, float], Mechanism]
    sizes: tuple[float, float, float]

    def sized(self, size: str, axis: str) -> tuple[Mechanism, ...]:
        """Mechanisms at one of the ``SIZES``, on axis "x" or "y"."""
        return (self.mechanism(axis, self.sizes[SIZES.index(size)]),)


EFFECTS = {
    "cross_coupling_tilt": SizedEffect(
        "cross_coupling",
        lambda axis, angle: TiltedSensor(axis=axis, angle=angle),
        (3e-3, 9e-3, 30e-3),
    ),
    "cross_coupling_mode": SizedEffect(
        "cross_coupling",
        lambda axis, share: CoupledStage(axis=axis, share=share, frequency=330.0, damping=0.02),
        (0.003, 0.009, 0.03),
    ),
    "extra_resonance": SizedEffect(
        "extra_resonance",
        lambda axis, mass: RidingMass(axis=axis, mass_ratio=mass, frequency=800.0, damping=0.01),
        (0.05, 0.15, 0.5),
    ),
    "input_lag": SizedEffect(
        "input_lag",
        lambda axis, ohm: LaggingAmplifier(axis=axis, resistance=ohm, capacitance=CAPACITANCE),
        (170.0, 500.0, 1700.0),
    ),
    "delay": SizedEffect(
        "delay",
        lambda axis, delay: DelayedConverter(axis=axis, delay=delay),
        (17e-6, 50e-6, 170e-6),
    ),
    "rate_dependent_hysteresis": SizedEffect(
        "rate_dependent_hysteresis",
        lambda axis, constant: ViscousBlocks(axis=axis, time_constant=constant),
        (30e-6, 90e-6, 300e-6),
    ),
    "drift": SizedEffect(
        "drift",
        lambda axis, kelvin: WarmingFrame(
            axis=axis,
            room_step=kelvin,
            room_ramp=0.02 * kelvin,
            frame_tau=8.0,
            stage_tau=300.0,
            expansion=1.2e-6,
        ),
        (1.0, 3.0, 10.0),
    ),
    "slow_creep_logarithmic": SizedEffect(
        "slow_creep",
        lambda axis, share: CreepingMount(axis=axis, share=share, taus=DECADES),
        (0.0017, 0.005, 0.017),
    ),
    "slow_creep_single": SizedEffect(
        "slow_creep",
        lambda axis, share: CreepingMount(axis=axis, share=share, taus=(0.2,)),
        (0.018, 0.055, 0.18),
    ),
    "periodic_disturbance_mains": SizedEffect(
        "periodic_disturbance",
        lambda axis, floor: FloorVibration(
            axis=axis, amplitude=floor, frequency=50.0, harmonics=(0.3,)
        ),
        (0.55e-6, 1.6e-6, 5.5e-6),
    ),
    "periodic_disturbance_pump": SizedEffect(
        "periodic_disturbance",
        lambda axis, floor: FloorVibration(
            axis=axis, amplitude=floor, frequency=23.3, harmonics=()
        ),
        (0.45e-6, 1.4e-6, 4.5e-6),
    ),
    "static_nonlinearity_flexure": SizedEffect(
        "static_nonlinearity",
        lambda axis, length: StiffeningFlexure(axis=axis, length=length),
        (280e-6, 160e-6, 87e-6),
    ),
    "static_nonlinearity_sensor": SizedEffect(
        "static_nonlinearity",
        lambda axis, wedge: TiltedPlate(axis=axis, gap=100e-6, wedge=wedge),
        (28e-6, 44e-6, 63e-6),
    ),
    "backlash": SizedEffect(
        "backlash",
        lambda axis, gap: LooseJoint(axis=axis, gap=gap, contact_time=1e-6),
        (40e-9, 120e-9, 400e-9),
    ),
    "slew_limit": SizedEffect(
        "slew_limit",
        lambda axis, ampere: LimitedAmplifier(
            axis=axis, current=ampere, resistance=5.0, capacitance=CAPACITANCE
        ),
        (73e-6, 64e-6, 46e-6),
    ),
    "hysteretic_stiffness": SizedEffect(
        "hysteretic_stiffness",
        lambda axis, share: YieldingTube(axis=axis, share=share, reaches=(1e-6, 4e-6, 12e-6)),
        (0.01, 0.03, 0.1),
    ),
    "parameter_shift_resonance": SizedEffect(
        "parameter_shift",
        lambda axis, mass: HeavierLoad(axis=axis, mass_ratio=mass),
        (0.04, 0.12, 0.4),
    ),
    "parameter_shift_creep": SizedEffect(
        "parameter_shift", lambda axis, factor: AgedCreep(axis=axis, factor=factor), (1.7, 3.0, 7.0)
    ),
    "parameter_shift_gain": SizedEffect(
        "parameter_shift",
        lambda axis, loss: LostPoling(axis=axis, loss=loss),
        (0.0033, 0.01, 0.033),
    ),
    "cyclic_error": SizedEffect(
        None,
        lambda axis, unequal: CyclicEncoder(axis=axis, period=8e-6, inequality=unequal),
        (0.044, 0.13, 0.42),
    ),
    "bow": SizedEffect(
        None, lambda axis, arm: ScannerBow(axis=axis, arm=arm), (4e-3, 1.3e-3, 0.4e-3)
    ),
}
"""By the names of the files in config/plants."""


def sized(effect: str, size: str, axis: str) -> tuple[Mechanism, ...]:
    """Mechanisms of an effect (of ``EFFECTS``) at one of the ``SIZES``, on axis "x" or "y"."""
    return EFFECTS[effect].sized(size, axis)
