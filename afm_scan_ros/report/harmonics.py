"""A periodic disturbance by amplitude and phase, harmonic by harmonic."""

import math
from collections.abc import Iterator, Sequence

from attrs import frozen

from afm_scan_ros.core.diagnosis.result import Value
from afm_scan_ros.report.quantity import quantity
from afm_scan_ros.report.value_words import value_words

TOLD = 5.99 / 1.96**2
"""χ² of cosine and sine together by which 95 % exceed zero, in units of their 95 % intervals."""
CONVENTION = (
    "Amplitude and phase are those of amplitude cos(2 pi n frequency t - phase), n the harmonic;"
    " the JSON has cosines and sines. Of several records they are the first one's."
)


@frozen
class Harmonic:
    """Number, and the cosine and sine of one harmonic."""

    number: int
    cosine: Value
    sine: Value

    @property
    def told(self) -> bool:
        """Whether it can be told from zero."""
        pairs = ((v.value, v.halfwidth) for v in (self.cosine, self.sine))
        return sum((value / half) ** 2 if half else math.inf for value, half in pairs) > TOLD

    @property
    def most(self) -> float:
        """Amplitude that the intervals allow."""
        return math.hypot(*(abs(v.value) + v.halfwidth for v in (self.cosine, self.sine)))

    def rows(self) -> Iterator[tuple[str, str]]:
        """Yield amplitude and phase, to first order in their intervals."""
        (c, dc), (s, ds) = ((v.value, v.halfwidth) for v in (self.cosine, self.sine))
        size = math.hypot(c, s)
        along, across = math.hypot(c * dc, s * ds) / size, math.hypot(s * dc, c * ds) / size**2
        which = f" {self.number}" if self.number > 1 else ""
        yield f"amplitude{which}", quantity(size, along, self.cosine.parameter.unit)
        phase = math.degrees(math.atan2(s, c))
        yield f"phase{which}", quantity(phase, math.degrees(across), "°")


def harmonic_rows(values: Sequence[Value]) -> Iterator[tuple[str, str]]:
    """Yield a disturbance's frequency, its harmonics, and those not told from zero in one row."""
    named = {v.parameter.name: v for v in values}
    frequency = named.pop("frequency")
    yield "frequency", value_words(frequency)
    pairs = zip(*[iter(named.values())] * 2, strict=True)
    harmonics = [Harmonic(number, *pair) for number, pair in enumerate(pairs, 1)]
    for each in harmonics:
        if each.told:
            yield from each.rows()
    untold = [each for each in harmonics if not each.told]
    if untold:
        unit = untold[0].cosine.parameter.unit
        most = quantity(float(f"{max(each.most for each in untold):.1e}"), math.inf, unit)
        numbers = ", ".join(str(each.number) for each in untold)
        yield f"harmonics {numbers}", f"not told from 0, {most} at most"
