"""Where the parameters of several forms stand: shared by all records, or each record's own."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.effect_type import EffectForm
from afm_scan_ros.core.types import Array


class Layout:
    """Values of p parameters in r records, (r, p), as the free numbers that they are, (f,)."""

    def __init__(self, forms: Sequence[EffectForm], records: int) -> None:
        self.parameters = [p for form in forms for p in form.parameters]
        own = np.array([p.own for p in self.parameters])
        index = np.tile(np.arange(len(own)), (records, 1))
        further = (records - 1, int(own.sum()))
        index[1:, own] = len(own) + np.arange(np.prod(further)).reshape(further)
        self._index = index
        self.count = int(index.max()) + 1

    @property
    def own(self) -> tuple[int, ...]:
        """Which free numbers are a record's own: parameter by parameter, in each record."""
        which = [p.own for p in self.parameters]
        return tuple(int(i) for i in self._index[:, which].T.ravel())

    def rows(self, free: Array) -> Array:
        """Values (r, p) of the free numbers (f,)."""
        return np.asarray(free[self._index])

    def free(self, rows: Array) -> Array:
        """Free numbers (f,) of values (r, p); of what is shared, the first record's counts."""
        numbers = np.empty(self.count)
        numbers[self._index[::-1]] = rows[::-1]
        return numbers

    def each(self, name: str) -> Array:
        """An attribute of the free numbers' parameters (f,), as their lower bounds."""
        of_parameters = np.array([getattr(p, name) for p in self.parameters], dtype=np.float64)
        return self.free(np.tile(of_parameters, (len(self._index), 1)))


def inserted(chain: Chain, forms: Sequence[EffectForm], rows: Array) -> Chain:
    """Chain with all forms, one after the other, at their values (r, p) in each record."""
    first, *further = (_inserted(chain.of_record(i), forms, row) for i, row in enumerate(rows))
    return evolve(first, elsewhere=tuple(further))


def _inserted(chain: Chain, forms: Sequence[EffectForm], values: Array) -> Chain:
    begin = 0
    for form in forms:
        count = len(form.parameters)
        chain = form.insert(chain, values[begin : begin + count])
        begin += count
    return chain
