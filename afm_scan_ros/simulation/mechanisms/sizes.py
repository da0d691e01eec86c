"""The effects to test against: mechanisms at three sizes, and pairs of them.

Small, medium and large move the scanner by some 40, 120 and 400 nm rms on a scan of 40 um that
shows them; docs/undeclared.md says by how much on which.
"""

from afm_scan_ros.simulation.mechanisms.aged_creep import AgedCreep
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.mechanisms.coupled_stage import CoupledStage
from afm_scan_ros.simulation.mechanisms.creeping_mount import CreepingMount
from afm_scan_ros.simulation.mechanisms.cyclic_encoder import CyclicEncoder
from afm_scan_ros.simulation.mechanisms.delayed_converter import DelayedConverter
from afm_scan_ros.simulation.mechanisms.effect import CAPACITANCE, Effect
from afm_scan_ros.simulation.mechanisms.floor_vibration import FloorVibration
from afm_scan_ros.simulation.mechanisms.heavier_load import HeavierLoad
from afm_scan_ros.simulation.mechanisms.lagging_amplifier import LaggingAmplifier
from afm_scan_ros.simulation.mechanisms.limited_amplifier import LimitedAmplifier
from afm_scan_ros.simulation.mechanisms.loose_joint import LooseJoint
from afm_scan_ros.simulation.mechanisms.lost_poling import LostPoling
from afm_scan_ros.simulation.mechanisms.opened_sizes import FIFTH, FOURTH, SIXTH, THIRD
from afm_scan_ros.simulation.mechanisms.other_sizes import OTHERS
from afm_scan_ros.simulation.mechanisms.riding_mass import RidingMass
from afm_scan_ros.simulation.mechanisms.scanner_bow import ScannerBow
from afm_scan_ros.simulation.mechanisms.seventh_sizes import SEVENTH
from afm_scan_ros.simulation.mechanisms.stiffening_flexure import StiffeningFlexure
from afm_scan_ros.simulation.mechanisms.tilted_plate import TiltedPlate
from afm_scan_ros.simulation.mechanisms.tilted_sensor import TiltedSensor
from afm_scan_ros.simulation.mechanisms.viscous_blocks import ViscousBlocks
from afm_scan_ros.simulation.mechanisms.warming_frame import WarmingFrame
from afm_scan_ros.simulation.mechanisms.yielding_tube import YieldingTube

SIZES = ("small", "medium", "large")

DECADES = (0.01, 0.0316, 0.1, 0.316, 1.0, 3.16, 10.0, 31.6, 100.0)  # s


EFFECTS = {
    "cross_coupling_tilt": Effect(
        "cross_coupling",
        lambda axis, angle: TiltedSensor(axis=axis, angle=angle),
        (3e-3, 9e-3, 30e-3),
    ),
    "cross_coupling_leg": Effect(
        "cross_coupling",
        lambda axis, share: CoupledStage(axis=axis, share=share, frequency=330.0, damping=0.02),
        (0.003, 0.009, 0.03),
    ),
    "extra_resonance": Effect(
        "extra_resonance",
        lambda axis, mass: RidingMass(axis=axis, mass_ratio=mass, frequency=800.0, damping=0.01),
        (0.05, 0.15, 0.5),
    ),
    "input_lag": Effect(
        "input_lag",
        lambda axis, ohm: LaggingAmplifier(axis=axis, resistance=ohm, capacitance=CAPACITANCE),
        (170.0, 500.0, 1700.0),
    ),
    "delay": Effect(
        "delay",
        lambda axis, delay: DelayedConverter(axis=axis, delay=delay),
        (17e-6, 50e-6, 170e-6),
    ),
    "rate_dependent_hysteresis": Effect(
        "rate_dependent_hysteresis",
        lambda axis, constant: ViscousBlocks(axis=axis, time_constant=constant),
        (30e-6, 90e-6, 300e-6),
    ),
    "drift": Effect(
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
    "slow_creep_logarithmic": Effect(
        "slow_creep",
        lambda axis, share: CreepingMount(axis=axis, share=share, taus=DECADES),
        (0.0017, 0.005, 0.017),
    ),
    "slow_creep_single": Effect(
        "slow_creep",
        lambda axis, share: CreepingMount(axis=axis, share=share, taus=(0.2,)),
        (0.018, 0.055, 0.18),
    ),
    "periodic_disturbance_mains": Effect(
        "periodic_disturbance",
        lambda axis, floor: FloorVibration(
            axis=axis, amplitude=floor, frequency=50.0, harmonics=(0.3,)
        ),
        (0.55e-6, 1.6e-6, 5.5e-6),
    ),
    "periodic_disturbance_pump": Effect(
        "periodic_disturbance",
        lambda axis, floor: FloorVibration(
            axis=axis, amplitude=floor, frequency=23.3, harmonics=()
        ),
        (0.45e-6, 1.4e-6, 4.5e-6),
    ),
    "static_nonlinearity_flexure": Effect(
        "static_nonlinearity",
        lambda axis, length: StiffeningFlexure(axis=axis, length=length),
        (280e-6, 160e-6, 87e-6),
    ),
    "static_nonlinearity_sensor": Effect(
        "static_nonlinearity",
        lambda axis, wedge: TiltedPlate(axis=axis, gap=100e-6, wedge=wedge),
        (28e-6, 44e-6, 63e-6),
    ),
    "backlash": Effect(
        "backlash",
        lambda axis, gap: LooseJoint(axis=axis, gap=gap, contact_time=1e-6),
        (40e-9, 120e-9, 400e-9),
    ),
    "slew_limit": Effect(
        "slew_limit",
        lambda axis, ampere: LimitedAmplifier(
            axis=axis, current=ampere, resistance=5.0, capacitance=CAPACITANCE
        ),
        (73e-6, 64e-6, 46e-6),
    ),
    "hysteretic_stiffness": Effect(
        "hysteretic_stiffness",
        lambda axis, share: YieldingTube(axis=axis, share=share, reaches=(1e-6, 4e-6, 12e-6)),
        (0.01, 0.03, 0.1),
    ),
    "parameter_shift_resonance": Effect(
        "parameter_shift",
        lambda axis, mass: HeavierLoad(axis=axis, mass_ratio=mass),
        (0.04, 0.12, 0.4),
    ),
    "parameter_shift_creep": Effect(
        "parameter_shift",
        lambda axis, factor: AgedCreep(axis=axis, factor=factor),
        (1.7, 3.0, 7.0),
    ),
    "parameter_shift_gain": Effect(
        "parameter_shift",
        lambda axis, loss: LostPoling(axis=axis, loss=loss),
        (0.0033, 0.01, 0.033),
    ),
    "cyclic_error": Effect(
        None,
        lambda axis, unequal: CyclicEncoder(axis=axis, period=8e-6, inequality=unequal),
        (0.044, 0.13, 0.42),
    ),
    "bow": Effect(
        None,
        lambda axis, arm: ScannerBow(axis=axis, arm=arm),
        (4e-3, 1.3e-3, 0.4e-3),
    ),
}
"""By the names of the files in config/plants."""

ALL = EFFECTS | OTHERS | THIRD | FOURTH | FIFTH | SIXTH | SEVENTH

PAIRS = (
    ("delay", "drift"),
    ("cross_coupling_tilt", "periodic_disturbance_mains"),
    ("input_lag", "static_nonlinearity_flexure"),
    ("backlash", "slow_creep_logarithmic"),
    ("cross_coupling_leg", "hysteretic_stiffness"),
    ("extra_resonance", "rate_dependent_hysteresis"),
)


def sized(effect: str, size: str, axis: str) -> tuple[Mechanism, ...]:
    """Mechanisms of an effect (of ``ALL``) at one of the ``SIZES``, on axis "x" or "y"."""
    found = ALL[effect]
    return (found.mechanism(axis, found.sizes[SIZES.index(size)]),)
