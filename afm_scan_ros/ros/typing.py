"""Names for annotations that the type checker cannot see through."""

from typing import Any, TypeAlias

# Made from .msg files at run time, by rosidl or by the stand-in.
Message: TypeAlias = Any
