"""The numbers that decide in a fit, and what each follows from."""

from attrs import frozen

from afm_scan_ros.core.settings import setting


@frozen
class FitSettings:
    """What the fit of an axis resolves, expects beforehand, and takes for significant."""

    smallest_play: float = setting(
        1e-3, "half range", "smallest threshold of the plays", "a scan of 1/500 of the range turns"
    )
    play_step: float = setting(
        1.0 / 80.0,
        "half range",
        "distance of the larger thresholds",
        "steps twice as long leave twice the error on fresh scans",
    )
    small_plays: int = setting(
        9,
        "1",
        "thresholds in geometric steps below two play_steps",
        "1.5 to each, as a density is smooth",
    )
    correction_plays: int = setting(
        11, "1", "thresholds between which the correction is linear", "the correction is coarse"
    )
    correction_cells: int = setting(
        4, "1", "cells of the correction's splines over the range", "the correction is coarse"
    )
    surface_levels: int = setting(
        161, "1", "levels of the Everett surface of a model", "one for each play_step"
    )
    direct_levels: int = setting(
        41, "1", "levels of the direct inverse's surface", "its error is that of the method, 0.5 %"
    )
    slope_cells_drive: int = setting(
        8,
        "1",
        "cells of a Duhem operator's slopes along the drive",
        "smooth maps before the operator",
    )
    slope_cells_state: int = setting(
        12,
        "1",
        "cells of a Duhem operator's slopes along its state",
        "twice as fine as a loop needs",
    )
    state_margin: float = setting(
        0.1,
        "range of the state",
        "by which slopes reach beyond what the start shows",
        "a start errs",
    )
    least_slope: float = setting(
        0.02, "1", "least slope dA/du of a Duhem operator", "only a growing output has an inverse"
    )
    map_terms: int = setting(
        4, "1", "coefficients of the map behind the plays", "a map of the fifth degree"
    )
    smooth_density: float = setting(
        3.0, "1", "largest standard deviation of the density's bends", "a density is of order 1"
    )
    rough_density: float = setting(
        0.3, "1", "largest standard deviation of the density's rough part", "a tenth of it"
    )
    correction: float = setting(
        0.3, "1", "largest standard deviation of the correction's bends", "a tenth of the density"
    )
    output_map: float = setting(
        0.2,
        "half range",
        "largest standard deviation of the map's terms",
        "stages bend by 5 to 10 %",
    )
    slopes: float = setting(
        5.0, "1", "largest standard deviation of the slopes' bends", "a slope is of order 1"
    )
    creep: float = setting(
        0.3, "1", "largest standard deviation of creep's density", "creep is 1 to 10 % a decade"
    )
    first_scale: float = setting(
        0.1, "1", "share of these at which the search for the most evident begins", "a decade below"
    )
    lag_weight: float = setting(
        0.1,
        "static gain",
        "standard deviation of each fast lag's weight",
        "lags are small corrections",
    )
    creep_per_decade: int = setting(
        4, "1/decade", "time constants of creep", "10 in all leave gain errors of 1 to 2 %, 16 none"
    )
    slowest_lag: float = setting(
        3.0,
        "1/omega",
        "slowest fast lag, omega the first mode's",
        "a mode says nothing far below it",
    )
    fastest_creep: float = setting(
        50.0, "1/omega", "fastest time constant of creep", "ten times slower than the lags"
    )
    fast_lags: int = setting(
        6, "1", "fast lags", "with one, errors at 0.1 to 2 kHz bend the hysteresis"
    )
    damping: float = setting(
        0.02, "1", "damping of a mode beforehand", "piezo stages: 0.003 to 0.1"
    )
    heaviest_mode: float = setting(
        3.0,
        "static gain",
        "largest weight of a mode",
        "modes that cancel explain nothing",
    )
    mode_chance: float = setting(
        20.0, "nat", "least gain of likelihood by a mode", "4 parameters at one of 10^4 places"
    )
    mode_share: float = setting(
        0.05, "misfit", "least share of the misfit that a mode explains", "less is model error"
    )
    dominant_share: float = setting(
        0.5,
        "misfit",
        "share from which a mode is taken before the hysteresis",
        "it hides the loops",
    )
    most_modes: int = setting(4, "1", "modes at most", "further ones told little")
    trial_steps: int = setting(
        4, "1", "steps before the operators are compared", "errors differ tenfold"
    )
    most_steps: int = setting(25, "1", "steps at most", "three times what converging fits need")
    converged: float = setting(
        1.0, "nat", "gain below which a fit has converged", "a standard error"
    )
    tone_chance: float = setting(
        1e-3, "1", "probability that noise passes for a tone in a record", "a record in a thousand"
    )
    tone_most: int = setting(8, "1", "tones at most in a record", "mains with its harmonics")
    tone_cycles: float = setting(
        10.0, "1", "cycles in a record below which a tone counts as drift", "ten side lobes away"
    )
    bend: float = setting(
        2e-4,
        "drive",
        "distance of the drive from lines between means of blocks",
        "a small play's width",
    )
    lost: float = setting(
        0.1,
        "noise variance",
        "what blocks may lose of a displacement",
        "a tenth of the information",
    )
    fewest_blocks: int = setting(200, "1", "blocks of a record at least", "more than parameters")


DEFAULT_SETTINGS = FitSettings()
