"""Which causes stand in the set of a finding: those that are nearly as probable as the best one, and no others."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import about_plate, body, known, windows

from biodance.diagnosis.naming import Round, build_model, passes_threshold, refine
from biodance.diagnosis.problem import problem
from biodance.diagnosis.screening import ScoredCandidate, screen
from biodance.effects import effect


def scored(name: str, log_bayes_factor: float, *, targets: int = 1) -> ScoredCandidate:
    """Return a cause with its evidence and what ``targets`` take off it."""
    return ScoredCandidate(effect(name), log_bayes_factor, log_bayes_factor - np.log(targets), np.zeros(0), 1.0)


def test_a_cause_twenty_times_less_probable_is_not_in_the_set() -> None:
    """exp(3) = 20: of 100, 98, 96 and 40 (natural logarithms) the first two cannot be told apart."""
    ranking = Round(
        (scored("plate_gain", 100.0), scored("lab_tilt", 98.0), scored("body_mass", 96.0), scored("time_delay", 40.0))
    )
    assert [one.effect for one in ranking.set] == ["plate_gain", "lab_tilt"]


@pytest.mark.parametrize(("second", "together"), [(100.0 - 2.9, True), (100.0 - 3.1, False)])
def test_the_set_ends_three_behind_the_best(second: float, together: bool) -> None:
    ranking = Round((scored("plate_gain", 100.0), scored("lab_tilt", second)))
    assert (len(ranking.set) == 2) == together


def test_nobody_leaves_the_set_because_it_has_many_targets() -> None:
    """Thirty targets cost ln 30 = 3.4, which is more than the set's three: alone they would have been as probable."""
    crowd = scored("plate_crosstalk", 99.0, targets=30)
    ranking = Round((scored("plate_gain", 100.0), crowd))
    assert ranking.suspects[0].score - crowd.score > 3.0
    assert [one.effect for one in ranking.set] == ["plate_gain", "plate_crosstalk"]


@pytest.mark.parametrize(("evidence", "targets", "named"), [(10.1, 1, True), (9.9, 1, False), (12.0, 30, False)])
def test_a_cause_is_named_from_a_log_bayes_factor_of_ten_on_and_its_targets_count(
    evidence: float, targets: int, named: bool
) -> None:
    assert known().threshold == 10.0
    assert passes_threshold(Round((scored("plate_crosstalk", evidence, targets=targets),)), known()) == named
    assert not passes_threshold(Round(()), known())


@pytest.mark.parametrize(("score", "first"), [(9.9, ("plate_gain", "Fx")), (10.1, ("plate_gain", "Fz"))])
def test_only_what_the_screening_suspects_is_fitted(score: float, first: tuple[str, str]) -> None:
    """Fz reads 5 % too much. Where the screening says less than ten of it, its fit is not asked."""

    def gained(local, session):
        local[:, 2] *= 1.05
        return local

    put, causes = build_model(problem(body(), windows(1, hidden=about_plate(gained))), known(), ("plate_gain",))
    true, other = (next(one for one in screen(put, causes) if one.names[1] == channel) for channel in ("Fz", "Fx"))
    ranking = Round((replace(other, score=11.0, log_bayes_factor=11.0), replace(true, score=score)))
    refined, _ = refine(put, ranking, put.tolerances)
    assert refined.suspects[0].names == first
