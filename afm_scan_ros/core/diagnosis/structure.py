"""What the structure of a model lacks: its own error is traced, and no longer an explanation.

Ordinarily a diagnosis asks what has changed since the model was identified, and its error on the
records of that time explains a residual as large. Here the model counts as exact, but for a share
of the motion. An effect is named only where nearly nothing is left with it; otherwise the lack of
fit makes the verdict "unexplained".

A model that lacks an effect has been fitted around it: the best linear approximation of a spring
that hardens has a higher resonance than the spring at rest (J. Schoukens, R. Pintelon and
Y. Rolain, Mastering System Identification in 100 Exercises, Wiley 2012). So the gain, the
first resonance's frequency and damping, and a factor on the remainder of the response are nuisance
parameters of every hypothesis, that without an effect included.
"""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.settings import STRUCTURE
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter
from afm_scan_ros.core.effects.parameter_shift import (
    GAIN,
    RESONANCE,
    insert_gain,
    insert_resonance,
)
from afm_scan_ros.core.effects.vibration import VibrationModel, first_resonance
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import AxisModel, ModelDiscrepancy, ScannerModel
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array


def counted_exact(model: ScannerModel) -> ScannerModel:
    """Return a model whose error in each band is a share of the whole motion of its records."""
    return evolve(model, **{name: _exact(model.axis(name)) for name in model.axes})


def _exact(axis: AxisModel) -> AxisModel:
    known = tuple(map(_of_exact, axis.model_discrepancies))
    return evolve(axis, model_discrepancy=known[0], known_elsewhere=known[1:]) if known else axis


def _of_exact(known: ModelDiscrepancy) -> ModelDiscrepancy:
    rms = STRUCTURE.exact * float(np.linalg.norm(known.displacement))
    return evolve(known, rms=np.full(len(known.rms), rms))


def refitted(axis: AxisModel, values: Array) -> AxisModel:
    """Return an axis of another gain, first resonance, and remainder of the response.

    Where there is no resonance the gain alone counts.
    """
    gain, frequency, damping, remainder = values
    chain = insert_gain(Chain(axis), np.array([gain]))
    try:
        chain = chain.with_model(vibration=with_remainder(chain.model.vibration, remainder))
        return insert_resonance(chain, np.array([frequency, damping])).model
    except InputError:
        return chain.model


def with_remainder(vibration: VibrationModel, factor: float) -> VibrationModel:
    """Multiply what G has besides its first resonance, its gain at rest being kept.

    With G's denominator d = f r, f being the resonance's factor, n / d = a / f + b / r. The residue
    at the resonance's pole gives a. Raises InputError where there is no resonance.
    """
    resonance = first_resonance(vibration)
    damping = resonance.damping
    pole = resonance.omega * complex(-damping, np.sqrt(1.0 - damping**2))
    slope = np.polyval(np.polyder(vibration.denominator), pole)
    residue = np.polyval(vibration.numerator, pole) / slope
    of_resonance = 2.0 * np.array([residue.real, -(residue * np.conj(pole)).real])
    alone = np.polymul(of_resonance, resonance.rest)
    changed = np.polyadd(factor * np.array(vibration.numerator), (1.0 - factor) * alone)
    return evolve(vibration, numerator=changed * (vibration.numerator[-1] / changed[-1]))


REMAINDER = EffectParameter("remainder_factor", "1", 0.0, 2.0, 1e-6, neutral=1.0)


def refit_of(axis: AxisModel) -> EffectForm:
    """Return the vibration of an axis as a form, which replaces the chain of that axis."""
    return EffectForm(
        "",
        ("vibration",),
        (*GAIN, *RESONANCE, REMAINDER),
        lambda _, values: chain_of(refitted(axis, values)),
        example=(1.02, 0.98, 1.1, 0.5),
    )
