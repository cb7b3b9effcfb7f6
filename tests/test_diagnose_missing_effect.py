"""The culprit's effect is not in the family: no innocent is named in its place, and "nothing wrong" is not said."""

import numpy as np
from diagnosed_sessions import about_plate, body, gain, known, windows
from inferred_sessions import inferred

from biodance.diagnosis.reasons import Reason


def shifted(local, session):
    """The plate lies 60 mm from where the file has it, towards +x of the laboratory."""
    local[:, 3:] -= np.cross([0.06, 0.0, 0.0], local[:, :3])
    return local


def test_several_crosstalks_are_a_plate_that_lies_elsewhere() -> None:
    some = windows(1, trials=2, hidden=about_plate(shifted))
    one = inferred(body(), some, tolerances=known(), effects=("plate_crosstalk",)).diagnosis
    assert (one.verdict, one.findings) == ("unexplained", ())
    assert {f.effect for f in one.resembles} == {"plate_crosstalk"}
    assert len(one.resembles) > 1


def test_what_nobody_looks_for_does_not_hide_in_its_tolerance() -> None:
    """A gain of 5 % is 25 times what these plates have."""
    some = windows(1, trials=2, hidden=gain(0.05))
    one = inferred(body(), some, tolerances=known(), effects=("time_delay",)).diagnosis
    assert (one.verdict, one.findings) == ("unexplained", ())
    assert Reason.OUTSIDE_TOLERANCES in one.why
