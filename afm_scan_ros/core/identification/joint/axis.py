"""Records of one axis, of any kinds → its model, as far as they identify it.

Steps identify the creep, a multisine or a sweep the vibration. Any motion identifies the hysteresis
and, where nothing else does, a lag or a resonance and one element of creep. All else is unknown.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.model_of_fit import direct_of
from afm_scan_ros.core.identification.agreement import refuse_inconsistent, refuse_other_gain
from afm_scan_ros.core.identification.alternating import AxisRecord, response_to
from afm_scan_ros.core.identification.creep.fit import CreepFit, fit_creep
from afm_scan_ros.core.identification.findings import (
    Finding,
    Hum,
    MissingTurns,
    NotValidated,
    UnknownStart,
    ValidationMismatch,
)
from afm_scan_ros.core.identification.hysteresis.everett_fit import LEVELS as CURVE_LEVELS
from afm_scan_ros.core.identification.hysteresis.everett_fit import fit_forward
from afm_scan_ros.core.identification.hysteresis.reversal_curves import (
    missing_turns,
    reversal_curves,
)
from afm_scan_ros.core.identification.joint.density import surface_of
from afm_scan_ros.core.identification.joint.fit import COARSE, JointFit, fit_jointly, grid_of
from afm_scan_ros.core.identification.joint.moving import MovingRecord
from afm_scan_ros.core.identification.joint.search import LAGS, NO_CREEP
from afm_scan_ros.core.identification.records.kinds import recognised
from afm_scan_ros.core.identification.statuses import (
    creep_status,
    spanning,
    unknown,
    vibration_status,
)
from afm_scan_ros.core.identification.validation import (
    PREDICTED,
    Validation,
    of_fitted,
    validate_from,
)
from afm_scan_ros.core.identification.vibration.rational_fit import (
    LINES_PER_POLE,
    Order,
    RationalFit,
    fit_rational,
)
from afm_scan_ros.core.identification.vibration.structure import fit_chosen
from afm_scan_ros.core.model import (
    AxisModel,
    BaseEffects,
    CreepModel,
    EffectStatus,
    HysteresisModel,
    ModelDiscrepancy,
    VibrationModel,
)
from afm_scan_ros.core.types import ProgressCallback

LEVELS = 41
"""Levels of a straight surface, and of the direct inverse of one that was fitted."""
ROUNDS = 2
"""Turns of hysteresis and vibration, where a frequency record identifies the vibration."""
UNIT = 1.0
"""m/V; the gain to which a response is fitted before its own is known."""


@frozen(eq=False)
class AnyRecord:
    """One axis of a record: its kind, None where none is recognised, and its signals.

    ``depolarised`` is whether it is known to begin so.
    """

    name: str
    kind: str | None
    signals: AxisRecord
    depolarised: bool = False

    @property
    def moving(self) -> MovingRecord:
        """The record, for what it shows of the hysteresis."""
        one = self.signals
        signals = one.drive, one.displacement, one.sample_period
        saturates = self.kind == "hysteresis"
        return MovingRecord(self.name, *signals, self.depolarised, saturates)


@frozen(eq=False)
class JointAxis:
    """What was identified of an axis: its model, and the fits that it is of, where there are such.

    ``validation`` is of the held-out record, where there is one.
    """

    model: AxisModel
    records: Sequence[AnyRecord]
    warnings: tuple[Finding, ...]
    creep: CreepFit | None
    vibration: RationalFit | None
    joint: JointFit | None
    validation: Validation | None


@frozen(eq=False)
class _Parts:
    """The records of an axis by what they identify."""

    steps: AnyRecord | None
    waves: AnyRecord | None
    moving: Sequence[AnyRecord]
    held_out: AnyRecord | None

    @classmethod
    def of(cls, records: Sequence[AnyRecord]) -> "_Parts":
        """Sort records; of each kind but those that move, the first counts."""

        def first(kind: str) -> AnyRecord | None:
            return next((record for record in records if record.kind == kind), None)

        moving = [record for record in records if record.kind in ("hysteresis", None)]
        return cls(first("creep"), first("frequency"), moving, first("validation"))

    @property
    def fitting(self) -> Sequence[AnyRecord]:
        """All but the one held out."""
        return [r for r in (self.steps, self.waves, *self.moving) if r is not None]


def identify_jointly(
    records: Sequence[AnyRecord],
    order: Order | None,
    progress: ProgressCallback,
    levels: int = CURVE_LEVELS,
) -> JointAxis:
    """Identify an axis from all its records but the one that is to validate.

    Where one record of reversal curves is all that moves, and shows no lag as long as a sample, the
    surface has so many ``levels``. Raises InputError where a record cannot show what it is for,
    ScanError where a search does not converge.
    """
    progress("looking for hum")
    quiet, lines = zip(*(record.signals.without_hum() for record in records), strict=True)
    records = [evolve(r, signals=signals) for r, signals in zip(records, quiet, strict=True)]
    parts = _Parts.of(records)
    if not parts.fitting:
        raise InputError("a validation record alone fits nothing: give more records")
    slow = None
    if parts.steps is not None:
        progress("fitting creep")
        steps = parts.steps.signals
        slow = fit_creep(steps.drive, steps.displacement, steps.sample_period)
    creep = None if slow is None else slow.model
    if parts.moving:
        joint, waves = _of_motion(parts, creep, order, progress)
        _refuse_inconsistent(parts, joint, waves)
        curves = waves is None and _are_slow_curves(parts.moving, joint)
        joint = joint.at_once(parts.moving[0].signals.sample_period) if curves else joint
        hysteresis, vibration = hysteresis_of(joint, waves)
        creep = joint.dynamics.creep
        if curves:
            progress("fitting the reversal curves")
            hysteresis = _of_curves(parts.moving[0].signals.freed_of(creep), _gain(joint), levels)
    else:
        joint, waves, creep = None, None, creep or NO_CREEP
        straight = _straight(parts.fitting)
        hysteresis = HysteresisModel(straight, straight)
        vibration = _flat(parts.fitting[0].signals, creep)
        if parts.waves is not None:
            waves = _response([straight], parts.waves, creep, order)
            vibration = _scaled(waves.model, waves.gain_ratio)
    effects = _effects(parts, slow, waves, joint)
    model = AxisModel(hysteresis, vibration, creep, effects=effects)
    progress("validating")
    result = None if parts.held_out is None else error_of(model, parts.held_out)
    held_out = [] if result is None else [result.model_discrepancy]
    model = model.also_known((*held_out, *_errors_of_fit(model, parts, joint)))
    found = (*(slow.warnings if slow else ()), *(waves.warnings if waves else ()))
    hum = (Hum.of(record.name, each) for record, each in zip(records, lines, strict=True) if each)
    warnings = (*hum, *_findings(parts, result), *found)
    return JointAxis(model, records, warnings, slow, waves, joint, result)


def _of_motion(
    parts: _Parts, creep: CreepModel | None, order: Order | None, progress: ProgressCallback
) -> tuple[JointFit, RationalFit | None]:
    """Fit what moves; the vibration is a frequency record's where there is one."""
    moving = [record.moving for record in parts.moving]
    if parts.waves is None:
        return fit_jointly(moving, None, creep, progress), None
    _refuse_larger(parts.waves, parts.moving)
    surfaces, slow = [_straight(parts.fitting)], creep or NO_CREEP
    for _ in range(ROUNDS):
        waves = _response(surfaces, parts.waves, slow, order)
        joint = fit_jointly(moving, waves.model, creep, progress)
        slow, gain = joint.dynamics.creep, _gain(joint)
        surfaces = [hysteresis_of(joint, None)[0].surface, _from_rest(joint.coarser, gain)]
    return joint, waves


def _refuse_inconsistent(parts: _Parts, joint: JointFit, waves: RationalFit | None) -> None:
    """Refuse a record that is not of the scanner that the others are of."""
    others = [each for each in (parts.steps, *parts.moving, parts.held_out) if each is not None]
    compared = [each.moving for each in others]
    refuse_inconsistent(compared, joint.dynamics, grid_of(compared, COARSE))
    if waves is not None and waves.identifies_gain:
        refuse_other_gain(waves.gain_ratio / _gain(joint))


def _response(
    surfaces: Sequence[EverettSurface], waves: AnyRecord, creep: CreepModel, order: Order | None
) -> RationalFit:
    """Fit the response to F = H(u), its gain at rest being UNIT.

    Of the surfaces the first is H, the others are coarser. The intervals span what they find, and
    what a larger model does.
    """
    rigid = waves.signals.freed_of(creep)
    response, *others = (response_to(Preisach(each), rigid).seen() for each in surfaces)
    period = rigid.sample_period
    if order is None:
        found = fit_chosen(response, period, UNIT)
    else:
        found = fit_rational(response, period, UNIT, order)
    coarser = [fit_rational(each, period, UNIT, found.order) for each in others]
    more = Order(found.order.poles + 2, found.order.zeros + 2)
    identifiable = len(response.omega) >= LINES_PER_POLE * more.poles
    larger = [fit_rational(response, period, UNIT, more)] if identifiable else []
    return spanning(found, larger, coarser)


def _refuse_larger(waves: AnyRecord, moving: Sequence[AnyRecord]) -> None:
    reach = max(float(np.abs(record.signals.drive).max()) for record in moving)
    asked = float(np.abs(waves.signals.drive).max())
    if asked > reach:
        raise InputError(
            f"{waves.name}: its drive reaches {asked:.4g} V, those that show the hysteresis only"
            f" {reach:.4g} V; record loops at least as large, or name its columns the other way"
            " round if drive and displacement are exchanged"
        )


def hysteresis_of(
    joint: JointFit, waves: RationalFit | None
) -> tuple[HysteresisModel, VibrationModel]:
    """Fix the gauge: F is 0 at rest, and runs over as many volts as the drive."""
    gain = _gain(joint)
    forward = _from_rest(surface_of(joint.weights, joint.grid, 0.0), gain)
    vibration = joint.dynamics.vibration if waves is None else waves.model
    return HysteresisModel(forward, direct_of(forward, None, LEVELS)), _scaled(vibration, gain)


def _are_slow_curves(moving: Sequence[AnyRecord], joint: JointFit) -> bool:
    """Whether nothing moves but one record of reversal curves, with no lag as long as a sample.

    A shorter one cannot be distinguished from the width of the cells.
    """
    one = moving[0]
    if len(moving) > 1 or recognised(one.signals.drive) != "hysteresis":
        return False
    lag, *others = joint.vibration or (None,)
    lasts = lag is not None and (lag.upper is None or lag.upper >= one.signals.sample_period)
    return not others and not lasts


def _of_curves(slow: AxisRecord, gain: float, levels: int) -> HysteresisModel:
    """Fit reversal curves freed of creep, as finely as they turn; ``gain`` is in m/V.

    What follows the hysteresis is so fast that the next sample shows where a drive leads.
    """
    drive, reached = slow.drive[:-1], slow.displacement[1:]
    fitted = fit_forward(drive, reached, reversal_curves(drive), levels).surface
    forward = _from_rest(fitted, gain)
    return HysteresisModel(forward, direct_of(forward, None, LEVELS))


def _gain(joint: JointFit) -> float:
    """Displacement (m) over all the drive's range, over that range (V)."""
    return 2.0 * float(joint.weights.sum()) / joint.grid.width


def _from_rest(surface: EverettSurface, gain: float) -> EverettSurface:
    """Surface in m, over a gain (m/V): F in V, 0 at rest."""
    raw = evolve(surface, values=surface.values / gain)
    return evolve(raw, offset=-float(Preisach(raw).at_rest().now[1]))


def _straight(records: Sequence[AnyRecord]) -> EverettSurface:
    """Surface of no hysteresis, F = u, over the range of all drives and rest."""
    lower = min(0.0, *(float(record.signals.drive.min()) for record in records))
    upper = max(0.0, *(float(record.signals.drive.max()) for record in records))
    levels = np.linspace(lower, upper, LEVELS)
    return EverettSurface(lower, upper, np.tril(0.5 * (levels[:, np.newaxis] - levels)), lower)


def _flat(record: AxisRecord, creep: CreepModel) -> VibrationModel:
    """Vibration too fast to be seen, with the gain that a record shows."""
    chain = Creep(creep, record.sample_period)
    expected = chain.apply(chain.at_rest(), record.drive)[1]
    expected, moved = expected - expected.mean(), record.displacement - record.displacement.mean()
    gain = float(expected @ moved / (expected @ expected))
    return VibrationModel((gain,), (float(LAGS[0]) * record.sample_period, 1.0))


def _scaled(vibration: VibrationModel, gain: float) -> VibrationModel:
    return evolve(vibration, numerator=tuple(gain * each for each in vibration.numerator))


def _effects(
    parts: _Parts, slow: CreepFit | None, waves: RationalFit | None, joint: JointFit | None
) -> BaseEffects:
    """How each effect is known; a range that holds for what moved is that of what moved."""
    creep, hysteresis, vibration = unknown("creep"), unknown("hysteresis"), unknown("frequency")
    if joint is not None:
        moved = [record.moving for record in parts.moving]
        slowest, fastest = (pick(one.swings for one in moved) for pick in (min, max))
        drive = joint.grid.lower, joint.grid.upper
        hysteresis = EffectStatus(drive=drive, frequencies=(0.0, fastest))
        if joint.creep is not None:
            one_way = (0.5 / fastest, 0.5 / slowest)
            creep = EffectStatus(drive=drive, hold_times=one_way, intervals=joint.creep)
        if joint.vibration is not None:
            vibration = EffectStatus(
                drive=drive, frequencies=(0.0, fastest), intervals=joint.vibration
            )
    if slow is not None and parts.steps is not None:
        creep = creep_status(slow, parts.steps.signals)
    if waves is not None and parts.waves is not None:
        gauge = None if joint is None else _gain(joint)
        vibration = vibration_status(waves, parts.waves.signals, gauge)
    return BaseEffects(creep, hysteresis, vibration)


def error_of(model: AxisModel, record: AnyRecord) -> Validation:
    """Return a model's residual of a record, from where its memory is known on.

    Raises InputError where the drive leaves the identified range.
    """
    return validate_from(model, record.signals, record.name, record.moving.known_from())


def error_from_start(model: AxisModel, record: AnyRecord) -> ModelDiscrepancy:
    """Return the error on a whole record, which holds that of an initial state not known.

    A record that is diagnosed holds such an error too. Raises InputError as ``error_of`` does.
    """
    return validate_from(model, record.signals, record.name, 0).model_discrepancy


def _errors_of_fit(
    model: AxisModel, parts: _Parts, joint: JointFit | None
) -> list[ModelDiscrepancy]:
    """Return the errors on the records of motion, which the fit has made smaller than they are.

    So in each band they are at least the share of the motion by which parts of the records are
    missed where the others predict them.
    """
    if joint is None:
        return []
    result = [error_from_start(model, one) for one in parts.moving]
    share = joint.held_out / float(np.mean([np.linalg.norm(one.displacement) for one in result]))
    return [of_fitted(one, share) for one in result]


def _findings(parts: _Parts, result: Validation | None) -> Iterator[Finding]:
    """Yield what a user should know of the records before trusting the model."""
    for record in parts.moving:
        if record.kind is None and (gap := missing_turns(record.signals.drive)) is not None:
            yield MissingTurns(record.name, *gap)
        if first := record.moving.known_from():
            yield UnknownStart(record.name, first * record.signals.sample_period)
    if result is None or parts.held_out is None:
        yield NotValidated()
        return
    moved = float(np.std(parts.held_out.signals.displacement))
    share = float(np.linalg.norm(result.model_discrepancy.rms)) / moved
    if share > PREDICTED:
        yield ValidationMismatch(parts.held_out.name, share)
