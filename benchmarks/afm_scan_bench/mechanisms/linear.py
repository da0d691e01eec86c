"""Linear equations s' = A s + b x under a motion x that is linear within a step, solved exactly.

Such a motion solves x'' = 0. Joined with the equations, one matrix exponential advances all of them
by a step. Source: C. Van Loan, IEEE Trans. Automatic Control 23 (1978) 395.
"""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array

TERMS = 24  # of the exponential's series: a step is far below every time constant


@frozen(eq=False)
class Stepping:
    """A step on is ``own`` @ s + ``before`` x at its beginning + ``after`` x at its end.

    Shapes (m, m), (m,) and (m,).
    """

    own: Array
    before: Array
    after: Array

    @classmethod
    def of(cls, flow: Array, entry: Array, step: float) -> "Stepping":
        """Exact for A = ``flow`` (1/s, shape (m, m)), b = ``entry`` (shape (m,)), step in s."""
        count = entry.size
        whole = np.zeros((count + 2, count + 2))
        whole[:count, :count], whole[:count, count] = step * flow, step * entry
        whole[count, count + 1] = 1.0
        term = total = np.eye(count + 2)
        for order in range(1, TERMS):
            term = term @ whole / order
            total = total + term
        after = total[:count, count + 1]
        return cls(total[:count, :count].copy(), total[:count, count] - after, after.copy())

    def run(self, state: Array, path: Array) -> Array:
        """State at each but the first of the instants of ``path`` (n + 1,), shape (n, m)."""
        return _run(state, path, self.own, self.before, self.after)


@compiled
def _run(state: Array, path: Array, own: Array, before: Array, after: Array) -> Array:
    states = np.empty((path.size - 1, state.size))
    last = state
    for k in range(path.size - 1):
        for i in range(state.size):
            total = before[i] * path[k] + after[i] * path[k + 1]
            for j in range(state.size):
                total += own[i, j] * last[j]
            states[k, i] = total
        last = states[k]
    return states
