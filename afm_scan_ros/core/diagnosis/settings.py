"""The numbers by which a residual is parted, and what each follows from."""

from attrs import frozen

from afm_scan_ros.core.types import setting


@frozen
class PartingSettings:
    """What of a residual repeats with the motion, and which lines between last."""

    slow_courses: int = setting(
        4,
        "1",
        "courses over the record by which what repeats may change, at most",
        "with n of them a harmonic is n/2 over the record's length wide on either side",
    )
    periods_each: int = setting(
        4,
        "1",
        "periods of the motion for each of these courses",
        "three quarters of the coefficients lie between the harmonics then",
    )
    largest_share: float = setting(
        0.01,
        "1",
        "share of a drive's mean square that need not repeat at its rate",
        "a tenth in amplitude: a ramp over many lines leaves less than half of it",
    )
    search: float = setting(
        0.6,
        "periods",
        "to either side of a spectral line, where the number of periods is sought",
        "a line of a record is known to half a period",
    )
    finer: float = setting(
        1.3,
        "1",
        "factor of the sample rate up to which a whole number of samples a period is sought",
        "among a third of the samples of a period one misses a whole number by little",
    )
    false_alarm: float = setting(
        0.01, "1", "probability that the noise of a record shows a line", "the rate asked for"
    )
    neighbourhood: int = setting(
        101,
        "1",
        "values of the periodogram whose median tells the noise at a line",
        "fifty independent ones tell it to a fifth",
    )
    clear: float = setting(
        1.0,
        "periods of the record",
        "distance of a line from a harmonic beyond the harmonic's width",
        "Rayleigh's criterion",
    )
    lasting: float = setting(
        0.25,
        "1",
        "share of a line's amplitude that each half of a record has",
        "a tone has a half, what decays within a tenth of the record less than a hundredth",
    )
    tones: int = setting(
        16, "1", "tones that are taken out of a record, at most", "two combs of eight"
    )
    starts: int = setting(
        2, "1", "lasting lines of each record that the fit of a tone starts from", "limits the work"
    )
    precision: float = setting(
        1e-4, "periods", "to which the number of periods is sought", "a phase of 0.04 degrees"
    )
    other_noise: float = setting(
        2.0,
        "1",
        "factor of a record's noise over that of the calibration, either way",
        "more is another sensor, or no noise",
    )


PARTING = PartingSettings()
"""The defaults."""


@frozen
class PosteriorSettings:
    """Which directions of the model's posterior are free, and what tells an unknown effect."""

    negligible: float = setting(
        0.01,
        "1",
        "information of the records on a direction over its prior's, below which it is held",
        "free, it would change a likelihood by less than a hundredth of a nat",
    )

    shape: float = setting(
        10.0,
        "1",
        "coefficients of a cell, at most, whose agreement tells an effect from what has any shape",
        "of thousands, which are no independent witnesses where the model errs",
    )


POSTERIOR = PosteriorSettings()


@frozen
class StructureSettings:
    """Up to what a model counts as exact where its structure is traced."""

    exact: float = setting(
        1e-3,
        "1",
        "error of an exact model in a band, over its whole motion",
        "the sensor's own drift and nonlinearity, a tenth of a per cent of good ones",
    )


STRUCTURE = StructureSettings()


@frozen
class DecimationSettings:
    """How far a record is decimated for the search of starting values."""

    longest: int = setting(
        8_000, "samples", "of a record that is not decimated", "its predictions take little time"
    )
    equal_within: float = setting(
        0.3,
        "1",
        "share of the detection limit by which a prediction may differ in any band",
        "a tenth in power",
    )


DECIMATION = DecimationSettings()


@frozen
class DescentSettings:
    """How effects are fitted to the residual."""

    rounds: int = setting(30, "1", "steps of a fit, at most", "limits the work")
    tolerance: float = setting(
        0.01,
        "nat",
        "gain of a step below which a fit ends",
        "competing effects differ by far more",
    )
    first_damping: float = setting(
        1e-3,
        "1",
        "damping of the first step, of a scaled column's square",
        "Madsen, Nielsen and Tingleff 2004, of a start that is believed to be good",
    )
    least_damping: float = setting(
        1e-10, "1", "damping, at least", "above the rounding of normal equations of scaled columns"
    )


DESCENT = DescentSettings()


@frozen
class SearchSettings:
    """Which sets of effects are fitted, and from when one is named."""

    most_effects: int = setting(3, "1", "effects of a set, at most", "limits the work")
    extended: int = setting(
        3, "1", "sets of one size that are extended", "a beam search; limits the work"
    )
    fitted: int = setting(
        6,
        "1",
        "candidates that are fitted beside a set, of all those with starting values",
        "limits the work",
    )
    reweightings: int = setting(
        2, "1", "fits, of which each has the weights that the one before left", "limits the work"
    )
    expected: float = setting(
        0.5,
        "1",
        "effects that a scanner is expected to have beyond its model",
        "a record is diagnosed where something may be amiss",
    )
    certain: float = setting(
        0.95,
        "1",
        "probability from which on an effect is named, and that of the credible set",
        "the usual level",
    )
    near: float = setting(
        0.01,
        "1",
        "probability over that of the likeliest set, from which on a set is considered beside it",
        "one in a hundred",
    )
    as_probable: float = setting(
        0.05,
        "1",
        "probability over that of the likeliest form, from which on a simpler one is preferred",
        "no form that the records exclude with 95 % certainty",
    )
    present: float = setting(
        0.5,
        "1",
        "share of a tone's largest amplitude in any record from which on it counts as present",
        "a disturbance that no drive causes is equally large in every record",
    )
    parts: int = setting(
        4, "1", "parts of each record in which an effect is to have one amount", "limits the work"
    )
    largest_change: float = setting(
        0.05,
        "1",
        "share of an effect's power by which its amount may differ from part to part",
        "a fifth of its amount: a formula approximates the physics",
    )


SEARCH = SearchSettings()
