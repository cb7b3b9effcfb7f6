"""What a name needs: movement, and a size that matters; what is left must matter, too."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosed_sessions import RATE, body, known, motion, offset, windows
from inferred_sessions import inferred

from biodance.diagnosis.consequence import LEAST_FORCE, LEAST_MOMENT, Adequacy, least, matters
from biodance.diagnosis.reasons import Reason
from biodance.effects import Case, effects
from biodance.motion.dynamics import predict_wrench
from biodance.records import Motion, Wrench
from biodance.uncertainty.tolerances import shipped, table_sizes, without_habits

FAST = ("plate_gain", "plate_offset", "plate_drift", "time_delay", "body_mass", "added_mass")


def standing_looks(shift: float):
    """Return quiet standing with ``shift`` N too much of Fx."""
    window = windows(1, trials=1)[0]
    moving, frames = motion(3), int(4 * RATE)
    zero = np.zeros((frames, moving.v.shape[1]))
    still = Motion(np.arange(frames) / RATE, np.repeat(moving.q[:1], frames, axis=0), zero, zero)
    value = predict_wrench(body(), still).value + shift * np.eye(6)[0]
    plate = replace(window.trial.plates[0], wrench=Wrench(still.time, value))
    quiet = replace(window.trial, role="fit", plates=(plate,))
    return (replace(window, trial=quiet, motion=still, use=np.ones(frames, dtype=bool)),)


def test_standing_alone_names_nothing_however_large() -> None:
    moving = inferred(body(), windows(1, hidden=offset(40.0)), tolerances=known(), effects=FAST)
    assert [one.effect for one in moving.diagnosis.findings] == ["plate_offset"]
    quiet = inferred(body(), standing_looks(40.0), tolerances=known(), effects=FAST).diagnosis
    assert (quiet.findings, quiet.resembles) == ((), ())
    assert Reason.ONLY_STANDING in quiet.why


def test_only_what_is_physics_keeps_a_mean_and_the_rest_is_spread() -> None:
    one = replace(known(), sizes={"wobbling_mass thigh": 3.0, "time_delay": 0.3}, means={
        "wobbling_mass left_thigh mass": -4.0, "wobbling_mass right_thigh mass": -4.0, "time_delay delay": 0.4,
        "sag thigh": -3e-5, "clock_drift stretch": 0.1,
    })  # fmt: skip
    free = without_habits(one)
    assert dict(free.means) == {"sag thigh": -3e-5}
    assert dict(free.sizes) == pytest.approx({"wobbling_mass thigh": 5.0, "time_delay": 0.5})
    assert all(key.startswith("sag ") for key in shipped().means)
    assert all(shipped().sizes[key] >= size for key, size in table_sizes().items())


def test_a_habit_that_the_markers_show_widens_the_other_rows_alone() -> None:
    sizes = {"head_joint": 0.02, "shown head_joint": 0.01}
    free = without_habits(replace(known(), sizes=sizes, means={"head_joint angle": 0.04, "head_joint beyond": -0.03}))
    assert dict(free.sizes) == pytest.approx({**sizes, "habit head_joint": np.sqrt((0.04**2 + 0.03**2) / 2)})


def test_a_poor_model_resembles_and_is_no_finding() -> None:
    def knocked(wrench, session, moving):
        knock = 40.0 * np.sin(2 * np.pi * 4.0 * moving.time) * (np.abs(moving.time - 6.0) < 1.0)
        return offset(12.0)(wrench + knock[:, None] * (np.arange(6) == 1), session, moving)

    one = inferred(body(), windows(1, hidden=knocked), tolerances=known(), effects=FAST).diagnosis
    assert one.verdict == "unexplained"
    assert one.findings == ()
    assert "plate_offset" in {finding.effect for finding in one.resembles}


@pytest.mark.parametrize(
    ("name", "target", "small", "large"),
    [
        ("time_delay", "", [0.0029], [-0.0031]),
        ("plate_drift", "Fx", [1.9], [2.1]),
        ("plate_drift", "Mx", [-0.99], [1.01]),
        ("plate_crosstalk", "Fz->My", [0.0009], [0.0011]),
        ("plate_crosstalk", "Fz->Fx", [0.0019], [0.0021]),
        ("external_contact", "left_foot", [1.1, 1.1, 1.1], [1.2, 1.2, 1.2]),
    ],
)
def test_a_cause_matters_from_its_least_size_on(name, target, small, large) -> None:
    window = windows(1, trials=1)[0]
    case = Case(body(), window.trial, window.motion, body().sip.phi, np.linspace(0, 1, window.motion.time.size))
    one = effects()[name].at(target, case)
    assert not matters(one, np.array(small))
    assert matters(one, np.array(large))


@pytest.mark.parametrize("joint", ["trunk_joint", "head_joint", "shoulder_girdle"])
def test_a_joint_that_the_markers_do_not_show_moving_does_not_matter(joint) -> None:
    assert not matters(effects()[joint], np.array([0.0, 0.3]))
    assert matters(effects()[joint], np.array([0.25, 0.0]))


def test_a_cause_within_any_tolerance_is_told_but_no_finding() -> None:
    one = inferred(body(), windows(1, hidden=offset(1.9)), tolerances=replace(known(), sizes={}), effects=FAST)
    assert one.diagnosis.verdict == "nothing wrong"
    assert one.diagnosis.findings == ()
    assert [finding.effect for finding in one.diagnosis.tolerated] == ["plate_offset"]
    limit = next(row for row in one.diagnosis.limits if (row.effect, row.target) == ("plate_offset", "Fx"))
    assert limit.limit >= least(effects()["plate_offset"].at("Fx", one.search.rows.problem.cases[0]))["offset"]


def test_an_alarm_must_matter_physically() -> None:
    small, large = (Adequacy("Mx", (0.04, 0.3), 12.0, size=size) for size in (0.9 * LEAST_MOMENT, 1.1 * LEAST_MOMENT))
    force = Adequacy("Fz", (0.04, 0.3), 5.0, size=1.1 * LEAST_FORCE)
    assert [row.matters for row in (small, large, force)] == [False, True, True]


@pytest.mark.parametrize(("channel", "zero"), [("Fz", 2.0), ("Mx", 1.0)])
def test_the_mean_of_a_trial_must_matter_as_a_zero_of_the_plate_must(channel: str, zero: float) -> None:
    small, large = (Adequacy(channel, (0.0, 0.04), 7.0, size=size) for size in (0.9 * zero, 1.1 * zero))
    assert (small.matters, large.matters) == (False, True)


def test_the_size_of_what_is_left_is_in_newton() -> None:
    """A beat of 6 N amplitude, 4.2 N RMS, at 1.5 Hz that nothing describes is left in its band, in N."""

    def beaten(wrench, session, moving):
        return wrench + 6.0 * np.sin(2 * np.pi * 1.5 * moving.time)[:, None] * (np.arange(6) == 0)

    found = inferred(body(), windows(1, hidden=beaten), tolerances=known(), effects=("plate_offset",)).diagnosis
    row = next(one for one in found.adequacy if (one.channel, one.band_hz) == ("Fx", (1.0, 2.5)))
    assert row.size == pytest.approx(6.0 / np.sqrt(2), rel=0.15)
    assert row.unit == "N"
