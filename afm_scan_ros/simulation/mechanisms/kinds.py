"""Every mechanism that a plant file can name."""

from afm_scan_ros.simulation.mechanisms.activated_blocks import ActivatedBlocks
from afm_scan_ros.simulation.mechanisms.aged_creep import AgedCreep
from afm_scan_ros.simulation.mechanisms.averaging_sensor import AveragingSensor
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.mechanisms.boiling_cryostat import BoilingCryostat
from afm_scan_ros.simulation.mechanisms.buffered_amplifier import BufferedAmplifier
from afm_scan_ros.simulation.mechanisms.bursting_supply import BurstingSupply
from afm_scan_ros.simulation.mechanisms.ceramic_filter import CeramicFilter
from afm_scan_ros.simulation.mechanisms.chattering_valve import ChatteringValve
from afm_scan_ros.simulation.mechanisms.compressing_amplifier import CompressingAmplifier
from afm_scan_ros.simulation.mechanisms.coupled_stage import CoupledStage
from afm_scan_ros.simulation.mechanisms.cracked_leaf import CrackedLeaf
from afm_scan_ros.simulation.mechanisms.crackling_domains import CracklingDomains
from afm_scan_ros.simulation.mechanisms.creeping_mount import CreepingMount
from afm_scan_ros.simulation.mechanisms.cyclic_encoder import CyclicEncoder
from afm_scan_ros.simulation.mechanisms.delayed_converter import DelayedConverter
from afm_scan_ros.simulation.mechanisms.draining_pad import DrainingPad
from afm_scan_ros.simulation.mechanisms.fading_gain import FadingGain
from afm_scan_ros.simulation.mechanisms.flickering_reference import FlickeringReference
from afm_scan_ros.simulation.mechanisms.flooded_joint import FloodedJoint
from afm_scan_ros.simulation.mechanisms.floor_vibration import FloorVibration
from afm_scan_ros.simulation.mechanisms.ghost_light import GhostLight
from afm_scan_ros.simulation.mechanisms.glitching_converter import GlitchingConverter
from afm_scan_ros.simulation.mechanisms.glued_mirror import GluedMirror
from afm_scan_ros.simulation.mechanisms.hardened_domains import HardenedDomains
from afm_scan_ros.simulation.mechanisms.hastened_blocks import HastenedBlocks
from afm_scan_ros.simulation.mechanisms.heated_rod import HeatedRod
from afm_scan_ros.simulation.mechanisms.heavier_load import HeavierLoad
from afm_scan_ros.simulation.mechanisms.hum_eliminator import HumEliminator
from afm_scan_ros.simulation.mechanisms.lagging_amplifier import LaggingAmplifier
from afm_scan_ros.simulation.mechanisms.late_divider import LateDivider
from afm_scan_ros.simulation.mechanisms.limited_amplifier import LimitedAmplifier
from afm_scan_ros.simulation.mechanisms.linear_phase_sensor import LinearPhaseSensor
from afm_scan_ros.simulation.mechanisms.loose_contact import LooseContact
from afm_scan_ros.simulation.mechanisms.loose_joint import LooseJoint
from afm_scan_ros.simulation.mechanisms.lost_poling import LostPoling
from afm_scan_ros.simulation.mechanisms.miscounting_encoder import MiscountingEncoder
from afm_scan_ros.simulation.mechanisms.pipelined_sensor import PipelinedSensor
from afm_scan_ros.simulation.mechanisms.polymer_pad import PolymerPad
from afm_scan_ros.simulation.mechanisms.popping_mount import PoppingMount
from afm_scan_ros.simulation.mechanisms.pressed_balls import PressedBalls
from afm_scan_ros.simulation.mechanisms.regulated_stage import RegulatedStage
from afm_scan_ros.simulation.mechanisms.relaxing_clamp import RelaxingClamp
from afm_scan_ros.simulation.mechanisms.resistive_electrode import ResistiveElectrode
from afm_scan_ros.simulation.mechanisms.riding_mass import RidingMass
from afm_scan_ros.simulation.mechanisms.ringing_amplifier import RingingAmplifier
from afm_scan_ros.simulation.mechanisms.round_hole import RoundHole
from afm_scan_ros.simulation.mechanisms.rubbing_guide import RubbingGuide
from afm_scan_ros.simulation.mechanisms.saturating_sensor import SaturatingSensor
from afm_scan_ros.simulation.mechanisms.scanner_bow import ScannerBow
from afm_scan_ros.simulation.mechanisms.scratched_plate import ScratchedPlate
from afm_scan_ros.simulation.mechanisms.self_heating_amplifier import SelfHeatingAmplifier
from afm_scan_ros.simulation.mechanisms.shared_ground import SharedGround
from afm_scan_ros.simulation.mechanisms.single_ended_amplifier import SingleEndedAmplifier
from afm_scan_ros.simulation.mechanisms.sliding_sample import SlidingSample
from afm_scan_ros.simulation.mechanisms.snapping_leaf import SnappingLeaf
from afm_scan_ros.simulation.mechanisms.soldered_joint import SolderedJoint
from afm_scan_ros.simulation.mechanisms.springy_joint import SpringyJoint
from afm_scan_ros.simulation.mechanisms.sprung_holder import SprungHolder
from afm_scan_ros.simulation.mechanisms.starved_amplifier import StarvedAmplifier
from afm_scan_ros.simulation.mechanisms.stiffening_flexure import StiffeningFlexure
from afm_scan_ros.simulation.mechanisms.stribeck_guide import StribeckGuide
from afm_scan_ros.simulation.mechanisms.superelastic_leaf import SuperelasticLeaf
from afm_scan_ros.simulation.mechanisms.supply_ripple import SupplyRipple
from afm_scan_ros.simulation.mechanisms.swinging_arm import SwingingArm
from afm_scan_ros.simulation.mechanisms.taut_cable import TautCable
from afm_scan_ros.simulation.mechanisms.thinning_blocks import ThinningBlocks
from afm_scan_ros.simulation.mechanisms.thumping_compressor import ThumpingCompressor
from afm_scan_ros.simulation.mechanisms.tilted_plate import TiltedPlate
from afm_scan_ros.simulation.mechanisms.tilted_sensor import TiltedSensor
from afm_scan_ros.simulation.mechanisms.tired_amplifier import TiredAmplifier
from afm_scan_ros.simulation.mechanisms.touched_stop import TouchedStop
from afm_scan_ros.simulation.mechanisms.tugging_hose import TuggingHose
from afm_scan_ros.simulation.mechanisms.uneven_converter import UnevenConverter
from afm_scan_ros.simulation.mechanisms.viscous_blocks import ViscousBlocks
from afm_scan_ros.simulation.mechanisms.warmed_piezo import WarmedPiezo
from afm_scan_ros.simulation.mechanisms.warming_frame import WarmingFrame
from afm_scan_ros.simulation.mechanisms.worn_bearing import WornBearing
from afm_scan_ros.simulation.mechanisms.yawing_stage import YawingStage
from afm_scan_ros.simulation.mechanisms.yielding_tube import YieldingTube

_ALL: tuple[type[Mechanism], ...] = (
    ActivatedBlocks,
    AgedCreep,
    AveragingSensor,
    BoilingCryostat,
    BufferedAmplifier,
    BurstingSupply,
    CeramicFilter,
    ChatteringValve,
    CompressingAmplifier,
    CoupledStage,
    CrackedLeaf,
    CracklingDomains,
    CreepingMount,
    CyclicEncoder,
    DelayedConverter,
    DrainingPad,
    FadingGain,
    FlickeringReference,
    FloodedJoint,
    FloorVibration,
    GhostLight,
    GlitchingConverter,
    GluedMirror,
    HardenedDomains,
    HastenedBlocks,
    HeatedRod,
    HeavierLoad,
    HumEliminator,
    LaggingAmplifier,
    LateDivider,
    LimitedAmplifier,
    LinearPhaseSensor,
    LooseContact,
    LooseJoint,
    LostPoling,
    MiscountingEncoder,
    PipelinedSensor,
    PolymerPad,
    PoppingMount,
    PressedBalls,
    RegulatedStage,
    RelaxingClamp,
    ResistiveElectrode,
    RidingMass,
    RingingAmplifier,
    RoundHole,
    RubbingGuide,
    SaturatingSensor,
    ScannerBow,
    ScratchedPlate,
    SelfHeatingAmplifier,
    SharedGround,
    SingleEndedAmplifier,
    SlidingSample,
    SnappingLeaf,
    SolderedJoint,
    SpringyJoint,
    SprungHolder,
    StarvedAmplifier,
    StiffeningFlexure,
    StribeckGuide,
    SuperelasticLeaf,
    SupplyRipple,
    SwingingArm,
    TautCable,
    ThinningBlocks,
    ThumpingCompressor,
    TiltedPlate,
    TiltedSensor,
    TiredAmplifier,
    TouchedStop,
    TuggingHose,
    UnevenConverter,
    ViscousBlocks,
    WarmedPiezo,
    WarmingFrame,
    WornBearing,
    YawingStage,
    YieldingTube,
)

KINDS = {kind.KIND: kind for kind in _ALL}
