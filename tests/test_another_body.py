"""A body that moves otherwise than where tolerances were learned: why what it leaves of the forces may be its own."""

from diagnosed_sessions import body

from biodance.diagnosis.reasons import Reason
from biodance.pipeline.unmodelled_joints import unmodelled_joints


def test_why_what_a_body_leaves_may_be_its_own() -> None:
    held = body().holding({"right_elbow", "left_elbow"}, body().neutral)
    assert unmodelled_joints(body(), ()) == {}
    assert unmodelled_joints(body(), ("wrists",)) == {Reason.UNDESCRIBED_JOINTS: ("wrists",)}
    assert unmodelled_joints(held, ()) == {Reason.UNSEEN_JOINTS: ("right elbow", "left elbow")}
    assert unmodelled_joints(held, ("wrists",)) == {Reason.UNSEEN_JOINTS: ("right elbow", "left elbow")}
