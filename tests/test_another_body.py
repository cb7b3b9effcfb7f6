"""A body that moves otherwise than where tolerances were learned is told no name while anything is left."""

from dataclasses import replace

import pytest
from biodance.pipeline.another_body import beside_another_body
from diagnosed_sessions import about_plate, body, known, windows
from inferred_sessions import inferred

from biodance.body.body import Body
from biodance.diagnosis.diagnosis import Verdict
from biodance.inference.decision import Inferred


def gained(local, session):
    """Return what a plate reads that shows 6 % too much."""
    local[:, 2] *= 1.06
    return local


@pytest.fixture(scope="module")
def found() -> Inferred:
    some = windows(1, trials=2, hidden=about_plate(gained))
    one = inferred(body(), some, tolerances=known(), effects=("plate_gain", "time_delay"))
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
    found: Inferred, verdict: Verdict, joints: tuple[str, ...], arms: bool, doubted: bool
) -> None:
    before = replace(found, diagnosis=replace(found.diagnosis, verdict=verdict))
    one = beside_another_body(before, body() if arms else without_arms(), joints).diagnosis
    assert one.doubted is doubted
    assert ([f.effect for f in one.findings], [f.effect for f in one.resembles]) == (
        ([], ["plate_gain"]) if doubted else (["plate_gain"], [])
    )
