"""From arrays to a model, a drive and a diagnosis: ``python examples/ten_lines.py arrays.npz``.

The arrays are of one axis: drives in V and displacements in m, both (n,), and sample periods in s.
simulated_arrays.py makes some; put yours in their place.
"""

import sys

import numpy as np

arrays = np.load(sys.argv[1])
kinds = ("creep", "frequency", "hysteresis", "validation")

# The ten lines:
import afm_scan_ros as afm  # noqa: E402

records = [
    afm.Record(arrays[f"{k}_drive"], arrays[f"{k}_displacement"], arrays[f"{k}_period"], kind=k)
    for k in kinds
]
model = afm.identify(records)
spec = afm.ScanSpec(range_x=20e-6, lines=3, samples_per_line=2000)
drive = model.invert(afm.trajectory(spec)[:, 0], spec.sample_period)
scan = afm.Record(arrays["scan_drive"], arrays["scan_displacement"], spec.sample_period, scan=spec)
found = afm.diagnose(model, [scan])
print(found.verdict, *(effect.name for effect in found.effects))
