"""The judge of a finished dance: what it samples, which limits it asks when, and what it calls broken, by hand."""

from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
from small_dances import BODY, small_dance

from biodance.dance.dance import Dance
from biodance.dance.limits import CheckedMotion, Limit, Margins, Remaining, unconcerned
from biodance.dance.limits.joint_range import JointRange
from biodance.dance.problem.splines import Phase
from biodance.dance.problem.state import State
from biodance.dance.verify import Margin, _least, broken, verify


@dataclass(frozen=True)
class Clock(Limit):
    """What is left is 2 s less the time: least at the end of what was judged."""

    name, unit, scale = "clock", "s", 1.0

    def margins(self, state: State) -> Margins:
        """No matter for the judge."""
        return unconcerned(state)

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return 2 s less the time, and beside it what is always kept."""
        time = motion.motion.time
        return Remaining(np.stack([np.full(time.size, 9.0), 2.0 - time], axis=1), ("patience", "time"))


class AtRest(Clock):
    """Of held postures alone."""

    name, in_motion = "at_rest", False


class InMotion(Clock):
    """Of moves alone, as friction and speed are."""

    name, at_rest = "in_motion", False


def test_a_limit_is_judged_at_its_worst_and_only_when_it_holds() -> None:
    """1 s of standing, 2 s of moving, 1 s held (whose single posture is judged at its start, 3 s)."""
    found = {one.limit: one for one in verify(BODY, small_dance(), (Clock(), AtRest(), InMotion()))}
    assert found["in_motion"] == Margin("in_motion", pytest.approx(-1.0), pytest.approx(3.0), "s", "time")
    assert found["clock"] == replace(found["in_motion"], limit="clock")
    assert found["at_rest"] == replace(found["in_motion"], limit="at_rest")
    before = {one.limit: one for one in verify(BODY, small_dance(), (AtRest(), InMotion()), part=slice(0, 2))}
    assert before["at_rest"].where_s == 0.0
    assert before["in_motion"].worst == pytest.approx(-1.0)


@pytest.mark.parametrize(("worst", "is_broken"), [(0.0, False), (1e-12, False), (-1e-6, True), (np.nan, True)])
def test_broken_is_what_is_negative_or_no_number(worst: float, is_broken: bool) -> None:
    margin = Margin("balance", worst, 0.0, "m")
    assert bool(broken((margin,))) == is_broken


def test_what_is_no_number_is_the_worst() -> None:
    some = [Margin("balance", worst, second, "m") for second, worst in enumerate((-0.5, np.nan, 0.1))]
    assert _least(some)[0].where_s == 1.0
    assert _least(some[::2])[0].worst == -0.5


@dataclass(frozen=True, eq=False)
class Leaping(Dance):
    """A dance whose moves have 0.01 rad, rad/s or rad/s² more at the left shoulder than its splines say."""

    leaps: str = "x"

    def state(self, phase: Phase, time: np.ndarray) -> State:
        """Return the state with the leap."""
        state = super().state(phase, time)
        now = {name: getattr(state, name).copy() for name in ("x", "v", "a")}
        if phase.kind == "move":
            now[self.leaps][:, 6 + BODY.joint_index("left_shoulder_adduction")] += 0.01
        return State(state.chain, state.stance, now["x"], now["v"], now["a"])


@pytest.mark.parametrize("leaps", ["x", "v", "a"])
def test_a_leap_between_two_phases_is_seen(leaps: str) -> None:
    dance = small_dance()
    (left,) = verify(BODY, dance, ())
    assert 0 < left.worst <= 1e-6
    (left,) = verify(BODY, Leaping(**{one.name: getattr(dance, one.name) for one in fields(dance)}, leaps=leaps), ())
    assert left.limit == "continuity"
    assert left.worst == pytest.approx(-0.01, abs=1e-5)
    assert left.where_s in (1.0, 3.0)


@dataclass(frozen=True, eq=False)
class Twitching(Dance):
    """A dance whose left elbow bends 1 rad too far back within the first, or the last, 8 ms of its move."""

    at_start: bool = True

    def state(self, phase: Phase, time: np.ndarray) -> State:
        """Return the state with the twitch."""
        state = super().state(phase, time)
        x, since = state.x.copy(), time - phase.start if self.at_start else phase.end - time
        if phase.kind == "move":
            x[(since > 0) & (since < 0.008), 6 + BODY.joint_index("left_elbow_flexion")] -= 1.0
        return State(state.chain, state.stance, x, state.v, state.a)


@pytest.mark.parametrize(("at_start", "where"), [(True, (1.0, 1.008)), (False, (2.992, 3.0))])
def test_what_happens_just_after_a_move_begins_or_before_it_ends_is_seen(at_start: bool, where: tuple) -> None:
    """A foot that has just left the ground, or comes back, is lowest between two of the instants 0.01 s apart."""
    dance, limit = small_dance(), JointRange()
    assert not broken(verify(BODY, dance, (limit,)))
    own = {one.name: getattr(dance, one.name) for one in fields(dance)}
    (found,) = broken(verify(BODY, Twitching(**own, at_start=at_start), (limit,)))
    assert found.what == "left_elbow_flexion"
    assert where[0] < found.where_s < where[1]
