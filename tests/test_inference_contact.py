"""Contacts that come and go: what is touched pushes to one side and takes hold quickly, and is named with its force."""

import numpy as np
import pytest
from diagnosed_sessions import body, known, windows
from inferred_sessions import inferred

from biodance.diagnosis.accept import accept
from biodance.effects import Case
from biodance.inference.contact import one_sided, quick
from biodance.motion.kinematics import poses

CAUSES = (
    "plate_gain",
    "plate_offset",
    "plate_position",
    "plate_rotation",
    "time_delay",
    "body_mass",
    "added_mass",
    "plate_drift",
    "external_contact",
)


def test_a_touch_pushes_to_one_side_and_a_swell_does_not() -> None:
    touch = np.clip(np.sin(np.arange(40) / 3), 0, None)[:, None] * [0.0, 0.3, 1.0]
    swell = np.linspace(-1, 1, 40)[:, None] * [0.0, 0.3, 1.0]
    assert one_sided(touch)
    assert one_sided(-touch)
    assert not one_sided(swell)
    creeping = np.exp(-np.arange(25) / 4)[:, None] * [0.0, 0.3, 1.0]  # 1.6 s, at values 0.4 s apart
    held = (np.arange(25) % 10 < 4)[:, None] * [0.0, 0.3, 1.0]
    assert quick([held, held])
    assert not quick([swell, swell])
    assert not quick([creeping - np.median(creeping, axis=0), creeping])


def test_a_hand_that_comes_and_goes_is_named_with_its_force() -> None:
    one = body()
    index = one.segment_index("left_forearm_hand")
    low, high = one.boxes[index]
    palm = np.array([(low[0] + high[0]) / 2, low[1] + 0.08, (low[2] + high[2]) / 2])

    def touched(wrench, session, moving):
        point = poses(one, moving.q).points([index], palm[None])[:, 0]
        strength = 15.0 * (np.clip(1 - np.abs(moving.time - 5.0), 0, 1) + np.clip(1 - np.abs(moving.time - 9.0), 0, 1))
        force = strength[:, None] * np.array([0.0, 0.3, 1.0])
        return wrench - np.concatenate([force, np.cross(point, force)], axis=1)

    one_session = windows(1, hidden=touched)
    told = inferred(one, one_session, tolerances=known(), effects=CAUSES)
    assert [(f.effect, f.target) for f in told.diagnosis.findings] == [("external_contact", "left_forearm_hand")]
    assert told.diagnosis.verdict in ("named, complete", "named, incomplete")
    size = [p.value for p in told.diagnosis.findings[0].parameters]
    middle = 0.5 ** (
        1 / 3
    )  # of a force that rises and falls in proportion to time, half of the squares lie above this share of its peak
    np.testing.assert_allclose(size, middle * np.array([0.0, 4.5, 15.0]), atol=1.5)
    np.testing.assert_allclose(told.named[0].effect.place, [0.0, 0.08, 0.0], atol=0.03)
    window = one_session[0]
    case = Case(one, window.trial, window.motion, one.sip.phi, np.linspace(0, 0.25, window.motion.time.size))
    added = accept(case, told.named).trial.wrench.value - window.trial.wrench.value
    assert added[window.motion.time == 5.0, 2] == pytest.approx(15.0, abs=3.0)


def test_a_foot_that_touches_is_named_though_the_mean_of_a_trial_is_hidden() -> None:
    """What a foot lifts on average looks like the plate's zero and the body's weight: the rest tells."""
    one = body()
    index = one.segment_index("left_foot")
    low, high = one.boxes[index]
    ball = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])

    def touched(wrench, session, moving):
        point = poses(one, moving.q).points([index], ball[None])[:, 0]
        strength = np.where(np.abs(moving.time % 4.0 - 2.0) < 0.8, 6.0, 0.0)
        force = strength[:, None] * np.array([0.0, 0.3, 1.0])
        return wrench - np.concatenate([force, np.cross(point, force)], axis=1)

    diagnosis = inferred(one, windows(1, trials=2, hidden=touched), tolerances=known(), effects=CAUSES).diagnosis
    assert [(f.effect, f.target) for f in diagnosis.findings] == [("external_contact", "left_foot")]
    assert diagnosis.findings[0].parameters[2].value == pytest.approx(6.0, abs=1.5)
