"""What is only resembled is no name and explains nothing: what then speaks for a fault must be left in the forces."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import about_plate, body, known, windows
from scipy.interpolate import make_interp_spline

from biodance.diagnosis import engine
from biodance.diagnosis.adequacy import LIMIT, largest_z
from biodance.diagnosis.doubt import may_not_matter
from biodance.diagnosis.engine import diagnose_trials
from biodance.diagnosis.model import NamedCause
from biodance.diagnosis.reasons import Reason
from biodance.effects import effects
from biodance.effects.time_delay import TimeDelay
from biodance.uncertainty.tolerances import shipped

family = effects()


def late(seconds: float):
    """Return a hiding of forces that come late."""

    def hidden(wrench, session, moving):
        return make_interp_spline(moving.time, wrench, k=5)(np.clip(moving.time - seconds, 0, None))

    return hidden


def delayed(seconds: float, *, error: float):
    """Diagnose forces that come late, where the size of a delay errs by a share of itself."""
    some = windows(1, trials=2, hidden=late(seconds))
    tolerances = replace(known(), accuracy={"time_delay": error})
    return diagnose_trials(body(), some, tolerances=tolerances, effects=("time_delay",)).diagnosis


@pytest.mark.parametrize(
    ("name", "theta", "small"),
    [
        ("trunk_joint", (0.0986, -0.0577), True),  # drawn laboratory 68, without fault
        ("trunk_joint", (0.119, -0.0802), False),  # own laboratory, 0.1755 rad hidden
        ("trunk_joint", (0.298, -0.293), False),  # independent laboratory, 10 degrees hidden
        ("plate_gain", (0.0053,), True),
        ("plate_gain", (0.0056,), False),
    ],
)
def test_a_size_matters_only_if_it_does_with_the_error_of_its_model(name: str, theta, small: bool) -> None:
    """A trunk joint errs by 51 % (0.05 rad matter), a gain by 4.1 % (0.005)."""
    one = NamedCause(family[name], np.array(theta), np.eye(len(theta)))
    assert may_not_matter(one, shipped()) == small


def test_what_is_left_without_a_resembled_cause_is_what_alarms() -> None:
    """5 ms are found however wrong delays are; if they may be 2.3 ms, of which 3 matter, the bands still show them."""
    named, like = (delayed(0.005, error=error) for error in (0.05, 0.6))
    assert (named.verdict, [one.effect for one in named.findings]) == ("named, complete", ["time_delay"])
    assert (like.verdict, like.findings) == ("unexplained", ())
    assert [one.effect for one in like.resembles] == ["time_delay"]
    assert Reason.WITHOUT_RESEMBLED in like.reasons
    assert largest_z(like.adequacy) > LIMIT > largest_z(named.adequacy)


def test_a_resembled_cause_alone_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """0.7 ms, where 0.3 would matter and somebody would feel them."""
    monkeypatch.setattr(TimeDelay, "parameters", (replace(TimeDelay.parameters[0], least=0.0003),))
    monkeypatch.setattr(engine, "changes_wrench", lambda found, cause: True)
    assert delayed(0.0007, error=0.05).verdict == "named, complete"
    like = delayed(0.0007, error=1.5)
    assert (like.verdict, len(like.resembles)) == ("unexplained", 1)
    assert largest_z(like.adequacy) <= LIMIT
    assert Reason.WITHOUT_RESEMBLED in like.reasons
    assert Reason.OUTSIDE_TOLERANCES not in like.reasons


@pytest.mark.parametrize(("leak", "far"), [(0.004, False), (0.014, True)])
def test_a_tolerance_is_torn_beyond_what_a_louder_laboratory_has(leak: float, far: bool) -> None:
    """A leak of the load that is only resembled as a zero, of which 0.3 N are usual: 2.7 N could be those of another
    laboratory, 9.6 N could not.
    """

    def leaking(local, session):
        local[:, 0] += leak * local[:, 2]
        return local

    some = windows(1, hidden=about_plate(leaking))
    one = diagnose_trials(body(), some, tolerances=known(), effects=("plate_offset",)).diagnosis
    assert (one.verdict, one.findings) == ("unexplained", ())
    assert [like.effect for like in one.resembles] == ["plate_offset"]
    assert {Reason.WITHOUT_RESEMBLED, Reason.OUTSIDE_TOLERANCES} <= set(one.reasons)
    assert (Reason.OUTSIDE_EVERY_LABORATORY in one.reasons) == far
