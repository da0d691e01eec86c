"""Steps of a fit: Levenberg's and Marquardt's, bent as the valley that they follow.

The second derivative m'' of the model along a step v bends it by the geodesic acceleration

    (H + λ D) a = -Jᵀ W m'',    δ = v + a / 2.

Sources: K. Madsen, H. B. Nielsen and O. Tingleff, Methods for Non-Linear Least Squares Problems,
DTU 2004, algorithm 3.16, for the damping λ; M. K. Transtrum and J. P. Sethna, arXiv:1201.5885,
sections 3 and 4, for the acceleration.

How large parameters are expected to be, the scales of their prior, maximises the evidence. About θ
the residuals are linear, and under a prior of precision Λ and mean m it is, but for a constant,

    ½ bᵀ (H + Λ)⁻¹ b - ½ ln |H + Λ| + ½ ln |Λ|,    b = g + H (θ - m)

so that no record is looked at again.
Source: D. J. C. MacKay, Neural Computation 4 (1992) 415, section 3.
"""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.parameters import SEARCHED, Layout
from afm_scan_ros.core.types import Array

Mask: TypeAlias = NDArray[np.bool_]

VIBRATION = ("lags", "modes", "sensor")
"""Groups of parameters of V and M, which can be fitted while the operator is held."""
LINEAR = (*VIBRATION, "creep")
"""Those, and creep's."""


def settle(
    fit: AxisFit, steps: int, groups: Sequence[str] = (), *, searching: bool = False
) -> None:
    """Take steps until the objective falls no more, weighing the records after each.

    Where ``searching``, the scales are to stay the same too, or to be those of an earlier step. A
    fit stalls where as many such steps as there may be would bring no more than is left of a fit
    that has converged, although their damping does not fall.
    """
    tried: list[Mapping[str, float]] = []
    for _ in range(steps):
        before, scales, near = fit.discrepancy, fit.scales, fit.converged or fit.quadratic
        damping = fit.damping
        fell = step(fit, groups, searching=searching)
        fit.stalled = (
            fit.damping > 0.5 * damping and fit.layout.settings.most_steps * fell < fit.near
        )
        fell -= cover(fit, fell)
        fit.weigh()
        heavier = max(1.0, before / fit.discrepancy) ** 2
        fit.remaining = heavier * abs(fit.remaining - fell)
        chosen = not (searching and near) or fit.scales in [scales, *tried]
        tried += [scales] if near else []
        if chosen and (fit.converged or fit.stalled):
            break


def cover(fit: AxisFit, most: float) -> float:
    """Let the tables of an operator reach as far as its states do; return what that loses.

    Where tables on other cells would raise the objective by ``most`` (nat) or more, those that
    there are stay: beyond their cells they continue with the values of their edge.
    """
    operator = fit.layout.operator
    if not isinstance(operator, OneState):
        return 0.0
    pairs = zip(fit.records, fit.simulated(fit.theta), strict=True)
    states = [simulation.effective - record.drive for record, simulation in pairs]
    wider, theta = operator.covering(fit.layout.of_operator(fit.theta), np.concatenate(states))
    if wider is operator:
        return 0.0
    before, kept = fit.objective(fit.theta), (fit.layout, fit.theta)
    fit.layout = evolve(fit.layout, operator=wider)
    fit.theta = np.concatenate([theta, fit.theta[len(theta) :]])
    if (lost := fit.objective(fit.theta) - before) < most:
        return lost
    fit.layout, fit.theta = kept
    return 0.0


def step(fit: AxisFit, groups: Sequence[str] = (), *, searching: bool = False) -> float:
    """Take a step of some groups of parameters, or of all; return how far the objective fell.

    Where ``searching``, the scales of the greatest evidence are chosen first, if the last step
    showed the objective to be as quadratic as that evidence takes it to be, or had converged. A
    parameter that would fall below its lowest value stays there for this step, and so does a map
    behind the operator that would turn back on every step. What records remember is moved on its
    own, for the objective has a corner wherever a play begins to move.
    """
    free = np.zeros(fit.layout.size, bool)
    for name in groups or fit.layout.parts:
        free[fit.layout.parts[name]] = True
    memory = fit.layout.parts["memory"]
    alone = bool(free[memory].any())
    free[memory] = False
    held = not free[: fit.layout.parts["map"].stop].any()
    matrix, right = fit.normal(with_operator=not held)
    if searching and (fit.quadratic or fit.converged):
        fit.scales = best_scales(fit.layout, fit.scales, fit.theta, matrix, right)
    precision, mean = fit.layout.prior(fit.scales, fit.theta)
    right -= precision @ (fit.theta - mean)
    whole = fit.layout.conditioned(matrix + precision)
    metric = _metric(fit.layout, matrix, precision)
    equations = _Equations(whole, right, free, held, metric)
    fell = _descend(fit, _growing(fit, equations) if fit.grows else equations)
    mapped = fit.layout.parts["map"]
    if fell == 0.0 and free[mapped].any() and not fit.converged:
        free[mapped] = False
        fell = _descend(fit, _growing(fit, equations) if fit.grows else equations)
    return fell + recall(fit) if alone else fell


def recall(fit: AxisFit) -> float:
    """Move what records remember while all else is held; return how far the objective fell."""
    free = np.zeros(fit.layout.size, bool)
    free[fit.layout.parts["memory"]] = True
    matrix, right = fit.normal(with_operator=False)
    precision, mean = fit.layout.prior(fit.scales, fit.theta)
    whole = fit.layout.conditioned(matrix + precision)
    right -= precision @ (fit.theta - mean)
    kept = fit.damping, fit.remaining, fit.quadratic
    fit.damping, fit.quadratic = fit.damping_alone, True
    metric = np.diag(np.diag(whole))
    fell = _descend(fit, _Equations(whole, right, free, held=True, metric=metric))
    fit.damping_alone = fit.damping
    fit.damping, fit.remaining, fit.quadratic = kept
    return fell


def _metric(layout: Layout, matrix: Array, precision: Array) -> Array:
    """Metric D of the damping: the diagonal of the normal equations, but for an operator's tables.

    There most of it is the prior's precision, scaled to the same trace, so that smooth changes of
    a table are damped less than those of single coefficients.
    """
    whole, alone = np.diag(np.diag(matrix + precision)), layout.settings.damped_alone
    for name in layout.operator.parts:
        part = layout.parts[name]
        own, smooth = whole[part, part], precision[part, part]
        scaled = np.trace(own) / np.trace(smooth) * smooth
        whole[part, part] = alone * own + (1.0 - alone) * scaled
    return whole


def _growing(fit: AxisFit, equations: "_Equations") -> "_Equations":
    """Add the conditions that the surface of plays grows, of where their moves lead."""
    lowest, at = fit.layout.lowest() - fit.theta, fit.theta
    for _ in range(fit.layout.settings.most_trials):
        rows, lacks = fit.layout.lacking(at)
        lacks = lacks + rows @ (at - fit.theta)
        if len(lacks) == 0:
            break
        equations = equations.with_conditions(rows, lacks)
        at = fit.theta + equations.move(0.0, equations.right, lowest)
    return equations


@frozen(eq=False)
class _Equations:
    """Normal equations with the prior: H is ``matrix``, g is ``right``.

    ``free`` parameters move; ``held`` is whether none of them is the operator's. ``metric`` is D
    of the damping, which conditions do not change. Conditions that the start meets are squares all
    the same: ``unseen`` is what these add to the objective there.
    """

    matrix: Array
    right: Array
    free: Mask
    held: bool
    metric: Array
    unseen: float = 0.0

    def with_conditions(self, rows: Array, lacks: Array) -> "_Equations":
        """Add half the squares of what lacks after a move: ``lacks`` less rows times move."""
        matrix, right = self.matrix + rows.T @ rows, self.right + rows.T @ lacks
        unseen = self.unseen + 0.5 * float(np.sum(np.minimum(lacks, 0.0) ** 2))
        return evolve(self, matrix=matrix, right=right, unseen=unseen)

    def foreseen(self, move: Array) -> float:
        """By how much a move lowers the objective, were that quadratic."""
        return float(move @ self.right - 0.5 * move @ self.matrix @ move) - self.unseen

    def move(self, damping: float, right: Array, lowest: Array) -> Array:
        """Return the move towards ``right`` under a damping, none below its lowest."""
        damped = self.matrix + damping * self.metric
        return bounded(damped, right, self.free, lowest)


def _descend(fit: AxisFit, equations: _Equations) -> float:
    """Try ever shorter steps until one descends; return how far.

    Where none does, the damping stays what it was, for those of the next step are other equations.
    While the objective is as quadratic as steps take it to be, the first is tried without a bend.
    It is the only one where a fit that has converged would gain no more.
    """
    settings, start = fit.layout.settings, fit.theta
    lowest, before = fit.layout.lowest() - start, fit.objective(start)
    fit.remaining = equations.foreseen(equations.move(0.0, equations.right, lowest))
    straight, near = fit.quadratic or fit.converged, fit.converged
    fit.quadratic, worse, kept = False, 2.0, fit.damping
    for _ in range(1 if near else settings.most_trials):
        move = equations.move(fit.damping, equations.right, lowest)
        theta = start + (move if straight else _bent(fit, equations, move, lowest))
        fell = before - fit.objective(theta)
        if fell > 0.0:
            foreseen = equations.foreseen(move)
            share = fell / foreseen if foreseen > fell else 1.0
            better = max(1.0 / 3.0, 1.0 - (2.0 * share - 1.0) ** 3)
            fit.damping = max(better * fit.damping, settings.least_damping)
            fit.theta, fit.quadratic = theta, fell > 0.5 * fit.remaining
            return fell
        straight = False
        fit.damping, worse = worse * fit.damping, 2.0 * worse
    fit.damping = kept
    return 0.0


def _bent(fit: AxisFit, equations: _Equations, move: Array, lowest: Array) -> Array:
    """Return a move with its geodesic acceleration, if that is shorter than the move."""
    settings = fit.layout.settings
    try:
        right = fit.bent(move, settings.bend_step, with_operator=not equations.held)
    except (InputError, ScanError):  # a map turns back, a mode does not oscillate, or it overflows
        return move
    acceleration = equations.move(fit.damping, right, 2.0 * (lowest - move))
    sizes = [np.sqrt(each @ equations.metric @ each) for each in (acceleration, move)]
    return move + 0.5 * acceleration if sizes[0] < settings.most_bend * sizes[1] else move


def bounded(matrix: Array, right: Array, free: Mask, lowest: Array) -> Array:
    """Move of the free parameters, none below its lowest, that lowers ½ mᵀHm - gᵀm most.

    Those at their bound are held there first. All that would pass it are held too, and all held
    that pull away from it are let go, while these become fewer; then one at a time, so that this
    ends.
    Source: J. Kim and H. Park, SIAM J. Sci. Comput. 33 (2011) 3261, section 3.
    """
    move, loose, fewest = np.zeros(len(right)), free & (lowest < 0.0), len(right) + 1
    for _ in range(3 * len(right)):
        held = free & ~loose
        move[held] = lowest[held]
        pull = right[loose] - matrix[np.ix_(loose, held)] @ move[held]
        move[loose] = np.linalg.solve(matrix[np.ix_(loose, loose)], pull)
        wrong = np.flatnonzero((loose & (move < lowest)) | (held & (right - matrix @ move > 0.0)))
        if len(wrong) == 0:
            break
        exchanged = wrong if len(wrong) < fewest else wrong[-1:]
        fewest = min(fewest, len(wrong))
        loose[exchanged] = ~loose[exchanged]
    return np.where(free, np.maximum(move, lowest), 0.0)


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
