"""What a session ends with: probabilities of places, sets that hold 95 %, sizes averaged over all sets of causes."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import about_plate, body, known, offset, windows
from inferred_rows import Drawn, rows, search
from inferred_sessions import heard, inferred
from walking import MASS, Wrong, session, standing, walk

from biodance.diagnosis.reasons import DiagnosisStatus, Reason
from biodance.diagnosis.witness_evidence import ObservedEvidence
from biodance.effects import NamedCause, Parameter
from biodance.effects.body_mass import BodyMass
from biodance.effects.marker_misplaced import MarkerMisplaced
from biodance.inference.decision import IN_SET, NAMED, _is_unusual, places, well
from biodance.inference.hypotheses import Hypothesis, Posterior
from biodance.inference.sets import hypothesis
from biodance.observations import Observation

FAST = ("plate_gain", "plate_offset", "time_delay", "body_mass")


@pytest.fixture(scope="module")
def bare() -> Hypothesis:
    """Return rows without any cause."""
    columns = {name: np.zeros((77, 1)) for name in "abcd"}
    return hypothesis(search(rows(np.random.default_rng(1), causes=columns)), ())


def holding(bare: Hypothesis, log_posterior: float, **sizes: tuple[float, float]) -> Hypothesis:
    """Return a set of causes of known posterior, each with size and standard deviation."""
    causes = tuple(NamedCause(Drawn(name), np.array([v]), np.array([[sd**2]])) for name, (v, sd) in sizes.items())
    return replace(bare, causes=causes, log_posterior=log_posterior, log_unknown=-np.inf)


def posterior(*every: Hypothesis) -> Posterior:
    return Posterior(every, ())


def logs(*shares: float) -> list[float]:
    return np.log(shares).tolist()


def test_a_place_is_as_probable_as_all_that_may_stand_in_it(bare: Hypothesis) -> None:
    none, a, b = logs(0.1, 0.6, 0.3)
    every = posterior(holding(bare, none), holding(bare, a, a=(1.0, 0.1)), holding(bare, b, b=(2.0, 0.1)))
    (place,) = places(every, {})
    assert place.cause.effect.target == "a"
    assert place.probability == pytest.approx(0.9)
    assert [share for _, share, _ in place.shares] == pytest.approx([2 / 3, 1 / 3])


@pytest.mark.parametrize(
    ("shares", "kept"),
    [((0.96, 0.03, 0.01), "a"), ((0.62, 0.36, 0.02), "ab"), ((0.6, 0.36, 0.04), "abc"), ((0.5, 0.44, 0.06), "abc")],
)
def test_a_set_holds_95_percent_and_what_is_three_nats_behind(
    bare: Hypothesis, shares: tuple[float, ...], kept: str
) -> None:
    sets = [holding(bare, value, **{name: (1.0, 0.1)}) for name, value in zip("abc", logs(*shares), strict=True)]
    (place,) = places(posterior(holding(bare, -20.0), *sets), {})
    assert "".join(alias.target for alias in place.set) == kept
    assert sum(share for (_, target), share, _ in place.shares if target in kept) >= IN_SET


def test_the_evidence_of_a_look_alike_is_without_its_prior(bare: Hypothesis) -> None:
    every = posterior(holding(bare, -8.0), holding(bare, -2.0, a=(1.0, 0.1)))
    (place,) = places(every, {("drawn", "a"): -3.0})
    assert place.set[0].log_bayes_factor == pytest.approx(9.0)


def test_a_size_is_averaged_over_all_sets_that_hold_the_cause(bare: Hypothesis) -> None:
    """Mixture of 75 % at 2 ± 0.1 and 25 % at 4 ± 0.2: mean 2.5, variance 0.75 (0.01 + 0.25) + 0.25 (0.04 + 2.25)."""
    none, one, two = logs(0.2, 0.6, 0.2)
    every = posterior(
        holding(bare, none), holding(bare, one, a=(2.0, 0.1)), holding(bare, two, a=(4.0, 0.2), b=(1.0, 0.1))
    )
    (place,) = places(every, {})
    assert place.cause.theta[0] == pytest.approx(2.5)
    assert place.cause.covariance[0, 0] == pytest.approx(0.7675)


def test_a_second_cause_has_its_own_place(bare: Hypothesis) -> None:
    none, a, b, ab = logs(0.02, 0.3, 0.08, 0.6)
    sizes = {"a": (1.0, 0.1), "b": (1.0, 0.1)}
    every = posterior(
        holding(bare, none),
        *(holding(bare, value, **{name: sizes[name]}) for name, value in (("a", a), ("b", b))),
        holding(bare, ab, **sizes),
    )
    found = {place.cause.effect.target: place.probability for place in places(every, {})}
    assert found == pytest.approx({"a": 0.38 / 0.4, "b": 0.6})


def test_one_cause_does_not_stand_in_two_places(bare: Hypothesis) -> None:
    """Either a and b together, or c alone in place of both: that one of a and c is there is sure, and b is not."""
    none, ab, c, bc = logs(0.005, 0.53, 0.43, 0.03)
    a, rare = 0.004, np.log(0.001)
    every = posterior(
        holding(bare, none),
        holding(bare, np.log(a), a=(-0.03, 0.01)),
        holding(bare, rare, b=(1.0, 0.1)),
        holding(bare, c, c=(0.04, 0.01)),
        holding(bare, ab, a=(-0.04, 0.01), b=(1.0, 0.1)),
        holding(bare, bc, b=(0.1, 0.1), c=(0.04, 0.01)),
        holding(bare, np.log(0.001), a=(-0.02, 0.01), c=(0.02, 0.01)),
    )
    first, second = places(every, {})
    assert (first.cause.effect.target, second.cause.effect.target) == ("c", "b")
    assert first.probability > 0.98
    assert second.probability == pytest.approx(every.share(first.names, second.names))
    assert second.probability < 0.6


def test_two_causes_sure_beside_each_other_are_no_surer_than_both(bare: Hypothesis) -> None:
    """Each explains what the other does wrong: neither is there alone, and both are as probable as none."""
    none, both, alone = logs(0.49, 0.5, 0.005)
    sizes = {"a": (1.0, 0.1), "b": (-1.0, 0.1)}
    every = posterior(
        holding(bare, none),
        *(holding(bare, alone, **{name: sizes[name]}) for name in sizes),
        holding(bare, both, **sizes),
    )
    assert [place.probability for place in places(every, {})] == pytest.approx([0.505, 0.505])


@pytest.mark.parametrize("unknown", [0.2, 0.6, 0.95])
def test_a_cause_is_as_probable_as_with_and_without_an_unknown_one(bare: Hypothesis, unknown: float) -> None:
    """0.9 where noise is as in laboratories, 0.3 where it is as loud as an unknown cause makes it."""
    quiet = [holding(bare, np.log(0.1 * (1 - unknown))), holding(bare, np.log(0.9 * (1 - unknown)), a=(1.0, 0.1))]
    beside = [replace(one, log_unknown=np.log(unknown / (1 - unknown)) + one.log_posterior) for one in quiet]
    loud = posterior(holding(bare, np.log(0.7)), holding(bare, np.log(0.3), a=(2.0, 0.1)))
    every = replace(posterior(*beside), louder=loud)
    assert every.unknown == pytest.approx(unknown)
    assert every.best in (loud.hypotheses if unknown > 0.5 else every.hypotheses)
    assert every.probabilities() == {("drawn", "a"): pytest.approx((1 - unknown) * 0.9 + unknown * 0.3)}
    for place in places(every, {}):
        assert place.probability <= (1 - unknown) * 0.9 + unknown * 0.3 + 1e-9


class Least(Drawn):
    """A force that matters from 2 N on."""

    parameters = (Parameter("size", "N", 1.0, "a draw", least=2.0),)


@pytest.mark.parametrize(("matters", "probability"), [(True, 0.63), (False, 0.63 + 0.1 * 0.8)])
def test_nothing_is_wrong_where_nothing_that_matters_is_there(
    bare: Hypothesis, matters: bool, probability: float
) -> None:
    """0.4 for none, 0.3 for a force too small to matter, 0.3 for one that is not; an unknown in one session of ten,
    beside which the large one is there in one of five.
    """

    def of_size(share: float, newton: float) -> Hypothesis:
        cause = NamedCause(Least("a"), np.array([newton]), np.array([[0.01]]))
        return replace(holding(bare, np.log(share)), causes=(cause,))

    sets = [holding(bare, np.log(0.4)), of_size(0.3, 1.0), of_size(0.3, -5.0)]
    beside = [replace(one, log_unknown=one.log_posterior - np.log(9)) for one in sets]
    loud = posterior(holding(bare, np.log(0.8)), of_size(0.2, 5.0))
    every = replace(posterior(*beside), louder=loud)
    assert well(bare.rows, every, unknown_matters=matters) == pytest.approx(probability)


@pytest.mark.parametrize(("person", "probability"), [(70.0, 1.0), (35.0, 0.3)])
def test_half_a_kilogram_of_clothes_is_usual_on_an_adult_and_much_on_a_child(
    bare: Hypothesis, person: float, probability: float
) -> None:
    cause = NamedCause(BodyMass(mass=person), np.array([0.5]), np.array([[0.01]]))
    every = posterior(holding(bare, np.log(0.3)), replace(holding(bare, np.log(0.7)), causes=(cause,)))
    assert well(bare.rows, every, unknown_matters=False) == pytest.approx(probability)


@pytest.mark.parametrize(
    ("shift_mm", "sd_mm", "told"),
    [
        ((-4.0, -8.8, 6.5), 1.0, False),  # 11.6 mm
        ((8.0, 8.0, 8.0), 1.0, False),  # 13.9 mm, what skin does on every axis
        ((0.0, -20.0, 0.0), 1.0, True),
        ((0.0, -20.0, 0.0), 8.0, False),
    ],
)
def test_a_marker_has_moved_where_it_lies_farther_away_than_skin_carries_it(
    shift_mm: tuple[float, ...], sd_mm: float, told: bool
) -> None:
    """By a standard deviation; skin carries it by 8 mm an axis, 13.9 mm in all."""
    one = NamedCause(MarkerMisplaced("C7"), 1e-3 * np.array(shift_mm), 1e-6 * sd_mm**2 * np.eye(3))
    assert _is_unusual(one) is told


@pytest.mark.parametrize(
    ("size", "where"), [(3.5, "tolerated"), (6.0, "tolerated"), (8.0, "findings"), (12.0, "findings")]
)
def test_what_is_told_is_sure_and_larger_than_laboratories_have(size: float, where: str) -> None:
    """Zeros of up to 7 N stand in laboratories without being called a fault."""
    one = inferred(body(), windows(1, trials=2, hidden=offset(size)), tolerances=known(), effects=FAST)
    told = one.diagnosis
    (found,) = getattr(told, where)
    assert found.effect == "plate_offset"
    assert found.probability >= NAMED
    assert found.parameters[0].value == pytest.approx(size, abs=0.6)
    assert len(told.findings) + len(told.tolerated) == 1
    assert len(one.named) == len(told.findings)
    assert told.explained


def steps(*times: float) -> ObservedEvidence:
    """Return a foot seen on the plate at some ``times`` (s), where it should be."""
    seen = (
        Observation("foot_along", f"left foot on plate1 at {t} s", "t0", 0.0, 0.02, 0.0, "m", plate="plate1")
        for t in times
    )
    return ObservedEvidence(tuple(seen), {}, {})


@pytest.mark.parametrize(("times", "told"), [((), True), ((1.0,), False), ((1.0, 2.5), True)])
def test_one_step_names_no_fault_of_its_plate(times: tuple[float, ...], told: bool) -> None:
    """Nor does it say that nothing is wrong: 40 N are there."""
    hidden = windows(1, trials=2, hidden=offset(40.0))
    one = inferred(body(), hidden, tolerances=known(), effects=FAST, evidence=steps(*times)).diagnosis
    assert [f.effect for f in (one.findings if told else one.resembles)] == ["plate_offset"]
    assert one.explained == told
    assert one.status is (DiagnosisStatus.NAMED if told else DiagnosisStatus.CANNOT_TELL)


@pytest.mark.parametrize(("lags", "told"), [((), True), ((0.0, 0.001), False), ((0.035, 0.04), True)])
def test_no_delay_is_named_that_newton_contradicts(lags: tuple[float, ...], told: bool) -> None:
    """Forces come 20 ms late; total force and trunk go together, or 35 to 40 ms apart."""

    def late(local: np.ndarray, session: tuple[float, float]) -> np.ndarray:
        return np.concatenate([local[:1], local[:-1]])

    seen = ObservedEvidence(
        tuple(Observation("newton", "all plates, lag", f"t{k}", lag, 0.002, 0.0, "s") for k, lag in enumerate(lags)),
        {},
        {},
    )
    hidden = windows(1, trials=2, hidden=about_plate(late))
    one = inferred(body(), hidden, tolerances=known(), effects=FAST, evidence=seen).diagnosis
    (found,) = one.findings if told else one.resembles
    assert found.effect == "time_delay"
    assert found.parameters[0].value == pytest.approx(0.02, abs=0.001)
    assert one.status is (DiagnosisStatus.NAMED if told else DiagnosisStatus.CANNOT_TELL)


def test_no_size_is_surer_than_plates_as_installed_are_alike() -> None:
    """Zeros of laboratories without fault differ by 0.3 N, which no long recording makes less."""
    one = inferred(body(), windows(1, trials=2, hidden=offset(12.0)), tolerances=known(), effects=FAST)
    (finding,) = one.diagnosis.findings
    assert finding.parameters[0].sd >= 0.3


def test_without_a_finding_its_size_goes_and_the_others_are_fitted_again() -> None:
    hidden = offset(12.0)

    def both(wrench, moving, motion):
        return 1.06 * hidden(wrench, moving, motion)

    one = inferred(body(), windows(1, trials=2, hidden=both), tolerances=known(), effects=FAST)
    assert len(one.named) == 2
    less = one.without(1)
    (kept,), (gone,) = less.diagnosis.findings, less.diagnosis.resembles
    assert (kept, gone) == one.diagnosis.findings
    assert len(less.named) == 1
    assert less.named[0].effect == one.named[0].effect


def test_what_kept_data_refute_is_not_there_and_what_else_explains_it_may_be() -> None:
    one = inferred(body(), windows(1, trials=2, hidden=offset(12.0)), tolerances=known(), effects=FAST)
    seen = set()
    while one.diagnosis.findings:
        gone = one.diagnosis.findings[0]
        seen.add((gone.effect, gone.target))
        one = one.refuted(0)
        assert seen.isdisjoint((found.effect, found.target) for found in one.diagnosis.findings)
        assert all(seen.isdisjoint(some.names) for some in one.posterior.hypotheses)
    assert seen <= {(found.effect, found.target) for found in one.diagnosis.resembles}
    assert one.diagnosis.status is DiagnosisStatus.CANNOT_TELL
    assert Reason.CONTRADICTED in one.diagnosis.why


def test_one_foot_on_one_plate_cannot_tell_a_moved_plate_from_a_moved_marker() -> None:
    """Where the moved plate is not sure, the markers of that foot stand beside it."""
    unsure = 0
    for shift in (0.022, 0.024, 0.026, 0.03, 0.04):
        wrong = Wrong(moved=(0.0, shift))
        trials = (walk(wrong, name=name) for name in ("walk", "again"))
        for finding in heard(session(*trials)).diagnosis.findings:
            alike = {alias.effect for alias in finding.set}
            if finding.effect == "plate_position":
                assert ("toe_landmark" in alike) == (finding.probability < IN_SET)
                unsure += finding.probability < IN_SET
    assert unsure


def test_who_is_heavier_than_declared_may_carry_a_load_where_only_weights_are_seen() -> None:
    weighed = standing(weight=1.05 * MASS)
    (one,) = heard(session(weighed, replace(weighed, name="later"))).diagnosis.findings
    assert ("added_mass", "") in {(alias.effect, alias.target) for alias in one.set}


def test_a_delay_and_its_opposite_tolerance_are_no_filter_of_the_forces() -> None:
    """Forces that are smoothed otherwise than the movement: late by 17 ms and early by as much, to first order, are a
    second derivative, and no delay.
    """

    def smoothed(wrench, session, moving):
        return wrench - 0.017**2 * np.gradient(np.gradient(wrench, moving.time, axis=0), moving.time, axis=0)

    tolerances = replace(known(), sizes={**known().sizes, "time_delay": 0.005})
    found = inferred(body(), windows(3, trials=2, hidden=smoothed), tolerances=tolerances, effects=("time_delay",))
    (delay,) = (one.effect for one in found.search.causes if one.names == ("time_delay", ""))
    one = hypothesis(found.search, (NamedCause(delay, np.array([0.03]), np.empty((0, 0))),))
    (none,) = (h for h in found.posterior.hypotheses if not h.causes)
    assert one.log_posterior < none.log_posterior
    assert abs(one.causes[0].theta[0]) < 0.003
    np.testing.assert_array_equal(one.whole(one.causes[0]), one.causes[0].theta)
