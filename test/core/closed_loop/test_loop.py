"""The loop with a stand-in for the diagnosis: what is kept, what is not, when it ends."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from attrs import define, evolve, field, frozen

from afm_scan_ros.core.closed_loop import Round, close_loop, validation_specs
from afm_scan_ros.core.comparison import compare_scans
from afm_scan_ros.core.diagnosis.experiments import Proposal, SizedExperiment
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import Added, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from helpers.in_process import InProcessSession, default_model

PLANT = load_plant(share_directory() / "config/plants/delay_large.yaml")
DELAY = 170e-6
"""Of that plant, s."""
SPEC = ScanSpec(
    line_rate=20.0,
    lines=4,
    samples_per_line=500,
    range_x=20e-6,
    range_y=20e-6,
    preparation_cycles=3,
    preparation_lower=-12e-6,
    preparation_upper=12e-6,
)


@frozen(eq=False)
class Found:
    """As much of a diagnosis as the loop looks at."""

    model: ScannerModel
    verdict: str = "effect_found"
    experiment: str | None = None

    @property
    def proposal(self) -> Proposal | None:
        """As it stands in the library."""
        if self.experiment is None:
            return None
        return Proposal("x", SizedExperiment.of_library(self.experiment, self.model))


@define
class Tracing:
    """Returns the given answers, one a call, the last one repeatedly; keeps the records' names."""

    answers: list[Found]
    records: list[list[str]] = field(factory=list)

    def __call__(self, model: ScannerModel, observations: Sequence[Record]) -> Any:  # noqa: ANN401 - a stand-in
        assert model is default_model()
        self.records.append([each.name for each in observations])
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


def delayed(delay: float) -> ScannerModel:
    model = default_model()
    return evolve(model, x=evolve(model.x, added=(Added("delay", "", (delay,)),)))


def loop(session: Any, *answers: Found) -> tuple[list[Round], Tracing]:  # noqa: ANN401 - any laboratory
    tracing = Tracing(list(answers))
    rounds = close_loop(session, default_model(), validation_specs(SPEC), 3, tracing)
    return list(rounds), tracing


def test_a_right_extension_is_kept_and_helps_on_scans_that_were_not_fitted() -> None:
    (first, last), tracing = loop(InProcessSession(PLANT), Found(delayed(DELAY)))
    assert first.kept
    assert first.improved
    assert first.worse == {}
    assert set(first.comparisons) == {"same", "rate", "amplitude", "pattern"}
    for trial in first.comparisons.values():
        assert trial.change["x"] < 0.5
        assert trial.change["y"] == pytest.approx(1.0, abs=0.02)
        rms = trial.residual["x"]
        assert rms.after < 0.3 * rms.before
    assert (last.comparisons, last.after, last.kept) == ({}, {}, False)  # nothing more was found
    assert last.model == delayed(DELAY)
    assert tracing.records == [["same_0"], ["same_0", "same_1"]]


def test_an_extension_that_makes_it_worse_is_not_kept() -> None:
    ((only,), _) = loop(InProcessSession(PLANT), Found(delayed(1e-3)))
    assert not only.kept
    assert not only.improved
    assert {axis for _, axis in only.worse} == {"x"}
    assert min(only.worse.values()) > 1.05


def test_where_nothing_is_found_nothing_is_scanned_again() -> None:
    session = InProcessSession(PLANT, seed=5)
    ((only,), _) = loop(session, Found(default_model(), "model_sufficient"))
    assert only.comparisons == {}
    assert not only.kept
    again = InProcessSession(PLANT, seed=5).scan("", SPEC, default_model())
    assert np.array_equal(only.before["same"].measured.x, again.measured.x)


@define
class Counting(InProcessSession):
    """Counts its experiments."""

    asked: list[str] = field(factory=list)

    def experiment(self, plan: Plan) -> Record:
        """Remember the name; do not move."""
        self.asked.append(plan.name)
        return evolve(super().experiment(EXPERIMENTS["rest"].plan()), name=plan.name)


def test_a_doubt_is_settled_by_an_experiment_that_is_made_once() -> None:
    doubt = Found(delayed(DELAY), "ambiguous", "broadband")
    session = Counting(PLANT)
    (rounds, tracing) = loop(session, doubt, doubt, doubt)
    assert session.asked == ["broadband"]
    assert [done.experiments for done in rounds] == [("broadband",), ()]
    assert tracing.records == [
        ["same_0"],
        ["same_0", "broadband"],
        ["same_0", "same_1", "broadband"],
    ]


def test_as_long_as_a_doubt_stands_another_experiment_is_made_but_not_for_ever() -> None:
    doubts = [Found(default_model(), "ambiguous", name) for name in ("rates", "hold", "one_axis")]
    session = Counting(PLANT)
    ((only,), tracing) = loop(session, *doubts)
    assert session.asked == ["rates", "hold"]
    assert only.experiments == ("rates", "hold")
    assert tracing.records[-1] == ["same_0", "rates", "hold"]


class Refusing(InProcessSession):
    """Cannot scan with an extended model."""

    def scan(self, label: str, spec: ScanSpec, model: ScannerModel) -> Scan:
        """Refuse it."""
        if model.x.added:
            raise ScanError("sample 7, axis x: the drive is beyond the amplifier's limit")
        return super().scan(label, spec, model)


def test_an_inverse_that_cannot_scan_is_said_and_not_kept() -> None:
    ((only,), _) = loop(Refusing(PLANT), Found(delayed(DELAY)))
    assert "beyond the amplifier's limit" in only.refusal
    assert not only.kept


def test_a_scan_repeated_with_the_same_model_is_neither_better_nor_worse() -> None:
    session = InProcessSession(PLANT)
    first, second = (session.scan("", SPEC, default_model()) for _ in range(2))
    assert not np.array_equal(first.measured.x, second.measured.x)  # the noise is another
    trial = compare_scans(default_model(), default_model(), first, second)
    assert trial.worse == {}
    assert not trial.better
    assert all(rms.before == rms.after for rms in trial.residual.values())
    assert trial.true_before == trial.true_after
