"""The folder of a survey: a JSON file for each recording, and a Parquet table of all."""

import json
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import AXES
from afm_scan_ros.features.survey.recording import QUANTITIES, Recording
from afm_scan_ros.files.paths import replacing, write_text
from afm_scan_ros.files.records import from_mapping, to_mapping

TABLE, ROWS = "survey.parquet", "recordings"


def require_parquet() -> None:
    """Raise InputError where the table cannot be written."""
    if find_spec("pyarrow") is None:
        raise InputError(
            f"{TABLE} is written by pyarrow, which is not installed:"
            " pip install 'afm_scan_ros[survey]'"
        )


@frozen
class SurveyFolder:
    """The folder of a survey, which keeps a recording by the name of its bag's path."""

    path: Path

    def kept(self) -> dict[str, Recording]:
        """Return the recordings by their names.

        Raises InputError for a file that is not as this package wrote it.
        """
        return {file.stem: _read(file) for file in sorted((self.path / ROWS).glob("*.json"))}

    def keep(self, name: str, recording: Recording) -> None:
        """Write a recording in place of what was kept by this name."""
        document = json.dumps(to_mapping(recording), indent=1, allow_nan=False)
        write_text(self.path / ROWS / f"{name}.json", document)

    def save_table(self, recordings: Iterable[Recording]) -> None:
        """Write the table, a row for each recording."""
        import pyarrow as pa  # noqa: PLC0415 - of an extra
        from pyarrow import parquet  # noqa: PLC0415 - of an extra

        table = pa.Table.from_pylist([_row(each) for each in recordings], schema=_schema(pa))
        with replacing(self.path / TABLE) as beside:
            parquet.write_table(table, beside)


def _read(file: Path) -> Recording:
    try:
        content = json.loads(file.read_text("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file}: {error}: remove it, and run the survey again") from error
    return from_mapping(Recording, content, str(file))


def _schema(pa: Any) -> Any:  # noqa: ANN401 - the module is of an extra
    number, text = pa.float64(), pa.string()
    value = {"name": text, "unit": text, "value": number, "low": number, "high": number}
    effect = {
        **dict.fromkeys(("name", "kind", "axis"), text),
        "probability": number,
        "values": pa.list_(pa.struct(value)),
    }
    return pa.schema(
        {
            **dict.fromkeys(("bag", "instrument"), text),
            "recorded": pa.timestamp("ns", "UTC"),
            **dict.fromkeys(("scan_id", "motion"), text),
            "samples": pa.int64(),
            "sample_rate_hz": number,
            "verdict": text,
            **dict.fromkeys(_axis_columns(), number),
            "effects": pa.list_(pa.struct(effect)),
            "shortcomings": pa.list_(text),
            **dict.fromkeys(("error", "identity", "model", "version"), text),
        }
    )


def _axis_columns() -> list[str]:
    """Name the columns; each estimate has its interval: NAME_AXIS, and _low and _high."""
    ends = [f"{name}_{{}}{end}" for name in QUANTITIES for end in ("", "_low", "_high")]
    columns = ["detection_limit_{}_m", "residual_{}_m", *ends]
    return [column.format(axis) for axis in AXES for column in columns]


def _row(recording: Recording) -> dict[str, Any]:
    """One row; what is not known is null."""
    row = to_mapping(recording)
    del row["axes"]
    row |= {"recorded": recording.recorded or None, "sample_rate_hz": row.pop("sample_rate")}
    for each in recording.axes:
        row[f"detection_limit_{each.axis}_m"] = each.detection_limit
        row[f"residual_{each.axis}_m"] = each.residual
    for (axis, name), estimate in recording.estimates():
        ends = dict(zip(("_low", "_high"), estimate.interval, strict=True))
        row |= {f"{name}_{axis}{end}": v for end, v in {"": estimate.value, **ends}.items()}
    return {key: None if value == "" else value for key, value in row.items()}
