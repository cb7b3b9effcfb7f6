"""The whole pipeline: a session that obeys the model exactly, and real sessions against what is known of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from perfect_recordings import SUBJECT, arm_swing, recorded

from biodance.body.human.human import human
from biodance.pipeline.attention import session_attention
from biodance.pipeline.session import examine
from biodance.records import Session, Wrench


@pytest.fixture(scope="module")
def perfect():
    """Return the result of a session without a static trial in which body, markers and plates agree exactly."""
    body = human(SUBJECT)
    stand = recorded(body, "standing", arm_swing(body, frames=150, angle=0.0))
    swing = recorded(body, "swing", arm_swing(body, frames=300, angle=1.0))
    return examine(Session(SUBJECT, (stand, swing), Path("/lab/S01")))


def test_a_body_that_is_true_follows_its_markers_and_needs_the_measured_wrench(perfect):
    inner = slice(30, -30)
    for trial in perfect.trials:
        assert [step.status for step in trial.steps] == ["done"] * len(trial.steps)
        assert trial.fit.total_max < 1e-4
        assert trial.comparison.used[inner].all()
    swing = perfect.trials[1].comparison
    difference = (swing.measured - swing.simulated)[inner]
    assert np.sqrt(np.mean(difference**2, axis=0)).max() < 0.2
    assert swing.correlation[[0, 2, 4]].min() > 0.98


def test_standing_still_the_centre_of_mass_is_over_the_centre_of_pressure(perfect):
    assert perfect.standing.trial == "standing"
    assert perfect.standing.mass == pytest.approx(62.0, abs=1e-3)
    assert abs(perfect.standing.com_ahead) < 1e-4
    assert abs(perfect.standing.com_left) < 1e-4
    np.testing.assert_allclose(perfect.standing.forward, [1, 0], atol=1e-6)
    assert all(check.inside for check in perfect.all_checks)


def test_without_a_static_trial_the_session_says_so(perfect):
    assert [step.name for step in perfect.steps if step.status == "refused"] == ["scale"]
    assert any(said.level != "note" for said in session_attention(perfect))


def test_a_heavier_load_on_the_plates_is_seen_in_mass_and_wrench():
    body = human(SUBJECT)
    stand = recorded(body, "standing", arm_swing(body, frames=150, angle=0.0))
    plate = stand.plates[0]
    loaded = replace(stand, plates=(replace(plate, wrench=Wrench(plate.wrench.time, 1.04 * plate.wrench.value)),))
    result = examine(Session(SUBJECT, (loaded,), Path("/lab/S01")))
    assert result.mass_difference == pytest.approx(4.0, abs=0.01)  # a force difference of 4 % is inside its limit of 5
    assert [check.what for check in result.all_checks if not check.inside] == ["mass on the plates against declared"]


def test_the_same_session_gives_the_same_numbers(perfect):
    again = examine(perfect.session)
    np.testing.assert_array_equal(again.trials[1].comparison.simulated, perfect.trials[1].comparison.simulated)
