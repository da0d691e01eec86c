"""What to beware of in a verdict, in sentences."""

from collections.abc import Iterator, Mapping

from afm_scan_ros.core.diagnosis.axis_diagnosis import SUFFICIENT, AxisDiagnosis
from afm_scan_ros.core.diagnosis.checks import single_rate_band
from afm_scan_ros.core.diagnosis.discrepancy import AT_LIMIT
from afm_scan_ros.core.model import ScannerModel


def cautions(model: ScannerModel, by_axis: Mapping[str, AxisDiagnosis]) -> Iterator[str]:
    """Yield them axis by axis: a model known at one rate, a residual that is not quite at rest."""
    for axis, trace in by_axis.items():
        if band := single_rate_band(model.axis(axis).model_discrepancies):
            yield (
                f"{axis}: the model is known at {band[0]:g} to {band[1]:g} Hz alone, where a"
                " hysteresis takes up lag, delay and viscosity: these may be hidden, or what is"
                " named may stand for them. Identify it with loops at several rates."
            )
        if trace.verdict == SUFFICIENT:
            yield from _standing(axis, trace)


def _standing(axis: str, trace: AxisDiagnosis) -> Iterator[str]:
    """Say which record stands above its floor, though no more than chance may bring it to."""
    left = zip(trace.evidence, trace.ratio_after, strict=True)
    evidence, ratio = max(left, key=lambda each: float(each[1].max()))
    band = int(ratio.argmax())
    if ratio[band] < AT_LIMIT:
        return
    several = (
        "in no way that the other records share: they may be of a scanner that has changed. Trace"
        " each by itself."
        if len(trace.evidence) > 1
        else "and no effect was certain: it may be chance, or one too small to be told."
    )
    low, high = evidence.floor.edges[band : band + 2]
    yield (
        f"{axis}: {evidence.playback.view.name} stands {ratio[band]:.2g} times above its floor from"
        f" {low:g} to {high:g} Hz, {several}"
    )
