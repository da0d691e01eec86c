"""A mechanism of no size changes nothing, and one without noise leaves rest at rest."""

import numpy as np
import pytest

from afm_scan_bench.mechanisms.amplifier import (
    SelfHeatingAmplifier,
    SingleEndedAmplifier,
    StarvedAmplifier,
)
from afm_scan_bench.mechanisms.coupling import SwingingArm, TuggingHose, YawingStage
from afm_scan_bench.mechanisms.creep import DrainingPad, RelaxingClamp, SolderedJoint
from afm_scan_bench.mechanisms.disturbance import (
    BoilingCryostat,
    ChatteringValve,
    ThumpingCompressor,
    WornBearing,
)
from afm_scan_bench.mechanisms.drive_circuit import (
    CeramicFilter,
    GlitchingConverter,
    LooseContact,
    ResistiveElectrode,
)
from afm_scan_bench.mechanisms.encoder import (
    GhostLight,
    MiscountingEncoder,
    ScratchedPlate,
    UnevenConverter,
)
from afm_scan_bench.mechanisms.friction import PressedBalls, StribeckGuide, SuperelasticLeaf
from afm_scan_bench.mechanisms.hysteresis import CracklingDomains, ThinningBlocks
from afm_scan_bench.mechanisms.joint import FloodedJoint, RoundHole, SlidingSample, SnappingLeaf
from afm_scan_bench.mechanisms.sensor_dynamics import (
    HumEliminator,
    LateDivider,
    PipelinedSensor,
)
from afm_scan_bench.mechanisms.sensor_gain import BurstingSupply, FadingGain, FlickeringReference
from afm_scan_bench.mechanisms.structure import CrackedLeaf, GluedMirror, TautCable, TouchedStop
from afm_scan_bench.mechanisms.thermal import RegulatedStage, WarmedPiezo
from afm_scan_ros.simulation.axis import PlayBank
from afm_scan_ros.simulation.mechanisms.attachment import Attachment
from afm_scan_ros.simulation.mechanisms.base import Insert
from afm_scan_ros.simulation.scanner import PlantSpec
from helpers.acting import STEP, WAVE, act, held


def kind(mechanism: object) -> str:
    return str(getattr(mechanism, "KIND", ""))


@pytest.mark.parametrize(
    "insert",
    [
        RelaxingClamp(axis="x", scale=0.0, settling=1.0),
        ThumpingCompressor(axis="x", amplitude=0.0, strokes=20.0),
        UnevenConverter(axis="x", weight=1e-6, error=0.0),
        GlitchingConverter(axis="x", height=0.0, lasting=1e-5),
        SlidingSample(axis="x", grip=1e9, room=1.0),
        YawingStage(axis="x", share=0.0, frequency=300.0, damping=0.05),
        SolderedJoint(axis="x", share=0.0, settling=1.0),
        FloodedJoint(axis="x", gap=1e-20),
        ResistiveElectrode(axis="x", resistance=1e-9, capacitance=1e-9),
        SingleEndedAmplifier(axis="x", pull=1e-9, capacitance=1e-9),
        FlickeringReference(axis="x", amplitude=0.0),
        LooseContact(axis="x", opened=0.0),
        SnappingLeaf(axis="x", throw=0.0, reach=1e-5),
        RegulatedStage(axis="x", growth=0.0, period=1.0, damping=0.5),
        WornBearing(axis="x", amplitude=0.0, shaft=20.0),
        BoilingCryostat(axis="x", amplitude=0.0),
        CeramicFilter(axis="x", resistance=1e-9, capacitance=1e-9),
        DrainingPad(axis="x", share=0.0, draining=1.0),
        RoundHole(axis="x", gap=1e-20),
        SelfHeatingAmplifier(axis="x", offset=0.0, settling=1e-3),
        ScratchedPlate(axis="x", depth=0.0),
        MiscountingEncoder(axis="x", mark=0.0),
        StarvedAmplifier(axis="x", power=1e3, capacitance=1e-12),
        ChatteringValve(axis="x", amplitude=0.0, frequency=37.0),
        CracklingDomains(axis="x", amplitude=0.0, length=1.0),
        GhostLight(axis="x", period=6e-6, ghost=0.0, shaking=83.0),
        HumEliminator(axis="x", learning=0.0),
    ],
    ids=kind,
)
def test_an_insert_without_size_changes_nothing(insert: Insert) -> None:
    np.testing.assert_allclose(act(insert, WAVE, WAVE[::-1].copy()), WAVE, atol=1e-19)


@pytest.mark.parametrize(
    "insert",
    [
        PipelinedSensor(axis="x", clock=1e-15),
        BurstingSupply(axis="x", sag=1e-15, bursts=100.0),
        LateDivider(axis="x", reach=1e3, settling=1e-3),
    ],
    ids=kind,
)
def test_an_insert_of_hardly_any_size_changes_hardly_anything(insert: Insert) -> None:
    np.testing.assert_allclose(act(insert, WAVE), WAVE, atol=1e-15)


@pytest.mark.parametrize(
    "attachment",
    [
        StribeckGuide(axis="x", share=0.0, reaches=(1e-7,), stiction=1.0),
        GluedMirror(axis="x", mass_ratio=0.0, frequency=600.0, relaxing=0.4, settling=1e-3),
        PressedBalls(axis="x", share=0.0, reach=1e-5),
        TouchedStop(axis="x", place=1e-6, push=0.0),
        TuggingHose(axis="x", share=0.0, relaxing=0.6),
        TautCable(axis="x", share=0.0, frequency=345.0, damping=0.01),
        SuperelasticLeaf(axis="x", share=0.0, reaches=(1e-6,)),
    ],
    ids=kind,
)
def test_an_attachment_without_size_changes_nothing(attachment: Attachment) -> None:
    np.testing.assert_array_equal(held(attachment, WAVE, WAVE[::-1].copy()), WAVE)


def test_blocks_in_a_film_without_shear_stress_are_free(plant: PlantSpec) -> None:
    drive, plays = 1e5 * WAVE, PlayBank.from_spec(plant.x.hysteresis)
    free = ThinningBlocks(axis="x", film=1e-20).bank(plays, STEP)
    followed = plays.apply(plays.relaxed(), drive)[1]
    np.testing.assert_allclose(free.apply(free.relaxed(), drive)[1], followed, atol=1e-9)


def test_alterations_without_size_change_nothing(plant: PlantSpec) -> None:
    cold = WarmedPiezo(axis="x", kelvin=0.0).altered(plant.x)
    assert cold.vibration == plant.x.vibration
    np.testing.assert_allclose(cold.creep.numerator, plant.x.creep.numerator, rtol=1e-9)
    whole = CrackedLeaf(axis="x", loss=0.0).altered(plant.x).vibration
    np.testing.assert_allclose(whole.numerator, plant.x.vibration.numerator, rtol=1e-9)


@pytest.mark.parametrize(
    "insert",
    [
        StarvedAmplifier(axis="x", power=8e-5, capacitance=1e-7),
        CracklingDomains(axis="x", amplitude=0.1, length=0.4),
        HumEliminator(axis="x", learning=0.1),
    ],
    ids=kind,
)
def test_an_insert_leaves_rest_at_rest(insert: Insert) -> None:
    still = np.zeros(500)
    np.testing.assert_array_equal(act(insert, still), still)


@pytest.mark.parametrize(
    "attachment",
    [
        TuggingHose(axis="x", share=0.1, relaxing=0.6),
        TautCable(axis="x", share=0.1, frequency=345.0, damping=0.01),
        SuperelasticLeaf(axis="x", share=0.1, reaches=(1e-6,)),
    ],
    ids=kind,
)
def test_an_attachment_leaves_rest_at_rest(attachment: Attachment) -> None:
    still = np.zeros(500)
    np.testing.assert_array_equal(held(attachment, still, still), still)


def test_a_gain_fades_and_an_arm_swings_by_its_formula() -> None:
    time = STEP * np.arange(WAVE.size)
    faded = act(FadingGain(axis="x", loss=0.1, settling=0.01), WAVE)
    np.testing.assert_allclose(faded, WAVE * (1.0 + 0.1 * np.expm1(-time / 0.01)))
    bent = act(SwingingArm(axis="x", radius=1e-3), WAVE, 2.0 * WAVE)
    np.testing.assert_allclose(bent, WAVE + (2.0 * WAVE) ** 2 / 2e-3)
