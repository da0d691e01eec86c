"""Fields of settings classes: each number that decides, with its unit, meaning and source."""

from typing import Any

from attrs import field


def setting(default: float, unit: str, meaning: str, source: str) -> Any:  # noqa: ANN401 - as attrs.field
    """Return the field of a settings class; the page of settings is written from it.

    ``source`` is the argument or the publication that the default follows from.
    """
    return field(default=default, metadata={"unit": unit, "meaning": meaning, "source": source})
