"""Images of Nanosurf, ``.nid``, by Nanosurf's own package NSFopen.

Rows run from the lowest y to the highest, whatever the slow direction: ``NSFopen.process`` draws
them with the origin below, and ``CurLine``, the row scanned last, is 0 after a scan down. The
columns of ``Scan backward`` run from the lowest x too: trace and retrace of NSFopen's examples
agree as they are.

``Time/Line`` is the time of one direction. Nanosurf's package ``nanosurf`` 1.9.5 takes it for that
of the points of a forward line, in ``scan_module/gui.py``. ``line_time`` is therefore twice as
long. ``Overscan`` is stated in percent of the range, at each end.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import UPWARD, Direction, ScanFacts, metres
from afm_scan_ros.files.units import A_NUMBER, SECONDS

FRAMES = {"Scan forward": ("Forward", False), "Scan backward": ("Backward", True)}
"""Groups of the file, as NSFopen calls them, and whether they are the retrace."""
HEADER_MARK = b"\n\r\n\r"
"""What NSFopen takes for the end of the header."""
LONGEST, LARGEST = 2**14, 2**28
"""Bytes of a line, and those of all lines if each were as long: NSFopen takes as many."""
NUMBERED = re.compile(rb"Count=(\d+)")
DATA_MARK = b"\r\n#!"
"""What the header ends with; the samples of all channels follow."""
QUANTITY = re.compile(rf"({A_NUMBER})\s*(\S*)")
VECTOR = re.compile(r"[DV]\[([^],]*)(?:,[^]]*)?\]\*\[([^],]*)(?:,[^]]*)?\]")
PERCENT = {"%": 0.01}
IMAGING = "DataSet\\Parameters\\Imaging"

Sections = Mapping[str, Mapping[str, str]]


def read(nsfopen: ModuleType, path: Path) -> Iterator[Direction]:
    """Read all channels; raises InputError for a file cut short and a scan that was stopped."""
    content = path.read_bytes()
    _check_header(content.partition(HEADER_MARK)[0])
    found = nsfopen.nid_read(filename=str(path), dataframe=False)
    header: Sections = found.param["HeaderDump"]
    sections = list(_sections(header))
    _refuse_cut(content, sections)
    images = found.data.get("Image")
    if not images:
        raise InputError("holds no image, but other data: give a file of an image")
    for section in sections:
        if section["Frame"] in FRAMES:
            name = section["Dim2Name"]
            group, back = FRAMES[section["Frame"]]
            _refuse_stopped(section, header["DataSet-Info"].get("Scan direction", ""))
            facts = _facts(header, section)
            yield Direction(name, back, _unit(section, "Dim2"), facts, images[group][name])


def _check_header(header: bytes) -> None:
    """Raise ValueError for a header that NSFopen would read for ever, or in more memory."""
    lines = header.split(b"\r\n")
    longest = max(map(len, lines))
    if longest > LONGEST or longest * len(lines) > LARGEST:
        raise ValueError(f"{len(lines)} lines of up to {longest} bytes are no header")
    if any(int(stated) > len(lines) for stated in NUMBERED.findall(header)):
        raise ValueError("its header counts more than it has lines")


def _sections(header: Sections) -> Iterator[Mapping[str, str]]:
    """Yield what the file states of each channel, in the order of their samples."""
    stated = header["DataSet"]
    for group in range(int(stated["GroupCount"])):
        for channel in range(int(stated[f"Gr{group}-Count"])):
            if (key := f"Gr{group}-Ch{channel}") in stated:
                yield header[stated[key]]


def _refuse_cut(content: bytes, sections: Sequence[Mapping[str, str]]) -> None:
    """Raise InputError for another number of bytes than stated: NSFopen counts from the end."""
    there = len(content) - content.find(DATA_MARK) - len(DATA_MARK)
    bits = {int(each["SaveBits"]) for each in sections}
    stated = sum(int(e["Points"]) * int(e["Lines"]) * int(e["SaveBits"]) // 8 for e in sections)
    if DATA_MARK not in content or there != stated or len(bits) != 1:
        raise InputError(
            f"its header states {stated} bytes of samples and {there} follow: it was cut short or"
            " damaged, copy it again"
        )


def _refuse_stopped(section: Mapping[str, str], direction: str) -> None:
    """Raise InputError where the row scanned last is not that of the end of a scan."""
    last = {"Up": int(section["Lines"]) - 1, "Down": 0}.get(direction)
    current = section.get("CurLine")
    if None not in (last, current) and int(str(current)) != last:
        raise InputError(
            f"'{section['Dim2Name']}' was saved while its row {current} of {section['Lines']} was"
            " scanned: save a whole image"
        )


def _facts(header: Sections, section: Mapping[str, str]) -> ScanFacts:
    info, imaging = header["DataSet-Info"], header.get(IMAGING, {})
    range_x, range_y = (
        metres(f"the range of {axis}", float(section[f"{dim}Range"]), _unit(section, dim))
        for axis, dim in (("x", "Dim0"), ("y", "Dim1"))
    )
    one_way = _number(imaging.get("ScanTime") or info.get("Time/Line", ""), SECONDS)
    return ScanFacts(
        range_x,
        range_y,
        None if one_way is None else 2.0 * one_way,
        UPWARD.get(info.get("Scan direction", "").lower()),
        _number(imaging.get("OverScanSize") or info.get("Overscan", ""), PERCENT),
        _number(_decoded(imaging.get("Rotation") or info.get("Rotation", "")), {"°": 1.0}) or 0.0,
    )


def _unit(section: Mapping[str, str], dim: str) -> str:
    return _decoded(section[f"{dim}Unit"])


def _decoded(text: str) -> str:
    """Return a text of a header: NSFopen takes newer ones, in UTF-8, for Latin-1."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeDecodeError:
        return text


def _number(text: str, units: Mapping[str, float]) -> float | None:
    """Return ``780ms``, ``5 %``, ``D[5]*[%]`` or the first of ``V[2,2,0]*[s,s,s]`` in SI units."""
    vector = VECTOR.fullmatch(text)
    form = QUANTITY.fullmatch(f"{vector[1]} {vector[2]}" if vector else text.strip())
    return float(form[1]) * units[form[2]] if form and form[2] in units else None
