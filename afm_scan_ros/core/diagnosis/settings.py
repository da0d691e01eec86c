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


@frozen
class VarianceSettings:
    """Amplitudes of the model's discrepancy in a band, fitted to healthy scans."""

    freedom: float = setting(
        1.4,
        "1",
        "independent amplitudes of the discrepancy in a band, nu",
        "drawn scanners give 1.1",
    )
    known: float = setting(
        8.0,
        "1",
        "amplitudes that a tested discrepancy is known from, kappa",
        "drawn scanners give 9.7",
    )
    untested: float = setting(
        2.0, "1", "the same where no record tests such motion", "drawn scanners give 1.9"
    )
    typical_share: float = setting(
        0.3,
        "1",
        "mean square of the discrepancy over its detection limit's, an upper bound, c",
        "drawn scanners give 0.30",
    )

    @property
    def along(self) -> float:
        """Power of a healthy residual along one influence, in detection limits squared."""
        return self.typical_share / self.freedom


VARIANCE = VarianceSettings()


@frozen
class LikelihoodSettings:
    """What an effect's formula may miss, and what a residual lacks."""

    formula_error: float = setting(
        0.1,
        "1",
        "relative error of an effect's formula, as likely as none, rho",
        "a formula approximates physics",
    )
    remarkable: float = setting(
        0.01,
        "1",
        "probability of a larger residual in a cell, below which effects are searched for",
        "one healthy cell in a hundred starts a search",
    )
    false_lack: float = setting(
        0.01, "1", "false discovery rate of the lack-of-fit test over the cells", "the usual level"
    )
    rounds: int = setting(50, "1", "steps to the likeliest deviations, at most", "limits the work")
    precision: float = setting(
        1e-6, "1", "change, in standard deviations, that ends them", "far below one"
    )
    sizes: int = setting(
        64,
        "1",
        "points of an integral over the size of something that no effect describes",
        "limits the work",
    )


LIKELIHOOD = LikelihoodSettings()


@frozen
class EvidenceSettings:
    """When a record shows anything of a model, and what of it is held out."""

    least_motion: float = setting(
        100.0,
        "1",
        "peak-to-peak motion over noise, below which a record shows nothing of a model",
        "a model's error of one per cent is as large as the noise there",
    )
    stretches: int = setting(
        16, "1", "stretches of a record, of which every other one is held out", "eight of each"
    )


EVIDENCE = EvidenceSettings()


@frozen
class LimitSettings:
    """How large a residual the model's known error explains."""

    expected: float = setting(
        1.8,
        "1",
        "ratio of a band's rms to its detection limit up to which it is as expected",
        "less than one healthy band in a hundred exceeds it: 0.3 F(1.4, 8)",
    )
    missed_factor: float = setting(
        1.5,
        "1",
        "factor of the error above two thirds of the first resonance",
        "modes that no model has dominate it there",
    )
    harmonic_share: float = setting(
        0.5,
        "1",
        "share of a slow motion's error in the band above it, at most",
        "an error of a slow motion has harmonics at higher frequencies",
    )
    first_cycles: float = setting(
        3.0,
        "1",
        "first cycles of a record without a preparation",
        "they hold branches that come once",
    )
    unprepared_factor: float = setting(
        3.0, "1", "factor of the error there", "branches that come once were not identified"
    )
    least_moved: float = setting(
        0.2,
        "1",
        "share of a record's largest band that counts as motion in a band",
        "harmonics of a triangle, at most a ninth, are no further rate",
    )
    alike: float = setting(
        2.0**0.5,
        "1",
        "ratio of two motions in each band up to which they are of one kind",
        "the error of hysteresis grows at most with the square of a small amplitude",
    )


LIMIT = LimitSettings()


@frozen
class InitialStateSettings:
    """When a record began in another state than depolarised."""

    within_noise: float = setting(
        2.0,
        "1",
        "mean square per band, in detection limits, up to which the depolarised state is kept",
        "such a residual needs no other state",
    )
    much_better: float = setting(
        0.2,
        "1",
        "share of the depolarised state's misfit that another state must fall below",
        "an effect may look like a state",
    )
    levels: int = setting(8, "1", "extremes tried on either side", "limits the work")
    refinements: int = setting(150, "1", "evaluations that refine the best", "limits the work")
    fewest_samples: int = setting(
        2000, "samples", "of a record that the states are tried on, at least", "limits the work"
    )


INITIAL_STATE = InitialStateSettings()


@frozen
class MismatchSettings:
    """When a record cannot be the model's."""

    visible: float = setting(
        1e-7,
        "m on the reference scanner",
        "rms of predicted motion below which drift or noise may exceed it",
        "drift and noise of such records reach it",
    )
    unit: float = setting(
        100.0,
        "1",
        "gain at which a record that hardly moves contradicts the model",
        "a wrong unit is a factor of a thousand",
    )
    slow_degree: int = setting(
        3,
        "1",
        "degree of the polynomial that describes such a record's slow trend",
        "drift is smooth",
    )
    slow: float = setting(
        0.5,
        "1",
        "frequency over the first resonance, below which a stage moves as at rest",
        "a resonance adds a third there",
    )
    least_slow: float = setting(
        0.03,
        "1",
        "share of slow motion from which on records are compared there alone",
        "smaller motion may be drift",
    )
    gain_factor: float = setting(
        2.0,
        "1",
        "ratio of gains of the same motion in one unit, either way",
        "piezoelectric gains vary less",
    )
    same_shape: float = setting(
        0.95,
        "1",
        "correlation from which on two motions are of one shape",
        "they differ by their loops alone",
    )
    least_correlation: float = setting(
        0.7, "1", "correlation at some delay, at least", "a slew limit makes motion small and late"
    )
    least_loop: float = setting(
        0.01,
        "1",
        "area of a loop, of its rectangle, that shows its sense",
        "a smaller one may be noise",
    )
    backward: float = setting(
        0.5, "1", "share of it that measured loops have backward", "half of what the model has"
    )
    several_rates: float = setting(
        10.0, "1", "ratio of frequencies of the motion that counts as several rates", "a decade"
    )


MISMATCH = MismatchSettings()
