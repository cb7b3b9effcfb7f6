"""What was put right in the body before any force was looked at is named: a joint elsewhere, a marker that moved."""

from dataclasses import replace

import numpy as np
import pytest
from human_cases import human_case, with_tilted

from biodance.body.changes import move_marker
from biodance.body.parts import JointError
from biodance.diagnosis.consequence import Adequacy
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Finding
from biodance.diagnosis.repairs import with_repairs
from biodance.uncertainty.tolerances import shipped

CLEAN = Diagnosis(True, ())
HIP = JointError("right_hip", 0.012, 0.0, contradicted=True, moved=0.066)


def named(error: JointError, diagnosis: Diagnosis = CLEAN, chosen: tuple[str, ...] | None = None) -> Diagnosis:
    """Return the diagnosis of a body with one joint that was put right; RKNE lies 50 mm ahead of its place in it."""
    case = human_case(200)
    body = move_marker(case.body, "RKNE", np.array([-0.05, 0.0, 0.0]))
    return with_repairs(diagnosis, (replace(case, body=replace(body, joint_errors=(error,))),), shipped(), chosen)


def test_a_joint_that_the_movement_puts_elsewhere_is_named_with_its_look_alikes() -> None:
    found = named(HIP)
    (one,) = found.findings
    low, high = one.parameters[0].interval
    assert (found.verdict, one.effect, one.target) == ("named, complete", "joint_centre", "right_hip")
    assert low < 0.06 < 0.066 < high
    assert low > 0.01
    assert ("segment_length", "right_thigh") in {(other.effect, other.target) for other in one.set}


def test_a_knee_elsewhere_may_be_the_marker_that_places_it() -> None:
    (one,) = named(HIP._replace(joint="right_knee")).findings
    assert {("marker_misplaced", "RKNE"), ("joint_centre", "right_hip")} <= {(o.effect, o.target) for o in one.set}
    assert "marker_misplaced" not in {other.effect for other in named(HIP).findings[0].set}


def test_it_is_not_complete_where_a_band_is_not_normal() -> None:
    loud = Adequacy("Fz", (0.04, 0.3), 3.4)
    assert named(HIP, replace(CLEAN, adequacy=(loud,))).verdict == "named, incomplete"
    assert named(HIP, replace(CLEAN, adequacy=(replace(loud, z=2.9),))).verdict == "named, complete"


def test_a_marker_that_moved_is_named_with_how_far() -> None:
    (one,) = named(JointError("right_knee", 0.007, 0.1, moved=0.04, spared="RKNE")).findings
    shift = np.array([p.value for p in one.parameters])
    assert (one.effect, one.target) == ("marker_misplaced", "RKNE")
    np.testing.assert_allclose(shift, [0.05, 0.0, 0.0], atol=0.012)


@pytest.mark.parametrize(("joint", "told"), [("right_knee", 0), ("right_ankle", 1), ("left_knee", 1)])
def test_no_marker_moved_beside_a_joint_that_stood_off_its_axes(joint: str, told: int) -> None:
    case, error = human_case(200), JointError("right_knee", 0.007, 0.1, moved=0.04, spared="RKNE")
    body = move_marker(case.body, "RKNE", np.array([-0.05, 0.0, 0.0]))
    doubtful = replace(case, body=with_tilted(replace(body, joint_errors=(error,)), joint, 41.0))
    assert len(with_repairs(CLEAN, (doubtful,), shipped()).findings) == told


@pytest.mark.parametrize("pair", ["RKNE/LKNE", "LWRA/LWRB"])
def test_nothing_moved_in_a_body_that_exchanged_labels_placed(pair: str) -> None:
    exchanged = Finding("labels_swapped", pair, (), (Alias("labels_swapped", pair, 30.0),), 1.0)
    told = replace(CLEAN, explained=False, findings=(exchanged,))
    assert named(JointError("right_knee", 0.007, 0.1, moved=0.04, spared="RKNE"), told) == told


@pytest.mark.parametrize(
    ("error", "diagnosis", "chosen"),
    [
        (JointError("right_knee", 0.007, 0.1, moved=0.15, spared="RKNE"), CLEAN, None),
        (JointError("right_hip", 0.012, 0.0, moved=0.02), CLEAN, None),
        (HIP._replace(reach=0.03, reach_sd=0.02), CLEAN, None),
        (HIP, replace(CLEAN, explained=False), None),
        (HIP, CLEAN, ("plate_gain", "marker_misplaced")),
    ],
    ids=[
        "wrong in the static trial, too",
        "within what the static trial knows",
        "its size is hardly known",
        "more is wrong",
        "not asked for",
    ],
)
def test_nothing_is_named_that_does_not_explain_it(error, diagnosis, chosen) -> None:
    assert named(error, diagnosis, chosen) == diagnosis


def test_no_marker_is_accused_beside_a_joint_that_a_named_girdle_carries() -> None:
    """The movement placed the shoulder on a trunk that was taken for stiff."""
    error = JointError("right_knee", 0.007, 0.1, moved=0.04, spared="RKNE")
    girdle = Finding("shoulder_girdle", "", (), (Alias("shoulder_girdle", "", 90.0),), 1.0)
    told = replace(CLEAN, explained=True, findings=(girdle,))
    assert len(named(error, told).findings) == 2
    assert named(error._replace(joint="right_shoulder"), told) == told
