"""What DDS needs before a node joins it."""


def prepare() -> list[str]:
    """Return what is to be logged."""
    return []
