"""Whether a table in text ends within a number, as a file does whose writer was stopped.

Many whole files have no end of line after their last row, and a number cut short is a number too.
But a row is written as the others are. Its last number has fewer digits than in each of n other
rows by chance in one of n + 1 files at most.
"""

import re
from collections.abc import Sequence

CHANCE = 0.01
"""Share of whole files without an end of line that may be taken for files cut short."""
NUMBER = re.compile(r'\W*(?P<whole>\d*)(?P<fraction>[.,]\d*)?(?:[eE][-+]?(?P<exponent>\d*))?["\s]*')


def ends_within(cells: Sequence[str]) -> bool:
    """Whether the last of a column's cells has lost digits, of its mantissa or its exponent."""
    found = [match for match in map(NUMBER.fullmatch, cells) if match]
    mantissa = "fraction" if any(each["fraction"] for each in found) else "whole"
    if _shortest(found, mantissa):
        return True
    scaled = [each for each in found if each["exponent"]]
    return _shortest(scaled if found and found[-1]["exponent"] else found, "exponent")


def _shortest(found: Sequence[re.Match[str]], part: str) -> bool:
    """Whether the last has less of a part than each of the others, which are enough to judge by."""
    *others, last = [len(each[part] or "") for each in found] or [0]
    return len(others) + 1 >= 1.0 / CHANCE and last < min(others)
