"""Files that state sizes they do not have, or unfold into them: refused before memory is taken."""

import io
import struct
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import zstandard
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC
from PIL import Image
from scipy.io import savemat

from afm_scan_bench.faults.damage import Rng
from afm_scan_bench.faults.faults import Announce, row
from afm_scan_bench.faults.injection.outcome import REFUSED, LossError, Tally
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.arrays import FREE, Archive
from afm_scan_ros.files.drive_files import load_learned, read_drive
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.plant_file import load_plant, load_sample, load_scan
from afm_scan_ros.files.tables import read_archive, read_array, read_matlab
from afm_scan_ros.report.table import Row

TRIALS = 10
"""Of each kind, with sizes drawn anew."""
MOST = 300e6
"""Bytes that reading such a file may take."""
_UNFOLDED = FREE + 2**20


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Read each kind of file so many times, and measure the most memory that it took."""
    rng, tally, most = np.random.default_rng(1), Tally(), 0
    with TemporaryDirectory() as folder:
        for name, (write, read) in HOSTILE.items():
            path = Path(folder) / name
            for _ in range(trials):
                announce(name)
                path.write_bytes(write(rng))
                tally.judge(partial(_read, read, path), name)
                tracemalloc.start()  # it takes time, which is judged without
                with suppress(InputError, LossError):
                    _read(read, path)
                most = max(most, tracemalloc.get_traced_memory()[1])
                tracemalloc.stop()
    if most > MOST:
        tally.lost.append("too much memory")
    counted = tally.outcomes
    figures = f"{counted[REFUSED]} {REFUSED}; {most / 1e6:.0f} MB taken at most"
    fault = "a file states a size that it does not have"
    yield row(fault, counted.total(), tally.lost, figures)


def _read(read: Callable[[Path], object], path: Path) -> str:
    read(path)
    raise LossError(f"{path.name} was read")


def _aliases(rng: Rng) -> bytes:
    """Nine words that unfold into a thousand million."""
    levels = [f"a{i}: &a{i} [{', '.join(10 * [f'*a{i - 1}'])}]" for i in range(1, 10)]
    return "\n".join([f"a0: &a0 {rng.random()}", *levels]).encode()


def _nested(rng: Rng) -> bytes:
    return b"a: " + int(rng.integers(10**4, 10**5)) * b"["


def _header(rng: Rng) -> bytes:
    rows = int(rng.integers(10**6, 10**7))
    stream = io.BytesIO()
    stated = {"descr": "<f8", "fortran_order": False, "shape": (rows, rows)}
    np.lib.format.write_array_header_1_0(stream, stated)
    return stream.getvalue()


def _archive(rng: Rng, *, packed: bool, names: Sequence[str] = ("a",)) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name in names:
            archive.writestr(f"{name}.npy", bytes(_UNFOLDED) if packed else _header(rng))
    return stream.getvalue()


def _directory(rng: Rng) -> bytes:
    """Return an archive of so many arrays that their names alone take memory."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for number in range(30_000):
            archive.writestr(f"{number}{rng.integers(10)}.npy", b"")
    return stream.getvalue()


def _matlab(_: Rng) -> bytes:
    """Return a MATLAB file of version 5 with a compressed matrix of zeros."""
    stream = io.BytesIO()
    savemat(stream, {"u": np.zeros((_UNFOLDED // 8, 1))}, do_compression=True)
    return stream.getvalue()


def _values(rng: Rng) -> bytes:
    return b"a: [" + b"%d," % rng.integers(10) * 400_000 + b"1]"


def _nothing(rng: Rng) -> bytes:
    """Return an MCAP file of records that say nothing."""
    return MCAP0_MAGIC + struct.pack("<BQ", int(rng.integers(0x80, 256)), 0) * 10**6 + MCAP0_MAGIC


def _chunks(rng: Rng) -> bytes:
    """Return an MCAP file of chunks that each unpack to as much as one may."""
    body = _chunk(rng, packed=True)[len(MCAP0_MAGIC) : -len(MCAP0_MAGIC)]
    stated = bytearray(body)
    struct.pack_into("<Q", stated, 25, 2**27)
    return MCAP0_MAGIC + bytes(stated) * 16 + MCAP0_MAGIC


def _picture(_: Rng) -> bytes:
    stream = io.BytesIO()
    Image.new("1", (20_000, 20_000)).save(stream, "PNG")
    return stream.getvalue()


def _chunk(rng: Rng, *, packed: bool) -> bytes:
    data = zstandard.compress(bytes(_UNFOLDED)) if packed else b""
    stated = 1000 if packed else int(rng.integers(2**40, 2**44))
    name = b"zstd" if packed else b""
    body = struct.pack("<QQQII", 0, 0, stated, 0, len(name)) + name
    body += struct.pack("<Q", len(data)) + data
    return MCAP0_MAGIC + struct.pack("<BQ", Opcode.CHUNK, len(body)) + body + MCAP0_MAGIC


def _record(rng: Rng) -> bytes:
    stated = struct.pack("<BQ", int(rng.integers(1, 256)), int(rng.integers(2**32, 2**62)))
    return MCAP0_MAGIC + stated + b"\xff" * 32 + MCAP0_MAGIC


def _scan(rng: Rng) -> bytes:
    samples = 2 * int(rng.integers(10**7, 10**12))
    return b"/**: {ros__parameters: {samples_per_line: %d}}" % samples


def _plant(rng: Rng) -> bytes:
    text = (share_directory() / "config/plant.yaml").read_bytes()
    return text.replace(b"elements: 80", b"elements: %d" % rng.integers(10**8, 10**15))


HOSTILE: Mapping[str, tuple[Callable[[Rng], bytes], Callable[[Path], object]]] = {
    "aliases.yaml": (_aliases, load_model),
    "nested.yaml": (_nested, load_scan),
    "table.npy": (_header, read_array),
    "stated.npz": (partial(_archive, packed=False), lambda path: Archive(path).matrix("a")),
    "packed.npz": (partial(_archive, packed=True), lambda path: Archive(path).matrix("a")),
    "learned.npz": (
        partial(_archive, packed=True, names=("x", "y", "made_for")),
        load_learned,
    ),
    "drive.npz": (partial(_archive, packed=True, names=("drive_v",)), read_drive),
    "record.npz": (partial(_archive, packed=True), read_archive),
    "directory.npz": (_directory, read_archive),
    "record.mat": (_matlab, read_matlab),
    "values.yaml": (_values, load_scan),
    "picture.png": (_picture, partial(load_sample, width=1e-6, white=1e-7)),
    "nothing.mcap": (_nothing, read_scan),
    "chunks.mcap": (_chunks, read_scan),
    "stated.mcap": (partial(_chunk, packed=False), read_scan),
    "packed.mcap": (partial(_chunk, packed=True), read_scan),
    "record.mcap": (_record, read_scan),
    "scan.yaml": (_scan, load_scan),
    "plant.yaml": (_plant, load_plant),
}
