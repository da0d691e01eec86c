"""Coefficients as the model records keep them."""

from collections.abc import Iterable


def coefficients(values: Iterable[float]) -> tuple[float, ...]:
    """Return any run of numbers as a tuple of floats."""
    return tuple(float(value) for value in values)
