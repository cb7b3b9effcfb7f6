"""Observations alone, without any model of the body: what is wrong is named with its size, chance names nothing."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from effect_cases import CASES
from inferred_sessions import heard, heard_in
from walking import MASS, STANCE, Wrong, session, standing, walk

from biodance.diagnosis.witness_evidence import cause_visibilities, collect_evidence
from biodance.effects import NamedCause, effects
from biodance.inference.rows import rows_of, with_observed
from biodance.inference.sets import Search, hypothesis
from biodance.observations import observe, recording
from biodance.uncertainty.tolerances import shipped

ORDER = {"first": (0.0, 0.2), "last": (0.8, 1.0)}
"""When the simulated trials begin and end, in shares of the session."""


def size_of(evidence, names):
    """Return what observations alone say of the size of a cause, with its standard deviation."""
    asked = effects()
    every = with_observed((), evidence, asked)
    search = Search.of(rows_of(None, every, shipped(), evidence), every)
    one = next(cause.effect for cause in every if cause.names == names)
    (fitted,) = hypothesis(search, (NamedCause(one, np.zeros(one.typical.size), np.empty((0, 0))),)).causes
    return fitted.theta[0], fitted.covariance[0, 0] ** 0.5


def test_standing_cannot_tell_a_small_zero_from_a_plate_that_is_not_level() -> None:
    """0.3 % of the weight is a lean of 0.17 degrees; all trials share it."""
    seen = observe(recording(standing(push=4.0, weight=62.0), mass=MASS), ["standing_force"])
    one = next(one for one in seen if one.what == "mean Fx")
    (share,) = [size / (62.0 * 9.81) for size in one.norms.values()]
    assert 0.003 < share < 0.004
    twice = collect_evidence(session(standing(push=4.0), standing(push=4.0)))
    assert size_of(twice, ("plate_offset", "Fx"))[1] > 1.5


def test_clean_walks_and_standing_name_nothing() -> None:
    evidence = collect_evidence(session(standing(), walk(), walk(name="again")))
    assert heard_in(evidence).diagnosis.findings == ()
    rows = {(row.effect, row.target): row for row in cause_visibilities(evidence)}
    assert rows["plate_position", "plate1:y"].sd < 0.005
    assert ("plate_crosstalk", "plate1:Fz->Mx") in rows["plate_position", "plate1:y"].alike
    assert rows["plate_gain", "plate2:Fx"].observers == ()


@pytest.mark.parametrize(("heavier", "a_load"), [(0.05, True), (-0.05, False)])
def test_who_weighs_more_than_declared_may_carry_a_load(heavier: float, a_load: bool) -> None:
    """A load is weight, too; but nobody carries less than nothing."""
    weighed = standing(weight=(1 + heavier) * MASS)
    (one,) = heard(session(weighed, replace(weighed, name="later"))).diagnosis.findings
    alike = {(alias.effect, alias.target) for alias in one.set}
    assert [n in alike for n in (("plate_gain", "Fz"), ("body_mass", ""), ("added_mass", ""))] == [True, True, a_load]


@pytest.mark.parametrize(
    ("wrong", "names", "size"),
    [
        (Wrong(moved=(0.0, 0.02)), ("plate_position", "plate1:y"), 0.02),
        (Wrong(late=0.03), ("time_delay", ""), 0.03),
        (Wrong(gain=0.06), ("plate_gain", "plate1:Fz"), 0.06),
        (Wrong(signs=(-1, -1, 1, -1, -1, -1)), ("axis_error", "plate1:Fz"), None),
    ],
)
def test_what_is_wrong_in_two_walks_is_named(wrong: Wrong, names: tuple[str, str], size: float | None) -> None:
    found = heard(session(standing(wrong), walk(wrong), walk(wrong, name="again"))).diagnosis.findings
    assert [(one.effect, one.target) for one in found] == [names]
    if size is not None:
        low, high = found[0].parameters[0].interval
        assert low <= size <= high
        assert found[0].parameters[0].sd < 0.35 * size


def test_witnesses_that_contradict_each_other_exclude_little() -> None:
    """30 ms early here and 30 ms late there is no clock that is right to some milliseconds."""
    delay = ("time_delay", "")
    agreed = size_of(collect_evidence(session(walk(), walk(name="again"))), delay)
    torn = size_of(collect_evidence(session(walk(Wrong(late=0.03)), walk(Wrong(late=-0.03), name="again"))), delay)
    assert torn[1] > 2.0 * agreed[1]
    assert all(abs(torn[0] - late) < 4.0 * torn[1] for late in (0.03, -0.03))


def test_one_odd_step_names_nothing() -> None:
    odd = walk(Wrong(late=0.03))
    others = [walk(name=f"walk{i}") for i in range(3)]
    shifted = heard(session(*others, odd)).diagnosis.findings
    assert not [one for one in shifted if one.effect != "time_delay"]


def test_seconds_of_single_contact_count() -> None:
    assert collect_evidence(session(walk())).seconds["walk"] == pytest.approx(2 * STANCE, abs=0.02)


def test_a_laboratory_s_own_norm_is_expected_and_a_fault_is_no_norm() -> None:
    """Its clock comes 4 ms later than elsewhere: expected then. 30 ms in all its sessions are a fault all the same."""
    late = session(standing(), walk(Wrong(late=0.004)), walk(Wrong(late=0.004), name="again"))
    before, own, fault = (
        [one for one in collect_evidence(late, None, norms).observations if one.observer == "force_onset"]
        for norms in ({}, {"force_onset": (0.004, 0.0001)}, {"force_onset": (0.03, 0.0001)})
    )
    assert len(before) >= 2
    for was, now, wrong in zip(before, own, fault, strict=True):
        assert now.expected - was.expected == pytest.approx(0.004, rel=0.01)
        assert now.norms["laboratory onset"] < 0.1 * was.norms["laboratory onset"]
        assert wrong == was


@pytest.mark.parametrize(
    ("drift", "steady", "target"), [("clock_drift", "time_delay", ""), ("plate_drift", "plate_offset", "plate1:Fx")]
)
def test_a_drift_moves_clocks_and_zeros_by_where_their_trial_lies(drift, steady, target) -> None:
    """Late by half of the drift at the end, early by half at the start; a trial that is not simulated has no place."""
    evidence = collect_evidence(session(standing(), walk(name="first"), walk(name="last"), walk(name="aside")))
    cases = [SimpleNamespace(trial=SimpleNamespace(name=n), session_time=np.array(t)) for n, t in ORDER.items()]
    found = replace(rows_of(None, (), shipped(), evidence), problem=SimpleNamespace(cases=tuple(cases)))
    grows, stays = (found.observed(replace(effects()[name], target=target))[:, 0] for name in (drift, steady))
    trial = np.array([one.trial for one in found.evidence.observations])
    assert all(stays[trial == name].any() for name in ("first", "last", "aside"))
    for name, share in (("first", -0.4), ("last", 0.4), ("aside", 0.0)):
        np.testing.assert_allclose(grows[trial == name], share * stays[trial == name])


def test_what_only_observations_judge_is_sized_for_the_person_too() -> None:
    evidence, case = collect_evidence(session(standing(), walk())), CASES[1]
    (own,) = (one.effect for one in with_observed((), evidence, effects(), of=case) if one.names == ("body_mass", ""))
    assert own.usual == pytest.approx(0.01 * case.body.sip.mass.sum())
