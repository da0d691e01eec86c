"""What images of a grating teach of one drawn scanner, beside what is true."""

import time
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from attrs import frozen

import afm_scan_ros as afm
from afm_scan_bench.images.acquire import Acquired, Frame
from afm_scan_bench.images.cases import Case, draw_case
from afm_scan_bench.images.score import Places, Score, commanded, scaled, score, true_places
from afm_scan_bench.images.tracking import RATES, Inverse, by_gains, error_of, linear_inverse
from afm_scan_ros.features.images.grating.registered_image import (
    RegisteredImage,
    accurate_ones,
    pitch_uncertainty,
    register_image,
)
from afm_scan_ros.features.images.identify import ACCURACY, identified_from

VARIANTS: Mapping[str, tuple[int, ...]] = {
    "one pair at 1 Hz": (0,),
    "and one at 10 to 30 Hz": (0, 1),
    "half the size, and 10 to 30 Hz": (0, 2, 1),
}
"""Which of a case's images are given; each is a pair of trace and retrace."""

PITCHES = {"pitch_x": ("pitch in x, %", 0.35), "pitch_y": ("pitch in y, %", 0.35)}
SHIFT = {"shift": ("trace against retrace, pixels", 0.5)}
SCANS = {f"scan_{rate:g}": (f"x at {rate:g} Hz, % of range", 0.5) for rate in RATES}
VARYING = {f"varying_{rate:g}": (f"x at {rate:g} Hz, less its mean", 0.5) for rate in RATES}
FIGURES: Mapping[str, tuple[str, float]] = {**PITCHES, **SHIFT, **SCANS, **VARYING}
"""Heading and target of each figure."""

Values = Mapping[str, float]
"""Figures by name, in the units of their headings."""
NOTHING: Values = dict.fromkeys(FIGURES, np.nan)


@frozen
class Outcome:
    """Figures of one scanner by the controller's gains, by the true ones, and by what was found.

    ``found`` holds NaN for a scan that the model's inverse refuses, and everywhere where there is a
    ``refusal``. Its pitch is that of the first accurate image; ``not_used`` says which images were
    not used, and why. ``seconds`` are those of the processor for a pair, ``left_out`` is the share
    of the first image's lines that counts for nothing, as no edge shows y there, %.
    """

    seed: int
    variant: str
    families: str
    grating: str
    resonance: float
    pixels: int
    plain: Values
    linear: Values
    found: Values = NOTHING
    seconds: float = np.nan
    left_out: float = np.nan
    refusal: str = ""
    not_used: str = ""


def outcomes(seed: int) -> Iterator[Outcome]:
    """Draw a scanner, take its images, and try each choice of them."""
    case = draw_case(seed)
    frames = case.frame, case.faster(fast_rate(case)), case.half()
    images = list(case.images(frames))
    plain, linear = _plain(case, images[0]), _linear(case, images[0])
    seen = [_seen(case, *each) for each in zip(images, frames, strict=True)]
    for variant, chosen in VARIANTS.items():
        given = [seen[k] for k in chosen]
        found, seconds, refusal, not_used = _found(case, given)
        first = given[0].seen
        yield Outcome(
            seed,
            variant,
            "/".join(axis.family for axis in case.scanner.axes),
            case.grating.kind,
            case.scanner.resonance,
            case.frame.pixels,
            plain,
            linear,
            found,
            seconds,
            np.nan if first is None else _left_out(first),
            refusal,
            not_used,
        )


def _left_out(seen: RegisteredImage) -> float:
    lines = np.arange(seen.image.lines)
    return 100.0 * (1.0 - len(lines[seen.positions.known]) / len(lines))


def fast_rate(case: Case) -> float:
    """Line rate (Hz) of a fast image: a thirtieth of the resonance, within 10 and 30 Hz."""
    return float(np.clip(case.scanner.resonance / 30.0, 10.0, 30.0))


@frozen(eq=False)
class _Registered:
    """An image as it was registered, or the refusal, and the processor's seconds for it."""

    taken: Acquired
    frame: Frame
    seen: RegisteredImage | None
    refusal: str
    seconds: float


def _seen(case: Case, taken: Acquired, frame: Frame) -> _Registered:
    begun, found, refusal = time.process_time(), None, ""
    try:
        found = register_image(taken.image, case.grating.pitch)
    except (afm.InputError, afm.ScanError) as error:
        refusal = str(error)
    return _Registered(taken, frame, found, refusal, time.process_time() - begun)


def _found(case: Case, given: Sequence[_Registered]) -> tuple[Values, float, str, str]:
    """Figures by what the images teach, seconds a pair, the refusal, or why some are not used."""
    x, y = case.scanner.nominal
    seen, inaccurate = accurate_ones([each.seen for each in given if each.seen], ACCURACY)
    reasons = [each.refusal for each in given if each.refusal] + [str(e) for e in inaccurate]
    begun = time.process_time()
    if not seen:
        return NOTHING, np.nan, " ".join(reasons), ""
    try:
        found = identified_from(seen, (1.0 / x, 1.0 / y), lambda _: None)
    except (afm.InputError, afm.ScanError) as error:
        return NOTHING, np.nan, str(error), ""
    seconds = time.process_time() - begun + sum(each.seconds for each in given)
    accurate = [pitch_uncertainty(each, "xy") <= 100.0 * ACCURACY for each in seen].index(True)
    placed = found.positions[accurate]
    places = Places(*(np.moveaxis(side, -1, 0) for side in (placed.trace, placed.retrace)))
    first = next(each for each in given if each.seen is seen[accurate])
    pitch = score(places, true_places(first.taken), case.grating.pitch, first.frame, placed.known)
    values = {**_percent(pitch), **_of_scans(case, found.model.invert)}
    return values, seconds / len(given), "", " ".join(reasons)


def _plain(case: Case, taken: Acquired) -> Values:
    places = commanded(case.frame)
    inverse = by_gains(case.scanner.nominal)
    return {**_of_image(case, taken, places), **_of_scans(case, inverse)}


def _linear(case: Case, taken: Acquired) -> Values:
    places = scaled(commanded(case.frame), true_places(taken))
    inverse = linear_inverse(case.scanner, case.frame)
    return {**_of_image(case, taken, places), **_of_scans(case, inverse)}


def _of_image(case: Case, taken: Acquired, places: Places) -> Values:
    return _percent(score(places, true_places(taken), case.grating.pitch, case.frame))


def _percent(found: Score) -> Values:
    return {
        "pitch_x": 100.0 * found.pitch_x,
        "pitch_y": 100.0 * found.pitch_y,
        "shift": found.shift,
    }


def _of_scans(case: Case, inverse: Inverse) -> Values:
    errors = {rate: error_of(case.scanner, case.frame, rate, inverse) for rate in RATES}
    whole = {f"scan_{rate:g}": error.whole for rate, error in errors.items()}
    return {**whole, **{f"varying_{r:g}": error.without_offset for r, error in errors.items()}}
