"""Makes a piezoscanner follow its scan by inverting creep, hysteresis and vibration.

Arrays are of shape (n,) or (n, channels), in SI units. Works without ROS.
"""

from typing import TYPE_CHECKING

__path__ = __import__("pkgutil").extend_path(__path__, __name__)

if TYPE_CHECKING:
    from afm_scan_ros.bag.record import read_record
    from afm_scan_ros.core.errors import InputError, ScanError
    from afm_scan_ros.core.limits import DriveLimits
    from afm_scan_ros.core.record import Record
    from afm_scan_ros.core.scan_spec import ScanSpec
    from afm_scan_ros.core.trajectory import trajectory
    from afm_scan_ros.diagnosis import Diagnosis, diagnose
    from afm_scan_ros.features.images.files.formats import read_image
    from afm_scan_ros.features.images.identify import (
        ImageIdentification,
        correct_image,
        identify_from_images,
    )
    from afm_scan_ros.features.images.scan_image import ScanImage
    from afm_scan_ros.features.learning.measured import Learned, learn
    from afm_scan_ros.identification import identify
    from afm_scan_ros.model import Model, load_model
    from afm_scan_ros.progress import timed

    __version__: str

__all__ = [
    "Diagnosis",
    "DriveLimits",
    "ImageIdentification",
    "InputError",
    "Learned",
    "Model",
    "Record",
    "ScanError",
    "ScanImage",
    "ScanSpec",
    "__version__",
    "correct_image",
    "diagnose",
    "identify",
    "identify_from_images",
    "learn",
    "load_model",
    "read_image",
    "read_record",
    "timed",
    "trajectory",
]

_MODULES = {
    "Diagnosis": "diagnosis",
    "DriveLimits": "core.limits",
    "ImageIdentification": "features.images.identify",
    "InputError": "core.errors",
    "Learned": "features.learning.measured",
    "Model": "model",
    "Record": "core.record",
    "ScanError": "core.errors",
    "ScanImage": "features.images.scan_image",
    "ScanSpec": "core.scan_spec",
    "correct_image": "features.images.identify",
    "diagnose": "diagnosis",
    "identify": "identification",
    "identify_from_images": "features.images.identify",
    "learn": "features.learning.measured",
    "load_model": "model",
    "read_image": "features.images.files.formats",
    "read_record": "bag.record",
    "timed": "progress",
    "trajectory": "core.trajectory",
}
"""Where each name is from: a module is imported when the first of its names is used."""


def __getattr__(name: str) -> object:
    if name == "__version__":
        from afm_scan_ros.files import version  # noqa: PLC0415 - reads package.xml

        return version()
    if name not in _MODULES:
        raise AttributeError(f"module 'afm_scan_ros' has no attribute {name!r}")
    from importlib import import_module  # noqa: PLC0415 - see above

    return getattr(import_module(f"afm_scan_ros.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
