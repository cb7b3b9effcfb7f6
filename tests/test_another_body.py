"""A body that moves otherwise than where tolerances were learned is told no name while anything is left."""

from dataclasses import replace

import pytest
from diagnosed_sessions import about_plate, body, known, windows
from human_cases import with_tilted

from biodance.body.body import Body
from biodance.diagnosis.diagnosis import Verdict
from biodance.diagnosis.engine import Examined, diagnose_trials
from biodance.diagnosis.reasons import Reason
from biodance.pipeline.another_body import beside_another_body, without_unplaced_markers
from biodance.pipeline.diagnosis import _measured


def gained(local, session):
    """Return what a plate reads that shows 6 % too much."""
    local[:, 2] *= 1.06
    return local


@pytest.fixture(scope="module")
def examined() -> Examined:
    some = windows(1, trials=2, hidden=about_plate(gained))
    one = diagnose_trials(body(), some, tolerances=known(), effects=("plate_gain", "time_delay"))
    assert [finding.effect for finding in one.diagnosis.findings] == ["plate_gain"]
    return one


def without_arms() -> Body:
    """Return the body with elbows that no marker shows and that are held."""
    return body().holding({"right_elbow", "left_elbow"}, body().neutral)


@pytest.mark.parametrize(
    ("verdict", "joints", "arms", "doubted"),
    [
        ("named, incomplete", (), False, True),
        ("named, incomplete", ("wrists",), True, True),
        ("named, incomplete", (), True, False),
        ("named, complete", (), False, False),
    ],
)
def test_a_name_beside_what_is_left_of_another_body_is_only_resembled(
    examined: Examined, verdict: Verdict, joints: tuple[str, ...], arms: bool, doubted: bool
) -> None:
    before = replace(examined, diagnosis=replace(examined.diagnosis, verdict=verdict))
    one = beside_another_body(before, body() if arms else without_arms(), joints).diagnosis
    assert one.doubted is doubted
    assert ([f.effect for f in one.findings], [f.effect for f in one.resembles]) == (
        ([], ["plate_gain"]) if doubted else (["plate_gain"], [])
    )


@pytest.mark.parametrize(
    ("reasons", "heard"),
    [
        ((), True),
        ((Reason.UNDESCRIBED_JOINTS,), True),
        ((Reason.ONLY_STANDING,), False),
        ((Reason.TOLERANCES_DO_NOT_HOLD,), False),
    ],
)
def test_a_movement_that_was_not_looked_through_or_believed_measures_no_weight(
    examined: Examined, reasons: tuple[Reason, ...], heard: bool
) -> None:
    measured = _measured(examined.naming, reasons)
    assert (("plate_gain", "Fz") in measured) is heard
    assert not heard or measured["plate_gain", "Fz"].size == pytest.approx(0.06, abs=0.015)


def resembled(examined: Examined, index: int) -> Examined:
    """Stand in for the engine's own: take a name back without fitting anything again."""
    one = examined.diagnosis
    gone, rest = one.findings[index], (*one.findings[:index], *one.findings[index + 1 :])
    return replace(examined, diagnosis=replace(one, findings=rest, resembles=(*one.resembles, gone)))


@pytest.mark.parametrize(("joint", "named"), [("left_elbow", False), ("right_elbow", True), ("left_knee", True)])
def test_no_marker_moved_since_a_static_trial_that_contradicts_itself_beside_it(
    examined: Examined, monkeypatch: pytest.MonkeyPatch, joint: str, named: bool
) -> None:
    """Wrists whose labels are exchanged in all trials, which nobody looks for, leave the elbow off its axes."""
    monkeypatch.setattr("biodance.pipeline.another_body.without_name", resembled)
    (gain,) = examined.diagnosis.findings
    wrist = replace(gain, effect="marker_misplaced", target="LWRA")
    before = replace(examined, diagnosis=replace(examined.diagnosis, findings=(gain, wrist)))
    one = without_unplaced_markers(before, with_tilted(body(), joint, 27.0)).diagnosis
    assert (one.findings, one.resembles) == (((gain, wrist), ()) if named else ((gain,), (wrist,)))
