"""How well a dance was danced: what was not danced is missing, and repeating what is proposed gains more than chance.

What a repetition gains is judged here by other means: white noise, no disturbances, the determinant of the posterior.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from small_dances import BODY

from biodance.body.robot.hoap3 import hoap3
from biodance.dance.dance import Dance
from biodance.dance.scoring import PerformanceScore, score_performance
from biodance.errors import BiodanceError
from biodance.motion.dynamics import regressor
from biodance.records import Motion
from biodance.uncertainty.caution import widened_prior

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
