"""A damaged file for each reader: it is read, or refused by its name; nothing else, no warning."""

import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.io import savemat

import afm_scan_ros as afm
from afm_scan_bench.faults.damage import Rng, cut, edited, turned
from afm_scan_bench.faults.faults import Announce
from afm_scan_bench.faults.injection.outcome import Tally
from afm_scan_ros.bag.writer import write_record
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import load_settings
from afm_scan_ros.features.images.files.channels import image_channels
from afm_scan_ros.features.images.files.formats import write_image
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.drive_files import load_learned, read_drive, save_learned
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.plant_file import load_plant, load_sample, load_scan
from afm_scan_ros.report.table import Row

TRIALS = 8000
RATE = 1e4
RAMP = np.linspace(0.0, 1.0, 200)
COLUMNS = "drive_x=u:V,achieved_x=y:um"
MOST_PLACES = 8
"""Bytes of a file that are changed at once."""
HEADER = 1500
"""Bytes within which most of them lie, as there is what a reader believes."""


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Damage each file so many times over, in all its bytes or in its beginning."""
    rng = np.random.default_rng(1)
    with TemporaryDirectory() as folder:
        for name, (write, read) in READERS.items():
            announce(name)
            path, tally = Path(folder) / name, Tally()
            write(path)
            content = path.read_bytes()
            for _ in range(max(1, trials // len(READERS))):
                path.write_bytes(_damaged(content, path.suffix, rng))
                tally.judge(partial(_read, read, path), path.stem)
            path.write_bytes(content)
            yield tally.row(f"damage to {name}")


def _read(read: Callable[[Path], object], path: Path) -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read(path)
    return "read"


def _damaged(content: bytes, suffix: str, rng: Rng) -> bytes:
    kind = rng.random()
    if kind < 0.1:  # noqa: PLR2004 - one in ten
        return cut(content, rng)
    if suffix in (".yaml", ".csv"):
        return edited(content, rng)
    places = range(min(len(content), HEADER)) if kind < 0.8 else None  # noqa: PLR2004 - most
    for _ in range(int(rng.integers(1, MOST_PLACES))):
        content = turned(content, rng, places)
    return content


def _configured(name: str, path: Path) -> None:
    folder = share_directory() / "config"
    (path.parent / "model.npz").write_bytes((folder / "model.npz").read_bytes())
    path.write_bytes((folder / name).read_bytes())


def _learned(path: Path) -> None:
    spec = ScanSpec(lines=2, samples_per_line=8, line_rate=100.0, preparation="none")
    save_learned(path, Correction.none(spec), load_model(share_directory() / "config/model.yaml"))


def _bag(path: Path) -> None:
    streams = {name: Trace(0, 1 / RATE, RAMP, RAMP) for name in ("drive_voltage",)}
    streams["achieved_displacement"] = Trace(0, 1 / RATE, 1e-6 * RAMP, 1e-6 * RAMP)
    folder = path.with_suffix("")
    write_record(folder, ScanInfo("fuzzed", 0, "creep", 1 / RATE, len(RAMP)), streams)
    (folder / f"{folder.name}_0.mcap").rename(path)


def _image(path: Path) -> None:
    heights = 1e-9 * np.add.outer(np.arange(8.0), np.arange(9.0))
    write_image(path, image_channels(ScanImage(heights, heights, 4e-6, 3e-6)))


def _image_arrays(path: Path) -> None:
    heights = 1e-9 * np.add.outer(np.arange(8.0), np.arange(9.0))
    np.savez(path, trace=heights, retrace=heights, range_x=4e-6, range_y=3e-6, unit="m")


def _record(path: Path) -> object:
    return afm.read_record(path, COLUMNS, sample_rate=RATE)


def _numbered(path: Path) -> object:
    return afm.read_record(path, "drive_x=1:V,achieved_x=2:um", sample_rate=RATE)


TABLE = {"u": RAMP, "y": RAMP}
Reader = tuple[Callable[[Path], object], Callable[[Path], object]]
READERS: Mapping[str, Reader] = {
    "table.csv": (
        lambda p: np.savetxt(p, np.column_stack([RAMP, RAMP]), delimiter=",", header="u,y"),
        _record,
    ),
    "array.npy": (lambda p: np.save(p, np.column_stack([RAMP, RAMP])), _numbered),
    "arrays.npz": (lambda p: np.savez_compressed(p, u=RAMP, y=RAMP), _record),
    "matlab.mat": (lambda p: savemat(p, TABLE, do_compression=False), _record),
    "packed.mat": (lambda p: savemat(p, {"s": TABLE} | TABLE, do_compression=True), _record),
    "old.mat": (lambda p: savemat(p, TABLE, format="4"), _record),
    "bag.mcap": (_bag, afm.read_record),
    "learned.npz": (_learned, load_learned),
    "drive.npz": (
        lambda p: np.savez(p, drive_v=np.column_stack([RAMP, RAMP]), sample_period_s=1 / RATE),
        read_drive,
    ),
    "sample.npy": (
        lambda p: np.save(p, np.outer(RAMP, RAMP)),
        partial(load_sample, width=1e-6, white=1e-7),
    ),
    "heights.gwy": (_image, afm.read_image),
    "heights.gsf": (_image, afm.read_image),
    "heights.npz": (_image_arrays, afm.read_image),
    "model.yaml": (partial(_configured, "model.yaml"), afm.load_model),
    "plant.yaml": (partial(_configured, "plant.yaml"), load_plant),
    "simulated_scanner.yaml": (
        partial(_configured, "simulated_scanner.yaml"),
        partial(load_settings, "simulated"),
    ),
    "scan.yaml": (partial(_configured, "scan.yaml"), load_scan),
}
"""What writes a good file, and what reads it."""
