"""What a diagnosis finds in the fine steering mirror, from a model of its smallest amplitude."""

import numpy as np

import afm_scan_ros as afm
from afm_scan_bench.measured.mirror.recordings import (
    AMPLITUDES,
    EFFECTS,
    FOLDS,
    REALISATIONS,
    identified,
    predicted,
    record,
    score,
)
from afm_scan_ros.report.table import Row, Table

FOLD = FOLDS[0]
STATES = 28
SMALLEST, *LARGER = AMPLITUDES
COLUMNS = {
    "model": ("model of all amplitudes", ""),
    "effects": ("effects", ""),
    "score_100_um": ("100 mV, um", ".4f"),
    "score_200_um": ("200 mV, um", ".4f"),
    "score_300_um": ("300 mV, um", ".4f"),
}


def measure() -> Table:
    """Diagnose, and score the extended model beside that of effects named by hand."""
    found = _diagnosed()
    names = ", ".join(effect.name for effect in found.effects) or "none"
    by_hand = identified(AMPLITUDES, FOLD, EFFECTS, STATES)
    rows = [_row("of the diagnosis", names, found.model)]
    rows.append(_row("by hand", ", ".join(EFFECTS), by_hand))
    probabilities = found.probabilities["all"]
    return Table("fsm_diagnosed", _title(found.verdict, probabilities), COLUMNS, rows)


def _diagnosed() -> afm.Diagnosis:
    kept = [k for k in REALISATIONS if k not in FOLD]
    model = identified((SMALLEST,), FOLD, states=STATES)
    larger = [record(amplitude, k) for amplitude in LARGER for k in kept]
    return afm.diagnose(model, larger, healthy=[record(SMALLEST, k) for k in kept])


def _title(verdict: str, probabilities: dict[str, float]) -> str:
    stated = ", ".join(f"{name} {p:.3g}" for name, p in list(probabilities.items())[:4])
    return (
        "Fine steering mirror (Floren et al., ISMA-USD 2024, pp. 2042-2052, CC BY 4.0)\n"
        f"Identified at {SMALLEST} mV, diagnosed with {LARGER[0]} and {LARGER[1]} mV: {verdict}.\n"
        f"Probabilities: {stated}.\n"
        f"Score of the held-out realisations {FOLD[0]} and {FOLD[1]}, {STATES} states"
    )


def _row(model: str, effects: str, of: afm.Model) -> Row:
    scores = {
        f"score_{amplitude}_um": 1e6
        * float(np.mean([score(predicted(of, amplitude, k), amplitude, k) for k in FOLD]))
        for amplitude in AMPLITUDES
    }
    return {"model": model, "effects": effects, "states": STATES, **scores}
