"""Names beside a body that is more unlike the table than people are."""

import pytest
from diagnosed_sessions import body, delay, known, nothing, windows
from inferred_sessions import inferred

from biodance.diagnosis.reasons import Reason

CAUSES = ("time_delay", "plate_offset", "added_mass", "body_mass")


def test_a_delay_is_named_however_strange_the_body_is() -> None:
    one = inferred(body(), windows(1, hidden=delay, unlike=4.0), tolerances=known(), effects=CAUSES).diagnosis
    assert Reason.UNUSUAL_BODY in one.why
    (finding,) = one.findings
    (size,) = finding.parameters
    assert finding.effect == "time_delay"
    assert size.interval[0] < 0.02 < size.interval[1]


@pytest.mark.parametrize("unlike", [2.0, 4.0])
def test_a_strange_body_alone_is_no_cause(unlike: float) -> None:
    """Its scale grows with it: that the table does not hold for a person accuses nobody."""
    one = inferred(body(), windows(1, hidden=nothing, unlike=unlike), tolerances=known(), effects=CAUSES).diagnosis
    assert not one.findings
