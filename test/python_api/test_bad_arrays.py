"""What is wrong with a user's arrays is reported by name, and nothing is computed from them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import afm_scan_ros as afm

GOOD = np.linspace(0.0, 1.0, 50)
NAN, PLANE = np.array([0.0, np.nan]), np.zeros((50, 2))
SQUARE = np.zeros((9, 9))
IMAGE = afm.ScanImage(SQUARE, SQUARE, range_x=1e-5, range_y=1e-5)


def record(**changed: Any) -> afm.Record:  # noqa: ANN401 - whatever may be wrong
    given = {"drive": GOOD, "displacement": 5e-6 * GOOD, "sample_period": 1e-4}
    return afm.Record(**{**given, **changed})


BAD_RECORDS: dict[str, tuple[dict[str, Any], str]] = {
    "NaN": ({"drive": NAN}, r"drive is nan at sample 1, channel 0"),
    "masked": (
        {"displacement": np.ma.masked_greater(5e-6 * GOOD, 4e-6)},
        "displacement is masked at 40: give the part without gaps",
    ),
    "infinite": ({"displacement": np.full(50, np.inf)}, "displacement is inf at sample 0"),
    "unequal": ({"displacement": GOOD[:-1]}, "drive has 50 samples and displacement 49"),
    "more channels than axes": (
        {"displacement": PLANE},
        r"displacement has 2 channels, but the axes are x",
    ),
    "empty": ({"drive": []}, r"drive has shape \(0,\): give \(n,\) or \(n, channels\)"),
    "cube": ({"drive": np.zeros((2, 2, 2))}, r"drive has shape \(2, 2, 2\)"),
    "words": ({"drive": ["1", "2"]}, "drive is of type <U1"),
    "complex": ({"drive": GOOD + 1j}, "drive is of type complex128"),
    "ragged": ({"drive": [[1.0], [1.0, 2.0]]}, "drive is no array"),
    "no period": ({"sample_period": 0.0}, "sample_period is 0.0: give a positive number, in s"),
    "negative period": ({"sample_period": -1e-4}, "sample_period is -0.0001: give"),
    "NaN period": ({"sample_period": np.nan}, "sample_period is nan: give"),
    "infinite period": ({"sample_period": np.inf}, "sample_period is inf: give"),
    "period in words": ({"sample_period": "fast"}, "sample_period is 'fast'"),
    "period as a truth": ({"sample_period": True}, "sample_period is True: give"),
    "axis twice": (
        {"axes": ("x", "x"), "drive": PLANE, "displacement": PLANE},
        "axes names 'x' twice",
    ),
    "axes as a word": ({"axes": "xy"}, r"axes is of type str: give names of axes, as \('x', 'y'\)"),
    "no axis": ({"axes": ()}, "axes is empty"),
    "unknown kind": ({"kind": "noise"}, "kind 'noise' is unknown: give one of creep, frequency"),
    "unknown start": ({"start": "rest"}, "start 'rest' is unknown"),
    "axes as a number": ({"axes": 2}, r"axes is of type int: give names of axes"),
    "axes as numbers": ({"axes": (1,)}, r"axes\[0\] is of type int: give names of axes"),
    "scan in words": ({"scan": "raster"}, "scan is of type str: give a scan, as afm.ScanSpec"),
}


@pytest.mark.parametrize(("changed", "reason"), BAD_RECORDS.values(), ids=BAD_RECORDS)
def test_a_bad_record_is_refused(changed: dict[str, Any], reason: str) -> None:
    with pytest.raises(afm.InputError, match=reason):
        record(**changed)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"axes": ("z",), "name": "a.mcap"}, "^a.mcap: its axes are z: name them x and y, unless"),
        ({"drive": PLANE}, "drive has 2 channels, but the axes are x"),
    ],
)
def test_other_axes_than_x_and_y_have_no_traces_of_them(
    changed: dict[str, Any], reason: str
) -> None:
    with pytest.raises(afm.InputError, match=reason):
        record(**changed).traces()


@pytest.fixture(scope="module")
def model() -> afm.Model:
    return afm.load_model()


BAD_CALLS: dict[str, tuple[Callable[[afm.Model], object], str]] = {
    "one axis of two": (lambda m: m.invert(GOOD, 1e-4), r"desired has 1 channel, but .* x, y"),
    "three axes": (lambda m: m.predict(np.zeros((9, 3)), 1e-4), "drive has 3 channels"),
    "NaN drive": (lambda m: m.predict(np.full((9, 2), np.nan), 1e-4), "drive is nan at sample 0"),
    "period": (lambda m: m.invert(PLANE, 0.0), "sample_period is 0.0: give"),
    "unknown effect": (lambda m: m.invert(PLANE, 1e-4, ["drift"]), "no inverse is named 'drift'"),
    "one effect as a word": (
        lambda m: m.invert(PLANE, 1e-4, "creep"),
        r"effects is of type str: give a list of effects, as \['creep'\]",
    ),
    "drive beyond the model": (
        lambda m: m.predict(np.outer(GOOD, [9.0, 0.0]), 1e-4),
        r"drive is 4.041 V at sample 22, and the model was identified to 4 V",
    ),
    "no fit in a file": (lambda m: m.fit, "model.yaml: holds no fit"),
    "no record": (lambda m: afm.diagnose(m, []), "no record is given"),
    "drive in words": (lambda m: m.predict("up", 1e-4), "drive is of type <U2"),
    "no path": (lambda m: m.invert(None, 1e-4), "desired is of type object"),
    "no array": (lambda _: afm.trajectory("raster"), "spec is of type str: give a scan"),  # type: ignore[arg-type] # what is refused
    "limits as a number": (
        lambda m: m.invert(PLANE, 1e-4, limits=5.0),  # type: ignore[arg-type] # as above
        r"limits is of type float: give limits, as afm.DriveLimits\(",
    ),
    "effects as a number": (
        lambda m: m.invert(PLANE, 1e-4, effects=3),  # type: ignore[arg-type] # as above
        "effects is of type int: give a list of effects",
    ),
    "a model's file as a model": (
        lambda _: afm.diagnose("model.yaml", [record()]),  # type: ignore[arg-type] # as above
        r"model is of type str: give a model, as afm.load_model\(path\)",
    ),
    "one record to diagnose": (
        lambda m: afm.diagnose(m, record()),  # type: ignore[arg-type] # as above
        r"records is of type Record: give a list of records, as \[afm.read_record\(path\)\]",
    ),
    "arrays to diagnose": (
        lambda m: afm.diagnose(m, [GOOD]),  # type: ignore[list-item] # as above
        r"records\[0\] is of type ndarray: give a list of records",
    ),
    "a healthy path": (
        lambda m: afm.diagnose(m, [record()], healthy=["a"]),  # type: ignore[list-item] # as above
        r"healthy\[0\] is of type str: give a list of records",
    ),
    "one record to identify": (
        lambda _: afm.identify(record()),  # type: ignore[arg-type] # as above
        "records is of type Record: give a list of records",
    ),
    "arrays to identify": (
        lambda _: afm.identify([GOOD]),  # type: ignore[list-item] # as above
        r"records\[0\] is of type ndarray: give a list of records",
    ),
    "arrays as images": (
        lambda _: afm.identify_from_images([PLANE], 1e-5),  # type: ignore[list-item] # as above
        r"images\[0\] is of type ndarray: give a list of images, as \[afm.read_image\(path\)\]",
    ),
    "pitch in words": (
        lambda _: afm.identify_from_images([IMAGE], "10um"),  # type: ignore[arg-type] # as above
        "pitch is '10um': give a positive number, in m, as 10e-6",
    ),
    "pitch as a truth": (
        lambda _: afm.identify_from_images([IMAGE], True),  # noqa: FBT003 - what is refused
        "pitch is True: give a positive number",
    ),
    "no accuracy": (
        lambda _: afm.identify_from_images([IMAGE], 1e-5, accuracy=0.0),
        "accuracy is 0.0: give a positive number",
    ),
    "a bag's path as records": (
        lambda m: afm.diagnose(m, "bag"),  # type: ignore[arg-type] # as above
        r"records is of type str: give a list of records, as \[afm.read_record\(path\)\]",
    ),
    "a length of no experiment": (
        lambda m: afm.diagnose(m, [record()], longest=-1.0),
        "longest is -1.0: give a positive number, in s",
    ),
    "no states": (
        lambda _: afm.identify([record()], states=0),
        "states is 0: give a whole number, 2 or more",
    ),
    "an effect in the feedback as a word": (
        lambda _: afm.identify([record()], effects="maxwell_slip"),
        r"effects is of type str: give names of effects, as \['maxwell_slip'\]",
    ),
    "scans in words": (
        lambda m: afm.learn(m, afm.ScanSpec(), lambda drive: drive, scans="few"),  # type: ignore[arg-type] # as above
        "scans is 'few': give a whole number",
    ),
    "rows in words": (
        lambda _: afm.read_record(__file__, skip_rows="two"),  # type: ignore[arg-type] # as above
        "skip_rows is 'two': give a whole number, 0 or more",
    ),
    "scales in words": (
        lambda _: afm.identify_from_images([IMAGE], 1e-5, "high"),
        "volts_per_metre is 'high': give a positive number",
    ),
    "an array to correct": (
        lambda m: afm.correct_image(m, PLANE),  # type: ignore[arg-type] # as above
        r"image is of type ndarray: give an image, as afm.read_image\(path\)",
    ),
    "an image without range": (
        lambda _: afm.ScanImage(SQUARE, SQUARE, range_x=0.0, range_y=1e-5),
        "image: range_x = 0.0: give a number above 0, in m",
    ),
    "a range in words": (
        lambda _: afm.ScanImage(SQUARE, SQUARE, range_x="10um", range_y=1e-5),  # type: ignore[arg-type] # as above
        "image: range_x = '10um': give a number above 0, in m",
    ),
    "a range as a truth": (
        lambda _: afm.ScanImage(SQUARE, SQUARE, range_x=True, range_y=1e-5),
        "image: range_x = True: give a number above 0, in m",
    ),
    "heights in words": (
        lambda _: afm.ScanImage("x", SQUARE, range_x=1e-5, range_y=1e-5),  # type: ignore[arg-type] # as above
        "trace and retrace: give heights as numbers",
    ),
    "no time for a line": (
        lambda _: afm.ScanImage(SQUARE, SQUARE, range_x=1e-5, range_y=1e-5, line_time=-1.0),
        "image: line_time = -1.0: give a number above 0, in s",
    ),
    "an image whose line takes an unknown time": (
        lambda _: afm.identify_from_images([IMAGE], 1e-6),
        "image: the time of a line is not known: give line_time, or --line-time",
    ),
    "overscan in percent": (
        lambda _: afm.ScanImage(SQUARE, SQUARE, range_x=1e-5, range_y=1e-5, overscan=5.0),
        "image: overscan = 5.0: give a share of range_x",
    ),
    "a spec in words": (
        lambda m: afm.learn(m, "raster", lambda drive: drive),  # type: ignore[arg-type] # as above
        "spec is of type str: give a scan",
    ),
    "limits below zero": (
        lambda _: afm.DriveLimits(-1.0, 1e5),
        "voltage = -1.0: give a number above 0",
    ),
    "a limit as a truth": (
        lambda _: afm.DriveLimits(True, 1e5),  # noqa: FBT003 - what is refused
        "voltage = True: give a number above 0",
    ),
    "a short record": (lambda m: afm.diagnose(m, [record()]), "record 1: holds 50 samples"),
}


@pytest.mark.parametrize("given", [3, b"scan", "", None])
def test_what_is_no_path_is_refused_with_an_example(model: afm.Model, given: Any) -> None:  # noqa: ANN401 - whatever may be wrong
    calls: list[tuple[Callable[[Any], object], str]] = [
        (afm.read_record, "scan.mcap"),
        (afm.read_image, "grating.gwy"),
        (model.save, "model.yaml"),
    ]
    if given is not None:
        calls.append((afm.load_model, "model.yaml"))
    for call, example in calls:
        with pytest.raises(afm.InputError, match=rf"^path is .*: give a path, as '{example}'$"):
            call(given)


@pytest.mark.parametrize(("call", "reason"), BAD_CALLS.values(), ids=BAD_CALLS)
def test_a_bad_call_is_refused(
    model: afm.Model, call: Callable[[afm.Model], object], reason: str
) -> None:
    with pytest.raises(afm.InputError, match=reason):
        call(model)


def test_a_displacement_beyond_the_model_is_refused_by_sample_and_axis(model: afm.Model) -> None:
    desired = np.zeros((2000, 2))
    desired[:, 1] = 9e-5 * np.sin(np.linspace(0.0, np.pi, 2000)) ** 2
    with pytest.raises(afm.ScanError, match=r"sample \d+, axis y: .* beyond the identified"):
        model.invert(desired, 1e-4)


def test_a_drive_beyond_the_limits_is_refused(model: afm.Model) -> None:
    desired = 5e-6 * np.sin(np.linspace(0.0, np.pi, 2000)) ** 2
    desired = np.column_stack((desired, 0.0 * desired))
    with pytest.raises(afm.ScanError, match=r"axis x: drive \[V\] = .* beyond the amplifier's 0.3"):
        model.invert(desired, 1e-4, limits=afm.DriveLimits(0.3, 1e6))


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"columns": "drive_x=1:V"}, "give either a sample rate or a column 'time'"),
        ({"columns": "drive_x=1:V", "sample_rate": 0.0}, "sample_rate is 0.0: give a positive"),
        ({"columns": "drive_x=1:V", "sample_rate": 9.0}, "no column is achieved: name columns"),
        ({"columns": "height_x=1:V", "sample_rate": 9.0}, "'height_x' is not a quantity"),
    ],
)
def test_a_table_that_says_too_little_is_refused(
    tmp_path: Any,  # noqa: ANN401 - a path
    options: dict[str, Any],
    reason: str,
) -> None:
    file = tmp_path / "table.txt"
    np.savetxt(file, np.column_stack((GOOD, GOOD)))
    with pytest.raises(afm.InputError, match=reason):
        afm.read_record(file, **options)


def missing() -> object:
    return afm.load_model("nowhere.yaml")


def too_far() -> object:
    return afm.load_model().predict(np.full((50, 2), 1e3), 1e-4)


@pytest.mark.parametrize("call", [missing, too_far])
def test_no_inner_error_stands_before_what_is_reported(call: Callable[[], object]) -> None:
    """The message names all that an inner error knows, so a traceback shows it alone."""
    with pytest.raises(afm.InputError) as refused:
        call()
    assert refused.value.__cause__ is None
    assert refused.value.__suppress_context__


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        (
            {"range_x": 10},
            r"range_x = 10: give a number >= 1e-09 and <= 0.001 in m, as 4e-05",
        ),
        ({"range_y": "10um"}, "range_y = '10um': give a number"),
        ({"lines": 0}, "lines = 0: give a whole number >= 2, as 16"),
        ({"lines": 2.5}, "lines = 2.5: give a whole number"),
        ({"preparation_cycles": True}, "preparation_cycles = True: give a whole number"),
        ({"line_rate": np.nan}, "line_rate = nan: give a number > 0 in Hz, as 5"),
        ({"preparation_lower": -np.inf}, "preparation_lower = -inf: give a number in m"),
        ({"pattern": "zigzag"}, "pattern = 'zigzag': give one of raster, sinusoidal"),
        ({"pattern": 1}, "pattern = 1: give one of raster"),
    ],
)
def test_a_scan_out_of_range_is_refused_with_what_to_give(
    parameters: dict[str, Any], reason: str
) -> None:
    with pytest.raises(afm.InputError, match=reason):
        afm.ScanSpec(**parameters)
