"""How large parameters are expected to be: the scales of the greatest marginal likelihood.

With the normal equations H δ = g about θ, the residuals are linear in θ, and under a prior of
precision Λ and mean m the logarithm of the marginal likelihood is, but for a constant,

    ½ bᵀ (H + Λ)⁻¹ b - ½ ln |H + Λ| + ½ ln |Λ|,    b = g + H (θ - m)

so that no record is looked at again.
Source: D. J. C. MacKay, Neural Computation 4 (1992) 415, section 3.
"""

from collections.abc import Mapping

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from afm_scan_ros.core.fit.parameters import SEARCHED, Layout
from afm_scan_ros.core.fit.settings import FitSettings
from afm_scan_ros.core.types import Array


def first_scales(settings: FitSettings) -> dict[str, float]:
    """Standard deviations at which the search begins."""
    return {name: settings.first_scale * getattr(settings, name) for name in SEARCHED}


def best_scales(
    layout: Layout, scales: Mapping[str, float], theta: Array, matrix: Array, right: Array
) -> dict[str, float]:
    """Double or halve each scale in turn for as long as the evidence grows by a tenth of a nat."""
    found = dict(scales)
    best = evidence(layout, found, theta, matrix, right)
    for name in SEARCHED:
        largest = getattr(layout.settings, name)
        for factor in (2.0, 0.5):
            while largest / 2.0**12 < found[name] * factor <= largest:
                trial = {**found, name: factor * found[name]}
                value = evidence(layout, trial, theta, matrix, right)
                if value <= best + 0.1:
                    break
                found, best = trial, value
    return found


def evidence(
    layout: Layout, scales: Mapping[str, float], theta: Array, matrix: Array, right: Array
) -> float:
    """Logarithm of the marginal likelihood, but for a constant; H is ``matrix``, g ``right``."""
    precision, mean = layout.prior(scales, theta)
    pulled = right + matrix @ (theta - mean)
    try:
        factor = cho_factor(matrix + precision)
    except LinAlgError:
        return -np.inf
    explained = 0.5 * float(pulled @ cho_solve(factor, pulled))
    volume = np.log(np.diag(factor[0])).sum() - 0.5 * np.linalg.slogdet(precision)[1]
    return float(explained - volume)
