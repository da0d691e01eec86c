"""YAML read as ROS 2 reads it, so that a file means the same to a node, to a command and to ROS.

PyYAML takes ``1e-6`` for a string and ``017`` for a decimal; rcl takes them for a double and for
an octal. The rules here are those of ``get_value`` in ``rcl_yaml_param_parser/src/parse.c``.
"""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.paths import write_text

Scalar: TypeAlias = bool | int | float | str
Value: TypeAlias = Scalar | list[Any] | dict[str, Any]

_TRUE = frozenset(["Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"])
_FALSE = frozenset(["N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"])
_INT64 = range(-(2**63), 2**63)
_LONGEST = 32
"""Characters of a whole number, more than any below 2**63 has in any base."""

LARGEST = 2**20
"""Bytes of a file, a hundred times those of any that people write."""
DEEPEST = 20
"""Values within each other."""
MOST_VALUES = 50_000
"""Values of a file, keys among them; each takes a kilobyte and 40 µs until it is read."""

_BOOL = re.compile(f"({'|'.join(sorted(_TRUE | _FALSE))})$")
_NULL = re.compile("$")
_INT = re.compile(r"[-+]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)$")
_FLOAT = re.compile(
    r"[-+]?((\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?"
    r"|0[xX]([\da-fA-F]+(\.[\da-fA-F]*)?|\.[\da-fA-F]+)([pP][-+]?\d+)?"
    r"|\.(inf|Inf|INF)|(?i:inf|infinity|nan))$|\.(nan|NaN|NAN)$",
    re.ASCII,
)


def _nothing(_: yaml.SafeLoader, node: yaml.ScalarNode) -> None:
    problem = "a value is missing; give one or remove its key"
    raise _Refusal(problem=problem, problem_mark=node.start_mark)


def _integer(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int | float | str:
    digits = node.value.lstrip("+-")
    if len(digits) > _LONGEST:
        return _double(loader, node)
    octal = len(digits) > 1 and digits.isdigit() and digits.startswith("0")
    magnitude = int(digits, 8 if octal else 0)
    value = -magnitude if node.value.startswith("-") else magnitude
    return value if value in _INT64 else _double(loader, node)


def _double(_: yaml.SafeLoader, node: yaml.ScalarNode) -> float | str:
    """Return a double; a string for a number beyond those, for which strtod sets ERANGE."""
    text = node.value.lower()
    if text.lstrip("+-.")[0] in "in":
        return float(re.sub(r"\.(inf|nan)$", r"\1", text))
    try:
        value = float.fromhex(text) if "x" in text else float(text)
    except OverflowError:
        return str(node.value)
    digits = re.sub(r"^[-+]?0x|p.*$", "", text) if "x" in text else text.partition("e")[0]
    vanished = value == 0.0 and re.search("[1-9a-f]", digits)
    return str(node.value) if vanished or math.isinf(value) else value


_QUOTE = "quote text that holds ':' or '#', or begins with one of []{}&*!|>%@`"
_SAID = {
    "mapping values are not allowed": "a second ':' in a value, or lines that are not indented"
    f" alike; indent keys of one section alike, and {_QUOTE}",
    "could not find expected ':'": "no ':' after a key; write 'key: value'",
    r"'\\t' that cannot start": "a tab; indent with spaces",
    "that cannot start any token": f"a character that begins no value; {_QUOTE}",
    "unexpected end of stream": "a quotation mark is not closed; close it",
    r"expected ',' or '\]'": "a list is not closed; end it with ']'",
    r"expected ',' or '\}'": "a mapping is not closed; end it with '}'",
    "sequence entries are not allowed": "a '-' within a line; write a list as [1.0, 2.0]",
    "unknown escape character": "a '\\' in double quotes; use single quotes",
    "expected the node content": "a value or a closing bracket is missing; add it",
    "expected a single document": "a second document; keep one, and no line '---'",
    "expected <block end>": "not indented as the lines above; indent keys of one section alike",
}
"""What is wrong and how to mend it, by PyYAML's own words."""
_UNSAID = "not YAML; write 'key: value' lines, and lists as [1.0, 2.0]"


class _Refusal(yaml.MarkedYAMLError):
    """What is refused here, in words of its own."""


class _Rules(yaml.resolver.BaseResolver):
    """Which plain scalars are not strings."""


for _tag, _pattern in {"null": _NULL, "bool": _BOOL, "int": _INT, "float": _FLOAT}.items():
    _Rules.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", _pattern, None)


class _Loader(yaml.SafeLoader):
    yaml_implicit_resolvers = _Rules.yaml_implicit_resolvers
    _depth = _values = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:  # noqa: ANN401 - PyYAML's own signature
        """Compose a value without aliases, which multiply, and tags, which change its type."""
        event = self.peek_event()  # type: ignore[no-untyped-call] # the stub's
        problem = ""
        if isinstance(event, yaml.AliasEvent):
            problem = "an alias (*); write the value out"
        elif event.tag is not None:
            problem = f"a tag ({event.tag}); leave it out"
        elif self._depth == DEEPEST:
            problem = f"values nested more than {DEEPEST} deep"
        elif self._values == MOST_VALUES:
            problem = f"more than {MOST_VALUES} values; give a shorter file"
        if problem:
            raise _Refusal(problem=problem, problem_mark=event.start_mark)
        self._values += 1
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:  # noqa: FBT001, FBT002 - PyYAML's own signature
        """Build a mapping whose keys are strings, each given once and with a value."""
        found: dict[str, Any] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _Refusal(problem="a key must be text", problem_mark=key.start_mark)
            if key.value in found:
                problem = f"key '{key.value}' is given twice; keep one"
                raise _Refusal(problem=problem, problem_mark=key.start_mark)
            found[key.value] = self.construct_object(value, deep=deep)
        return found


_Loader.add_constructor("tag:yaml.org,2002:null", _nothing)
_Loader.add_constructor("tag:yaml.org,2002:bool", lambda _, node: node.value in _TRUE)
_Loader.add_constructor("tag:yaml.org,2002:int", _integer)
_Loader.add_constructor("tag:yaml.org,2002:float", _double)


class _Dumper(yaml.SafeDumper):
    yaml_implicit_resolvers = _Rules.yaml_implicit_resolvers

    def ignore_aliases(self, _: object) -> bool:
        """Write every value out: rcl refuses aliases."""
        return True


def parse(text: str, where: str) -> Value | None:
    """Value of a YAML text, as in ``-p name:=text``; None if it is empty.

    Raises InputError naming ``where`` and the line.
    """
    try:
        value: Value | None = yaml.load(text, Loader=_Loader)  # noqa: S506 - a SafeLoader
    except yaml.MarkedYAMLError as error:
        raise InputError(f"{where}: {_place(error)}{_reason(error)}") from None
    except yaml.reader.ReaderError as error:
        line = 1 + text.count("\n", 0, error.position)
        problem = f"the character U+{error.character:04X} is not text; remove it"
        raise InputError(f"{where}: line {line}: {problem}") from None
    return value


def _place(error: yaml.MarkedYAMLError) -> str:
    """Name the line; what is not closed is where it begins."""
    begun = re.search("flow|quoted|simple key", str(error.context))
    mark = error.context_mark if begun and error.context_mark else error.problem_mark
    return f"line {mark.line + 1}: " if mark else ""


def _reason(error: yaml.MarkedYAMLError) -> str:
    if isinstance(error, _Refusal):
        return str(error.problem)
    said = f"{error.context} {error.problem}"
    return next((mend for known, mend in _SAID.items() if re.search(known, said)), _UNSAID)


def load(path: Path) -> dict[str, Any]:
    """Content of a YAML file that holds a mapping; raises InputError naming file and line."""
    value = parse(read_text(path), str(path))
    if not isinstance(value, dict):
        raise InputError(f"{path}: expected 'key: value' lines, found {_kind(value)}")
    return value


def save(path: Path, content: Mapping[str, Any], heading: str) -> None:
    """Write a mapping so that ``load`` gives it back, below a heading as comments."""
    body = yaml.dump(content, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=98)
    comment = "".join(f"# {line}\n" for line in heading.splitlines())
    write_text(path, f"{comment}{body}")


def read_text(path: Path) -> str:
    """Text of a file; raises InputError where there is none, or too much."""
    try:
        if (size := path.stat().st_size) > LARGEST:
            raise InputError(f"{path}: {size} bytes, over {LARGEST}; give a shorter file")
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start} is not UTF-8 text") from None
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; give a readable file") from None


def _kind(value: Value | None) -> str:
    return "nothing" if value is None else f"one {type(value).__name__}"
