"""YAML is read as rcl reads it."""

import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files import yaml

# From get_value in rcl_yaml_param_parser/src/parse.c: the lists of words, strtol with base 0 and
# strtod, in this order.
AS_RCL_READS = {
    "1e-6": 1e-6,
    "1.": 1.0,
    ".5": 0.5,
    "+1e5": 1e5,
    "0x1p3": 8.0,
    "-.inf": -math.inf,
    "inf": math.inf,
    "5": 5,
    "-5": -5,
    "017": 15,
    "08": 8.0,
    "0x1F": 31,
    "9223372036854775808": 2.0**63,
    "off": False,
    "n": False,
    "Yes": True,
    "on": True,
    "yEs": "yEs",
    "none": "none",
    "null": "null",
    "1_000": "1_000",
    "1:30": "1:30",
    "2020-01-01": "2020-01-01",
    "'5'": "5",
    '"off"': "off",
}


@pytest.mark.parametrize(("text", "value"), AS_RCL_READS.items())
def test_a_scalar_is_what_rcl_makes_of_it(text: str, value: object) -> None:
    read = yaml.parse(text, "-p")
    assert read == value
    assert type(read) is type(value)


def test_nan_is_a_number() -> None:
    assert all(math.isnan(yaml.parse(text, "-p")) for text in (".nan", "nan"))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a: 1\na: 2", "line 2: key 'a' is given twice"),
        ("a: 1\nb:\n", "line 2: a value is missing"),
        ("a: 1\nb: [1,", "line 2"),
        ("a: !!python/object/apply:os.getcwd []", "os.getcwd); leave it out"),
        ("a: 1\nb: !!int word", "line 2: a tag (tag:yaml.org,2002:int); leave it out"),
        ("a: *x", "line 1: an alias (*); write the value out"),
        ("a: &x [1]\nb: [*x, *x]", "line 2: an alias (*); write the value out"),
        ("a: " + 30 * "[", "line 1: values nested more than 20 deep"),
        ("a: 1\n" * 2**18, "over 1048576; give a shorter file"),
        ("? [1]\n: 2", "line 1: a key must be text"),
        ("just words", "expected 'key: value' lines"),
        ("", "found nothing"),
        ("a: 1\nb: \x01", "line 2: the character U+0001 is not text; remove it"),
        ("a: 1\nb: c: 2", "line 2: a second ':' in a value"),
        ("a: 1\n  b: 2", "line 2: a second ':' in a value, or lines that are not indented alike"),
        ("a:\n  b: 1\n c: 2", "line 3: not indented as the lines above; indent keys"),
        ("a: 1\nb\nc: 2", "no ':' after a key; write 'key: value'"),
        ("a:\n\tb: 1", "line 2: a tab; indent with spaces"),
        ("a: 1\nb: @x", "line 2: a character that begins no value; quote text"),
        ("a: 1\nb: 'x\nc: 2", "line 2: a quotation mark is not closed; close it"),
        ("a: 1\nb: [1, 2\nc: 3\nd: 4", "line 2: a list is not closed; end it with ']'"),
        ("a: 1\nb: {c: 1\nd: 3\ne: 4", "line 2: a mapping is not closed; end it with '}'"),
        ("a: - 1", "line 1: a '-' within a line; write a list as [1.0, 2.0]"),
        ('a: "C:\\data"', r"line 1: a '\' in double quotes; use single quotes"),
        ("a: 1\n---\nb: 2", "a second document; keep one"),
        ("a: 1\n%x: 2\n}", "line 2: "),
    ],
)
def test_a_bad_file_is_refused_by_name_and_line(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "scan.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        yaml.load(path)
    said = str(refusal.value)
    assert said.startswith(str(path))
    assert reason in said
    assert not re.search(r"block|flow|token|stream|scanning|parsing|<|mapping values", said)


def test_what_is_no_double_is_text_however_long() -> None:
    """For rcl it is a string too: strtod says that it is out of range."""
    digits = 50_000 * "9"
    beyond = (digits, f"0x{digits}", "-0x1p9999", "1e999", "-1e999", "1e-999", "0x1p-9999")
    for text in (*beyond, f"{digits}z", f"0x{digits}z"):  # not in a time that grows with the square
        assert yaml.parse(text, "here") == text
    for text in ("0.0", "-0e9", "0x0p5", "0e999"):
        assert yaml.parse(text, "here") == 0.0


def test_what_is_no_text_file_is_refused_by_name(tmp_path: Path) -> None:
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\x89MCAP\xff")
    for path in (tmp_path / "missing.yaml", tmp_path, binary):
        with pytest.raises(InputError, match=path.name):
            yaml.load(path)


scalars = st.one_of(
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False),
    st.text(st.characters(codec="ascii", categories=("L", "N", "P", "Zs"))),
    st.sampled_from(list(AS_RCL_READS)),
)
keys = st.text(st.characters(codec="ascii", categories=("L", "N")), min_size=1)
mappings = st.dictionaries(keys, st.one_of(scalars, st.lists(scalars)), min_size=1)


@given(mappings)
def test_what_is_saved_is_loaded(
    tmp_path_factory: pytest.TempPathFactory, content: dict[str, object]
) -> None:
    path = tmp_path_factory.mktemp("yaml") / "file.yaml"
    yaml.save(path, content, "heading")
    assert yaml.load(path) == content
