"""What the structure of a model lacks: its own error is traced, and no longer an explanation.

Ordinarily a diagnosis asks what has changed since the model was identified, and its error on the
records of that time explains a residual as large. Here the model counts as exact, but for a share
of the motion. An effect is named only where nearly nothing is left beside it, as without one the
lack of fit is too large for any verdict but "unexplained".

A model that lacks an effect has been fitted around it: the best linear approximation of a spring
that hardens has a higher resonance than the spring at rest (J. Schoukens, R. Pintelon and
Y. Rolain, Mastering System Identification in 100 Exercises, Wiley 2012). So the gain, the
first resonance's frequency and damping, and the share of the response that adds to that resonance
are fitted anew beside each effect, and without one.
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
from afm_scan_ros.core.effects.vibration import Resonance, VibrationModel, first_resonance
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import AxisModel, ModelDiscrepancy, ScannerModel
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


def insert(chain: Chain, values: Array) -> Chain:
    """Fit the vibration anew: its gain, its first resonance, and the share of what is beside that.

    Where there is no resonance the gain alone counts.
    """
    try:
        resonance = first_resonance(chain.model.vibration)
    except InputError:
        return insert_gain(chain, values[:1])
    beside = with_beside(chain.model.vibration, resonance, float(values[3]))
    chain = chain.with_model(vibration=beside)
    return insert_resonance(insert_gain(chain, values[:1]), values[1:3])


def with_beside(vibration: VibrationModel, resonance: Resonance, share: float) -> VibrationModel:
    """Return G with a share of what adds to its first resonance, the gain at rest being kept.

    With G's denominator d = f r, f being the resonance's factor, n / d = a / f + b / r. Time is
    scaled by the resonance, or coefficients span decades.
    """
    rest, omega = np.array(resonance.rest), resonance.omega
    if len(rest) == 1:
        return vibration
    scale = omega ** np.arange(len(vibration.denominator) - 1, -1.0, -1.0)
    below = np.array(vibration.denominator) * scale
    above = np.pad(vibration.numerator, (len(below) - len(vibration.numerator) - 1, 0)) * scale[1:]
    factor = resonance.factor * omega ** np.array([2.0, 1.0, 0.0])
    others = rest * scale[-len(rest) :]
    size = len(above)
    columns = [np.convolve(others, each) for each in np.eye(2)]
    columns += [np.convolve(factor, each) for each in np.eye(len(others) - 1)]
    rows = np.array([np.pad(each, (size - len(each), 0)) for each in columns])
    parts = np.linalg.solve(rows.T, above)
    parts[2:] *= share
    changed = parts @ rows
    return evolve(vibration, numerator=changed * (above[-1] / changed[-1]) / scale[1:])


REFIT = EffectForm(
    "",
    ("vibration",),
    (*GAIN, *RESONANCE, EffectParameter("share_beside", "1", 0.0, 2.0, 1e-6, neutral=1.0)),
    insert,
    example=(1.02, 0.98, 1.1, 0.5),
)
"""The vibration fitted anew, beside each effect and without one."""
