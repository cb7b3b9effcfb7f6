"""A body that moves otherwise than where tolerances were learned: no cause is taken from its simulation."""

import pytest
from diagnosed_sessions import body, gain, known, windows
from inferred_sessions import BARE, SILENT

from biodance.diagnosis.reasons import Reason
from biodance.effects import causes
from biodance.inference.session import judge, see
from biodance.pipeline.diagnosis import unmodelled_joints


def test_a_body_as_usual_has_none() -> None:
    assert unmodelled_joints(body(), ()) == {}


def test_joints_that_no_marker_shows_and_joints_beside_the_usual_ones_are_told() -> None:
    held = body().holding({"right_elbow", "left_elbow"}, body().neutral)
    assert unmodelled_joints(held, ("wrists",)) == {Reason.UNSEEN_JOINTS: ("right elbow", "left elbow")}
    assert unmodelled_joints(body(), ("neck",)) == {Reason.UNDESCRIBED_JOINTS: ("neck",)}


@pytest.mark.parametrize("simulate", [True, False])
def test_without_simulation_the_forces_name_nothing(simulate: bool) -> None:
    """A plate that shows 6 % too much: what the body leaves is told, and no cause."""
    asked = causes(("plate_gain", "time_delay"))
    seen = see(body(), windows(1, trials=2, hidden=gain(0.06)), known(), asked, None)
    one = judge(seen, SILENT, known(), asked, BARE, simulate=simulate).diagnosis
    assert [finding.effect for finding in one.findings] == (["plate_gain"] if simulate else [])
    assert one.adequacy
