"""Imports what nodes import; a process that has done so is forked for each node of the tests."""

import gc
from importlib import import_module

from afm_scan_ros.nodes import NODES
from afm_scan_ros.ros.cyclone.wire import TYPESTORE, envelope_class

DESCRIBED = ("afm_scan_ros", "diagnostic", "lifecycle", "rcl_interfaces", "rmw_dds_common")
"""How packages of messages begin whose types are described to DDS."""

for name in ("drivers.process", "simulation.scanner", *(f"nodes.{node}" for node in NODES)):
    import_module(f"afm_scan_ros.{name}")
for name in ("interpolate", "linalg", "signal", "special"):  # which are imported when they are used
    import_module(f"scipy.{name}")
for name in TYPESTORE.fielddefs:
    if name.startswith(DESCRIBED):
        envelope_class(name).__idl__.fill_type_data()  # takes as long as a short node works
gc.freeze()  # a collection would copy all that is forked
