"""Numbers of a plant file: their unit in the file, and their valid range."""

from collections.abc import Callable
from typing import Any

from attrs import field


def quantity(*checks: Callable[..., Any], suffix: str = "", scale: float = 1.0) -> Any:  # noqa: ANN401 - attrs types the field by its annotation
    """Declare a number: SI inside, ``name + suffix`` times ``scale`` in the file."""
    return field(validator=list(checks), metadata={"suffix": suffix, "scale": scale})
