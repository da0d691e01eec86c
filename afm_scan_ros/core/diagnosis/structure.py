"""What the structure of a model lacks: its own error is traced, and no longer an explanation.

Ordinarily a diagnosis asks what has changed since the model was identified, and its error on the
records of that time explains a residual as large. Here the model counts as exact, but for a share
of the motion. An effect is named only where nearly nothing is left beside it, as without one the
lack of fit is too large for any verdict but "unexplained".

A model that lacks an effect has been fitted around it: the best linear approximation of a spring
that hardens has a higher resonance than the spring at rest (J. Schoukens et al., Mastering System
Identification, 2nd ed., Wiley 2012, chapter 5). So gain, frequency and damping of the vibration are
fitted anew beside each effect, and without one.
"""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.settings import STRUCTURE
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.effects.parameter_shift import (
    GAIN,
    RESONANCE,
    insert_gain,
    insert_resonance,
)
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
    """Multiply gain, and frequency and damping of the first resonance where there is one."""
    try:
        return insert_resonance(insert_gain(chain, values[:1]), values[1:])
    except InputError:
        return insert_gain(chain, values[:1])


REFIT = EffectForm("", ("vibration",), (*GAIN, *RESONANCE), insert, example=(1.02, 0.98, 1.1))
"""The vibration fitted anew, beside each effect and without one."""
