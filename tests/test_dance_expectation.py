"""Expectation: the table before, the identification's own arithmetic after, never worse with more of the dance."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from small_dances import BODY

from biodance.body.human.human import human
from biodance.body.similarity import hoap3
from biodance.dance.cues import dance_instructions
from biodance.dance.dance import Dance
from biodance.dance.expectation import (
    JUDGED_RATE,
    Expectation,
    PerformanceScore,
    expected_spread,
    score_performance,
    typical_noise,
    typical_sizes,
)
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.splines import rest_to_rest
from biodance.dance.search.word_course import freer_dance
from biodance.dance.verify import DanceMetrics
from biodance.errors import BiodanceError
from biodance.identification.knowledge import segment_quantities
from biodance.identification.mismatch import mismatch, temper
from biodance.identification.posterior import find_posterior
from biodance.identification.statistics import Fit, statistics
from biodance.motion.dynamics import predict_wrench, regressor
from biodance.pipeline.dance import DanceResult, before_cues
from biodance.records import Motion, Subject
from biodance.report.dance import dance_document
from biodance.uncertainty.caution import widened_prior

ADULT = human(Subject(65.0, 1.75, "F", 33.0))
CHAIN = Chain(ADULT)


@pytest.fixture(scope="module")
def motion() -> Motion:
    """Four random postures, 2 s to each."""
    rng = np.random.default_rng(4)
    x = np.zeros((4, CHAIN.size))
    x[:, ROOT:] = rng.uniform(ADULT.limits.lower, ADULT.limits.upper, (4, 23)) * 0.7
    x[:, 2] = 0.9
    basis = rest_to_rest(2.0, via=0, rate=JUDGED_RATE)
    parts = [
        np.concatenate([m[:-1] @ x[k : k + 2] for k in range(3)])
        for m in (basis.position, basis.velocity, basis.acceleration)
    ]
    return CHAIN.motion(np.arange(75) / JUDGED_RATE, *parts)


def test_before_the_dance_stands_the_table_and_more_dance_is_never_worse(motion: Motion) -> None:
    found = expected_spread(ADULT, motion, np.array([2.0, 4.0, 6.0]))
    prior = widened_prior(ADULT.sip)
    np.testing.assert_allclose(found.mass[0], np.sqrt(np.diag(prior.covariance)[::10]), rtol=1e-9)
    assert found.share[0].max() < 1e-12
    for values in (found.mass, found.com, found.inertia):
        assert values.shape == (4, 12)
        assert (np.diff(values, axis=0) <= 1e-10).all()
        assert (values[-1] < values[0]).all()
    assert (np.diff(found.share, axis=0) >= -1e-10).all()
    assert found.share.max() < 1


def test_the_end_is_what_identification_would_say_of_data_that_agree_with_the_table(motion: Motion) -> None:
    wrench = predict_wrench(ADULT, motion)
    noise = typical_noise(wrench)
    fit = Fit("all", motion, wrench, motion.time < 6.0 - 1e-9)
    data = statistics(ADULT, (fit,), noise).information(noise)
    posterior = find_posterior(temper(data, mismatch(ADULT, (fit,), noise), typical_sizes()), widened_prior(ADULT.sip))
    found = expected_spread(ADULT, motion, np.array([6.0]))
    for i in range(12):
        cut = slice(10 * i, 10 * i + 10)
        _, slope = segment_quantities(posterior.prior.phi[cut])
        variance = np.diag(slope @ posterior.covariance[cut, cut] @ slope.T)
        assert found.mass[1, i] == pytest.approx(np.sqrt(variance[0]), rel=1e-6)
        assert found.com[1, i] == pytest.approx(np.sqrt(variance[1:4].mean()), rel=1e-6)
    np.testing.assert_allclose(posterior.mean, widened_prior(ADULT.sip).phi, atol=1e-6)


# ---- What a dance that can be followed costs, and the sentences that say what it cannot teach

PLAN = Plan("x", (("parallel", 4),), hold=1.0, instructions=3.0, simplicity=1.0, wide=1.35, gentle=True)


def expected(mass: float, com: float) -> Expectation:
    told = [np.array([np.full(12, before), np.full(12, after)]) for before, after in ((1.0, mass), (0.02, com))]
    told[0][1, 3] = 0.99
    return Expectation(BODY.segments, np.array([0.0, 60.0]), *told, told[1], np.zeros((2, 12)))


def test_freely_chosen_postures_are_of_the_same_number_and_ask_more_at_once() -> None:
    free = freer_dance(BODY, PLAN, seed=1)
    assert free.counted.sum() == 4
    assert max(map(len, dance_instructions(free)[1:])) > PLAN.instructions


def test_what_came_of_an_emphasis_is_said_and_why_it_is_no_more() -> None:
    """The table takes the masses of both forearms for alike, so that what one tells holds of the other."""
    plan = replace(PLAN, weights=(("left_forearm_hand", 1.0),), other_weight=0.0)
    result = DanceResult(BODY, plan, None, (), None, expected(0.5, 0.010), "", (), 1.0)
    (said,) = result.emphasis
    assert "Emphasis on the left forearm with hand: its mass becomes known to 0.50 kg (table: 1.00)" in said
    assert "sides are alike (correlation in the table 0.80)" in said
    assert replace(result, plan=PLAN).emphasis == ()
    told = result.expectation
    assert told is not None
    mass = told.mass.copy()
    mass[-1, BODY.segment_index("left_forearm_hand")] = 0.3
    (more,) = replace(result, expectation=replace(told, mass=mass)).emphasis
    assert "alike" not in more


def test_the_price_and_what_cannot_be_learned_are_said() -> None:
    free = freer_dance(BODY, replace(PLAN, blocks=(("parallel", 2),)))
    poor = DanceMetrics(300.0, 65.0, np.ones(1), 65.0, ("left_foot",), ())
    result = DanceResult(BODY, PLAN, free, (), poor, expected(0.5, 0.010), "", (), 1.0, freely=expected(0.4, 0.008))
    price = dance_document(result)["simplicity_price"]
    assert price["mass_kg"]["with"] > price["mass_kg"]["without"]
    assert price["com_m"] == {"with": 0.010, "without": 0.008}
    assert "chosen freely" in result.price
    assert result.price not in before_cues(result)  # which the person reads who dances
    (warning,) = result.warnings
    assert "4.6 times its bound" in warning
    assert "left foot" in warning
    assert f"It cannot teach the mass of {BODY.segments[3].replace('_', ' ')}" in warning
    near = replace(result, account=replace(poor, static=180.0))
    assert near.warnings == ()
    assert not any("criterion" in sentence for sentence in before_cues(result))


# ---- How well a dance was danced

JOINTS = (
    "left_shoulder_flexion",
    "right_shoulder_flexion",
    "trunk_flexion",
    "left_elbow_flexion",
    "right_elbow_flexion",
)


@pytest.fixture(scope="module")
def dance() -> Dance:
    """Return ten moves on both feet: every joint of `JOINTS` goes out and comes back in turn."""
    from small_dances import small_dance

    stand = np.array(small_dance().postures[0])
    rows = [stand]
    for joint, angle in zip(JOINTS, (1.5, 1.5, 0.5, 1.5, 1.5), strict=True):
        out = stand.copy()
        out[6 + BODY.joint_index(joint)] += angle
        rows += [out, stand]
    x = np.array(rows)
    feet = small_dance().stances[0]
    via = x[:-1, None] + np.array([[0.21], [0.79]]) * np.diff(x, axis=0)[:, None]
    count = len(x)
    return Dance(
        "test", BODY, x, (feet,) * count, np.full(count, 0.5), via, np.full(count - 1, 1.0), (feet,) * (count - 1), 0
    )


def danced(dance: Dance, *left_out: str) -> Motion:
    """Return the motion of somebody who keeps some joints still."""
    rows = np.array(dance.postures)
    via = np.array(dance.via)
    for joint in left_out:
        column = 6 + BODY.joint_index(joint)
        rows[:, column], via[:, :, column] = rows[0, column], rows[0, column]
    return replace(dance, postures=rows, via=via).motion(100.0)


def scored(dance: Dance, motion: Motion) -> PerformanceScore:
    return score_performance(dance, BODY, ((motion, np.ones(motion.time.size, dtype=bool)),))


def test_who_dances_as_planned_reaches_what_was_planned(dance: Dance) -> None:
    for row in scored(dance, dance.motion(100.0)).excitation:
        assert row.reached == pytest.approx(row.planned, abs=0.02)
        assert 0 <= row.planned <= 1


def test_what_was_not_danced_is_missing_and_proposed(dance: Dance) -> None:
    found = scored(dance, danced(dance, "left_shoulder_flexion", "left_elbow_flexion"))
    lost = {one.segment: one.planned - one.reached for one in found.excitation}
    assert max(lost, key=lost.__getitem__) in ("left_upper_arm", "left_forearm_hand")
    assert found.repeat[0] in (1, 2, 7, 8)  # the moves of the left shoulder and the left elbow
    assert len(found.repeat) == 3
    assert found.repetitions[0].gain > 0


def test_repeating_what_is_proposed_gains_more_than_others(dance: Dance) -> None:
    motion = danced(dance, "left_shoulder_flexion", "right_elbow_flexion")
    chosen = scored(dance, motion).repeat
    prior = widened_prior(BODY.sip).covariance
    scale = np.sqrt(np.where(np.diag(prior) > 0, np.diag(prior), 1.0))
    noise = np.array([2.0, 2.0, 4.0, 1.0, 1.0, 0.5])

    def gram(some: Motion) -> np.ndarray:
        W = regressor(BODY, some)[::8] / noise[:, None]
        return np.einsum("tij,tik->jk", W, W)

    moves = {k: gram(_part(dance.motion(100.0), k)) for k in range(1, 11)}
    base = gram(motion)

    def told(some: tuple[int, ...]) -> float:
        H = base + sum(moves[k] for k in some)
        root = np.linalg.cholesky(prior / np.outer(scale, scale) + 1e-10 * np.eye(len(prior)))
        inner = np.eye(len(prior)) + root.T @ (H * np.outer(scale, scale)) @ root
        return float(np.linalg.slogdet(inner)[1])

    every = [told(some) for some in combinations(range(1, 11), 3)]
    assert told(chosen) > np.quantile(every, 0.8)
    assert told(chosen) > np.mean(every)


def _part(motion: Motion, move: int) -> Motion:
    """Return one move: half a second of holding, one of moving, in turn."""
    rows = (motion.time >= 0.5 + 1.5 * (move - 1) - 1e-9) & (motion.time <= 1.5 * move + 1e-9)
    return Motion(motion.time[rows], motion.q[rows], motion.v[rows], motion.a[rows])


def test_a_dance_of_another_body_or_nothing_danced_is_refused(dance: Dance) -> None:
    motion = dance.motion(100.0)
    with pytest.raises(BiodanceError, match="other joints"):
        score_performance(dance, hoap3(), ((motion, np.ones(motion.time.size, dtype=bool)),))
    with pytest.raises(BiodanceError, match="nobody knows"):
        score_performance(dance, BODY, ((motion, np.zeros(motion.time.size, dtype=bool)),))
