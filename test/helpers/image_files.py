"""Files of images as instruments write them, as small as their readers allow.

Each takes trace and retrace in the package's orientation: row 0 has the lowest y, column 0 the
lowest x.
"""

import struct
from pathlib import Path

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

Image = NDArray[np.float64]
STEP = 2.0**-32
"""Height in m of one unit of the integers in the files."""


@frozen(eq=False)
class Scan:
    """An image pair and how it was scanned: m, s, and degrees from the scanner's x to the lines."""

    trace: Image
    retrace: Image
    range_x: float
    range_y: float
    line_time: float
    upward: bool
    angle: float = 0.0


def write_nid(path: Path, scan: Scan) -> None:
    """Write a file of Nanosurf; its rows rise whatever the direction."""
    lines, pixels = scan.trace.shape
    last = lines - 1 if scan.upward else 0
    blocks = [
        (
            f"DataSet-{k}:1",
            f"Frame={frame}",
            f"Points={pixels}",
            f"Lines={lines}",
            f"CurLine={last}",
        )
        for k, frame in enumerate(("Scan forward", "Scan backward"))
    ]
    dims = [
        *("Dim0Unit=m", f"Dim0Range={scan.range_x!r}", "Dim0Min=0"),
        *("Dim1Unit=m", f"Dim1Range={scan.range_y!r}", "Dim1Min=0"),
        *("Dim2Name=Topography", "Dim2Unit=m", f"Dim2Range={STEP * 2**16!r}"),
        *(f"Dim2Min={-STEP * 2**15!r}", "SaveMode=Binary", "SaveBits=16"),
    ]
    header = [
        "[DataSet]",
        *("Version=2", "GroupCount=2", "Gr0-Name=Scan forward", "Gr0-Count=1"),
        *("Gr1-Name=Scan backward", "Gr1-Count=1", "Gr0-Ch0=DataSet-0:1", "Gr1-Ch0=DataSet-1:1"),
        "",
        "[DataSet-Info]",
        f"Scan direction={'Up' if scan.upward else 'Down'}",
        f"Time/Line={0.5 * scan.line_time!r} s",
        "Overscan=5 %",
    ]
    for title, *lines_of in blocks:
        header += ["", f"[{title}]", *lines_of, *dims]
    content = "\r\n".join(header).encode("latin-1") + b"\r\n\r\n\r\n#!"
    for image in (scan.trace, scan.retrace):
        content += np.rint(image / STEP).astype("<i2").tobytes()
    path.write_bytes(content)


def write_sxm(path: Path, scan: Scan) -> None:
    """Write a file of Nanonis; samples come in the order of their acquisition."""
    lines, pixels = scan.trace.shape
    times = (0.25 * scan.line_time, 0.75 * scan.line_time)
    header = [
        *(":NANONIS_VERSION:", "2", ":SCANIT_TYPE:", "FLOAT            MSBFIRST"),
        *(":SCAN_PIXELS:", f"{pixels} {lines}", ":SCAN_TIME:", f"{times[0]!r} {times[1]!r}"),
        *(":SCAN_RANGE:", f"{scan.range_x!r} {scan.range_y!r}"),
        *(":SCAN_ANGLE:", f"{scan.angle:.3E}"),
        *(":SCAN_DIR:", "up" if scan.upward else "down", ":DATA_INFO:"),
        "\tChannel\tName\tUnit\tDirection\tCalibration\tOffset",
        *("\t0\tCurrent\tA\tboth\t1\t0", "\t14\tZ\tm\tboth\t1\t0", "", ":SCANIT_END:"),
    ]
    content = "\n".join(header).encode("ascii") + b"\n\n\n\x1a\x04"
    rows = slice(None) if scan.upward else slice(None, None, -1)
    for image in (0.0 * scan.trace, 0.0 * scan.trace, scan.trace[rows], scan.retrace[rows, ::-1]):
        content += np.ascontiguousarray(image).astype(">f4").tobytes()
    path.write_bytes(content)


def write_spm(path: Path, scan: Scan) -> None:
    """Write a file of Bruker; its rows rise whatever the direction, and heights are in nm."""
    lines, pixels = scan.trace.shape
    sensitivity = 1e9 * STEP * 2**16
    head = [
        *(r"\*File list", r"\*Scanner list", rf"\@Sens. Zsens: V {sensitivity!r} nm/V"),
        *(r"\*Ciao scan list", rf"\Scan Rate: {1.0 / scan.line_time!r}"),
        rf"\Rotate Ang.: {scan.angle!r}",
    ]
    size = 2 * lines * pixels
    for number, way in enumerate(("Trace", "Retrace")):
        head += [
            *(r"\*Ciao image list", rf"\Data offset: {4096 + number * size}"),
            *(rf"\Data length: {size}", r"\Bytes/pixel: 2"),
            rf"\Frame direction: {'Up' if scan.upward else 'Down'}",
            *(rf"\Samps/line: {pixels}", rf"\Number of lines: {lines}"),
            *(rf"\Valid data len X: {pixels}", rf"\Valid data len Y: {lines}"),
            rf"\Aspect Ratio: {scan.range_x / scan.range_y!r}:1",
            rf"\Scan Size: {1e6 * scan.range_x!r} {1e6 * scan.range_y!r} ~m",
            *(rf"\Line Direction: {way}", r'\@2:Image Data: S [Height] "Height"'),
            r"\@2:Z scale: V [Sens. Zsens] (0.006713867 V/LSB) 1.000000 V",
            r"\@2:Z offset: V [Sens. Zsens] (0.006713867 V/LSB) 0.000000 V",
        ]
    content = "\r\n".join([*head, r"\*File list end"]).encode("latin-1") + b"\r\n\x1a"
    content = content.ljust(4096, b"\0")
    for image in (scan.trace, scan.retrace):
        content += np.rint(image / STEP).astype("<i2").tobytes()
    path.write_bytes(content)


def write_ibw(path: Path, scan: Scan) -> None:
    """Write a wave of Asylum: axes x, y and channel, both rising; TN003 of WaveMetrics."""
    wave = np.stack([scan.trace.T, scan.retrace.T], axis=2).astype("<f4")
    data = wave.tobytes(order="F")
    note = (
        f"ScanSize: 1\rFastScanSize: {scan.range_x!r}\rSlowScanSize: {scan.range_y!r}\r"
        f"ScanRate: {1.0 / scan.line_time!r}\rScanDown: {0 if scan.upward else 1}\r"
        f"ScanAngle: {scan.angle!r}\r"
    ).encode("latin-1")
    labels = b"".join(t.ljust(32, b"\0") for t in (b"", b"HeightTrace", b"HeightRetrace"))
    sizes = (0, len(note), 0, *(0,) * 4, 0, 0, len(labels), 0, 0, 0, 0)
    wave_header = struct.pack(
        "<IIIihh6xh32s8x4i", 0, 0, 0, wave.size, 2, 0, 1, b"w", *wave.shape, 0
    )
    wave_header = wave_header.ljust(320, b"\0")

    def head(checksum: int) -> bytes:
        return struct.pack("<hhi14i", 5, checksum, 320 + len(data), *sizes) + wave_header

    total = sum(struct.unpack("<192h", head(0))) & 0xFFFF
    checksum = (0x10000 - total) & 0xFFFF
    signed = checksum - 0x10000 if checksum & 0x8000 else checksum
    path.write_bytes(head(signed) + data + note + labels)


WRITERS = {".nid": write_nid, ".sxm": write_sxm, ".spm": write_spm, ".ibw": write_ibw}
