"""The numbers that decide in a fit, and what each follows from."""

from attrs import frozen

from afm_scan_ros.core.types import setting


@frozen
class FitSettings:
    """What the fit of an axis resolves, expects beforehand, and takes for significant."""

    finest: float = setting(
        2.0**-20,
        "range",
        "least noise of a signal",
        "converters resolve up to 20 bits without noise",
    )
    smallest_play: float = setting(
        1e-3,
        "half range",
        "smallest threshold of the plays",
        "a scan of 1/500 of the range still moves this play",
    )
    play_step: float = setting(
        1.0 / 80.0,
        "half range",
        "distance between the larger thresholds",
        "twice the step doubles the error on fresh scans",
    )
    small_plays: int = setting(
        9, "1", "thresholds in geometric steps up to two play_steps", "each is 1.5 times the last"
    )
    correction_plays: int = setting(
        14, "1", "thresholds between which the correction is linear", "the correction is smooth"
    )
    correction_cells: int = setting(
        16,
        "1",
        "cells of the correction's splines over the range",
        "densities of materials rise and fall over a tenth of the range: 6 leave 0.1 %",
    )
    surface_levels: int = setting(
        161, "1", "levels of the model's Everett surface", "one for each play_step over the range"
    )
    direct_levels: int = setting(
        41,
        "1",
        "levels of the direct inverse's surface",
        "interpolation errs less than the direct method",
    )
    most_left_out: float = setting(
        0.5,
        "1",
        "share of a record before its memory is known from which on that memory is estimated",
        "less than half is told by the rest, without a further parameter",
    )
    memory_values: int = setting(
        10,
        "1",
        "thresholds between which the memory of plays at an unknown start is linear",
        "a turn of the drive leaves a bend at its swing: of several, the largest few count",
    )
    rest_bias: float = setting(
        0.1,
        "1",
        "most by which the middle of swings of half the range lies off 0 V at rest, over that half",
        "maps before the hysteresis bend the drive by some per cent at its ends",
    )
    slope_cells_drive: int = setting(
        8,
        "1",
        "cells of a Duhem operator's slopes over the drive",
        "the maps about the operator are smooth",
    )
    slope_cells_state: int = setting(
        12, "1", "cells of a Duhem operator's slopes over its state", "in trials 10 were too coarse"
    )
    state_margin: float = setting(
        0.1,
        "range of w",
        "how far the slopes reach beyond the states of the start",
        "the start errs by a few per cent",
    )
    start_strengths: int = setting(
        7,
        "1",
        "priors, the last a thousandth of the first, of the slopes that one state starts from",
        "each is half a decade: slopes of one lie near those of the next",
    )
    start_rounds: int = setting(
        2,
        "1",
        "linearisations of these slopes under each prior",
        "by two the misfit of a path hardly falls under the same prior",
    )
    least_slope: float = setting(
        0.02, "1", "least slope dA/du of a model", "only an output that grows has an inverse"
    )
    slope_tolerance: float = setting(
        1e-5,
        "1",
        "standard deviation by which slopes of an operator fail their conditions",
        "a thousandth of least_slope costs 2 nat",
    )
    map_terms: int = setting(
        4, "1", "coefficients of the map behind the plays", "polynomials up to the fifth degree"
    )
    density: float = setting(
        2.0, "1", "standard deviation of the density of plays beforehand", "slopes are of order 1"
    )
    smooth_density: float = setting(
        3.0, "1", "greatest standard deviation of the density's bends", "slopes are of order 1"
    )
    rough_density: float = setting(
        0.3,
        "1",
        "greatest standard deviation of the density's rough part",
        "a tenth of the density",
    )
    correction: float = setting(
        0.3, "1", "greatest standard deviation of the correction's bends", "a tenth of the density"
    )
    output_map: float = setting(
        0.05,
        "half range",
        "greatest standard deviation of the map's coefficients",
        "stages bend by some 5 %",
    )
    slopes: float = setting(
        5.0, "1", "greatest standard deviation of the slopes' bends", "slopes are of order 1"
    )
    creep: float = setting(
        0.015,
        "1",
        "greatest standard deviation of the second differences of creep's gains",
        "creep is 1 to 10 % a decade, of eight time constants",
    )
    first_scale: float = setting(
        0.1, "1", "share of the greatest values at which their search begins", "a decade below"
    )
    steepest_sensor: int = setting(
        4,
        "1",
        "greatest order of a sensor's low-pass; the even ones up to it are tried",
        "filters of instruments have 12 or 24 dB an octave",
    )
    lag_weight: float = setting(
        0.1, "static gain", "standard deviation of the weight of a fast lag", "lags correct modes"
    )
    fast_lags: int = setting(
        6, "1", "fast lags, evenly spaced in the logarithm", "one lag leaves 0.3 % at 0.1 to 2 kHz"
    )
    unseen_lag: float = setting(
        1e-3,
        "sample",
        "lag of a model whose vibration no record tells, in samples of the fastest one",
        "a scan a hundred times as fast sees a tenth of its own sample",
    )
    slowest_lag: float = setting(
        3.0,
        "1/omega",
        "slowest fast lag; omega is the first mode's angular frequency",
        "slower lags are creep",
    )
    lag_samples: float = setting(
        5.0,
        "samples",
        "slowest lag where no mode is seen",
        "a lag is a matter of few samples, slower ones are creep",
    )
    creep_samples: float = setting(
        10.0,
        "samples",
        "fastest time constant of creep where no mode is seen",
        "twice the slowest lag, as no creep may be at the place of a lag",
    )
    fastest_creep: float = setting(
        50.0, "1/omega", "fastest time constant of creep", "a decade above the lags"
    )
    creep_per_decade: int = setting(
        8,
        "1",
        "time constants of creep in a decade",
        "one between two of them is then imitated to 0.5 % of its gain",
    )
    damping: float = setting(
        0.02, "1", "damping of a mode beforehand", "piezo stages have 0.003 to 0.1"
    )
    heaviest_mode: float = setting(
        3.0,
        "static gain",
        "greatest weight of a mode",
        "modes that cancel each other explain nothing",
    )
    mode_chance: float = setting(
        20.0,
        "nat",
        "least gain in likelihood for a mode",
        "four parameters at one of some 1000 frequencies",
    )
    mode_band: float = setting(
        0.2,
        "frequency",
        "half width of the band in which a mode is sought",
        "a few bandwidths of a mode, over which other modes and hysteresis are smooth",
    )
    tried_damping: float = setting(
        0.06,
        "1",
        "damping of the modes that are tried first, and half the width of a band",
        "thrice what is expected: beside a sharper one it explains a third as much",
    )
    near_chance: float = setting(
        0.3,
        "1",
        "share of what a mode has to explain from which on its neighbours are tried",
        "the same third",
    )
    most_peaks: int = setting(
        20,
        "1",
        "peaks of what is left about which a mode is tried",
        "harmonics of a periodic drive are peaks too",
    )
    residual_segments: int = setting(
        16,
        "1",
        "segments of a residual over which its spectral density is averaged",
        "half overlapping, they leave a fifth of the density to chance",
    )
    tried_modes: int = setting(
        4,
        "1",
        "peaks of what is left from which on a mode is sought, and modes that are fitted in turn"
        " beside a sensor's low-pass, of which the best stays",
        "the best peak may be a bend, and tells little of a resonance beside a low-pass that begins"
        " far from its corner",
    )
    mode_values: int = setting(
        10_000_000,
        "1",
        "blocks times modes that are tried at a time",
        "their derivatives fit into a gigabyte",
    )
    greatest_damping: float = setting(
        0.12,
        "1",
        "damping above which a bend of the response is no mode",
        "piezo stages have 0.003 to 0.1",
    )
    mode_share: float = setting(
        0.2,
        "1",
        "least share of the residuals in its band that a mode explains beside a smooth response",
        "seen on scanners made for tests: no derivation",
    )
    least_peak: float = setting(
        0.1,
        "1",
        "peak of a mode over that of another in whose bandwidth it lies, at least",
        "what hysteresis does to a resonance is some per cent of its peak",
    )
    excited_share: float = setting(
        0.01,
        "1",
        "least share of what a mode explains that is about its own frequency, above noise",
        "resonances have 0.1 and more, as force far below a mode tells of it too",
    )
    dominant_share: float = setting(
        0.25,
        "1",
        "share of what is left of a record from which a mode precedes the hysteresis",
        "it then hides the loops; beyond its own band a straight line leaves as much",
    )
    most_modes: int = setting(
        4, "1", "modes at most", "each costs a fit, and stages show one to three"
    )
    slight: float = setting(
        5e-4,
        "1",
        "discrepancy of plays below which no other operator is tried",
        "in trials plays left 0.011 or more of scanners of one state: a twentieth of that",
    )
    decided: float = setting(
        10.0,
        "1",
        "evidence between two operators over what steps may still add to the worse one's",
        "the likelihood grows by more than steps foresee where the discrepancy falls",
    )
    stage_steps: int = setting(
        4, "1", "steps of each stage before the last", "a stage only has to start the next"
    )
    most_steps: int = setting(
        60,
        "1",
        "steps of the last stage at most",
        "most fits converge in 15, those of one state in 40",
    )
    most_trials: int = setting(
        12,
        "1",
        "dampings tried for a step at most",
        "the last is 2 to the power of 66 times the first",
    )
    damped_alone: float = setting(
        0.03,
        "1",
        "share of the diagonal in the damping of an operator's tables; the rest is the prior's",
        "of 0, 0.03 and 1 the lowest objective after 16 steps on one sweep, any_lab 65",
    )
    least_damping: float = setting(
        1e-12,
        "1",
        "least damping of a step, over the diagonal of the normal equations",
        "flatter directions drown in the rounding of derivatives to single precision",
    )
    bend_step: float = setting(
        0.1,
        "step",
        "part of a step over which the model's second derivative is taken",
        "M. K. Transtrum and J. P. Sethna, arXiv:1201.5885",
    )
    most_bend: float = setting(
        0.75,
        "step",
        "longest geodesic acceleration that bends a step",
        "M. K. Transtrum and J. P. Sethna, arXiv:1201.5885",
    )
    rows_at_once: int = setting(
        1024, "1", "rows of derivatives that are made at a time", "a processor's cache holds them"
    )
    converged: float = setting(
        0.05,
        "nat a parameter",
        "gain of a step below which a fit has converged",
        "a move by a third of a standard error in the mean",
    )
    tone_chance: float = setting(
        1e-3,
        "1",
        "probability that noise alone shows a tone in a record",
        "one record in a thousand",
    )
    tone_most: int = setting(8, "1", "tones in a record at most", "mains with its harmonics")
    tone_loud: float = setting(
        10.0,
        "1",
        "power of a line over that of an error of the model's size, above which it is a tone",
        "10 dB above the mean of an error's lines",
    )
    tone_side: int = setting(
        4, "1", "bins from a line to where it has fallen by 30 dB", "Hann's window"
    )
    tone_fallen: float = setting(
        0.05,
        "1",
        "share of a line's power above which a bin near it is that line's",
        "13 dB, two bins of Hann's window",
    )
    slower_mains: float = setting(
        50.0, "Hz", "mains, sought in records too short to show a tone", "IEC 60038"
    )
    faster_mains: float = setting(
        60.0, "Hz", "mains, sought in records too short to show a tone", "IEC 60038"
    )
    tone_cycles: float = setting(
        10.0,
        "1",
        "cycles in a record below which a sine counts as drift",
        "the window leaks over a few bins",
    )
    bend: float = setting(
        2e-4,
        "1",
        "rms distance of the drive from lines between block means, over its rms",
        "a fifth of the smallest play",
    )
    lost: float = setting(
        0.1,
        "1",
        "what averaging over blocks may remove, over the noise's variance",
        "a tenth of the information",
    )
    drive_window: int = setting(
        64,
        "sample",
        "length of the windows in which the noise of a measured drive is sought",
        "few of them hold a jump or a turn, and a quarter of their lines tells two levels apart",
    )
    drive_flat: float = setting(
        1.5,
        "1",
        "greatest ratio of a drive's power density from 3/4 to 7/8 of the Nyquist frequency over"
        " that above, where it is noise",
        "both are equal within 10 % in white noise; what a converter is given falls by more",
    )
    drive_turn: float = setting(
        3.5,
        "standard deviation of the drive's noise",
        "least swing of a measured drive that is a turn",
        "noise swings by as much in one of several thousand samples",
    )
    smooth_window: int = setting(
        64,
        "1",
        "stretches of derivatives whose smoothness is tested together",
        "their mean square is known to a sixth",
    )
    smooth_age: int = setting(
        20,
        "1",
        "stretches for which both signals are to be smooth before a window",
        "what decays since a step may change in a stretch by a twentieth",
    )
    smooth_sigma: float = setting(
        3.0,
        "standard deviations",
        "excess of what a stretch hides of the displacement, over that of noise",
        "by chance once in a thousand windows",
    )
    smooth_move: float = setting(
        0.02,
        "half range",
        "longest way of the drive within a stretch",
        "a sixth of a cell of the correction, whose means are then known to 0.4 %",
    )
    smooth_drive: float = setting(
        0.05,
        "1",
        "what a stretch hides of the drive, over the drive's rms about it",
        "derivatives so exact leave a twentieth of each step's misfit",
    )
    near_end: float = setting(
        0.01,
        "range of the drive",
        "distance from an end of the drive at which that end counts as reached",
        "fifty samples a cycle miss the top of a sine by 0.2 %",
    )
    read_after: float = setting(
        5.0,
        "standard deviations",
        "response in the sample of a step, from which on it is not noise",
        "by chance once in a million records",
    )
    rest_margin: float = setting(
        0.1,
        "range of the drive",
        "distance of 0 V from the drives up to which the model's range includes it",
        "an operator hardly changes over a tenth of its range",
    )
    fewest_blocks: int = setting(
        200, "1", "blocks of a record at least", "a record has hundreds of parameters"
    )
    seen_lines: int = setting(
        101,
        "1",
        "lines over which the power of a motion is averaged, to stand out of the noise",
        "chance varies their mean by a tenth",
    )
    told: float = setting(
        0.5,
        "1",
        "standard deviation of an effect's measure, over that beforehand, if it is identified",
        "the records then tell more than what is expected of stages",
    )
    poor: float = setting(
        0.01,
        "range",
        "standard deviation of a predicted scan above which a user is warned",
        "a straight line errs by some per cent",
    )
    wider_scales: float = setting(
        2.0,
        "1",
        "factor over the scales of the greatest evidence at which parameters are uncertain",
        "evidence tells a scale to about such a factor",
    )
    least_discrepancy: float = setting(
        1e-4,
        "1",
        "error of a prediction over its motion beforehand, beyond what its parameters explain",
        "grids of plays and slopes leave as much of operators that are not made of them",
    )
    spread_directions: int = setting(
        12,
        "1",
        "most directions that a model keeps of the covariance of its parameters",
        "in trials the standard deviation of fresh scans is within a third of that of all",
    )
    spread_left: float = setting(
        0.01,
        "1",
        "share of the variance of predictions that further directions may hold",
        "it changes a standard deviation by half of that",
    )
    spread_levels: int = setting(
        41,
        "1",
        "levels of the surfaces by which directions of the parameters differ",
        "as many as the direct inverse has; differences are smooth",
    )
    spread_sizes: int = setting(
        3,
        "1",
        "sizes of scans whose variance chooses the directions, each half the last",
        "images are taken at such sizes",
    )
    stated_loss: float = setting(
        0.1,
        "1",
        "change of what is left of a record, from which on that of fit and model are both stated",
        "a standard deviation is known as well from fifty samples",
    )
    scan_samples: int = setting(
        1000,
        "1",
        "samples of a cycle of these scans",
        "a branch of 500 samples shows plays of a hundredth of the range",
    )
    like_gains: float = setting(
        2.0,
        "1",
        "greatest factor between the gains that records of one scanner show",
        "creep and the place of small loops in the range change a gain by less",
    )
    swing_gains: float = setting(
        2.0,
        "1",
        "further factor by which the gain may grow with the swing of the drive",
        "the scanner of config/plant.yaml moves 2.1 times as far a volt in curves as in waves",
    )
    slow_share: float = setting(
        0.5,
        "first mode",
        "frequency up to which records are compared",
        "a stage moves there as at rest, within a third",
    )
    least_slow: float = setting(
        0.03,
        "1",
        "least share of the motion below that, by which a record is compared",
        "less is hidden by what fast motion leaves",
    )
    likeness_parts: int = setting(
        8,
        "1",
        "parts of a record that are left out in turn for an interval of its loops",
        "the jackknife is not too narrow where parts are few",
    )


DEFAULT_SETTINGS = FitSettings()
