"""The judge of a finished dance: what it samples, which limits it asks when, and what it calls broken, by hand."""

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pytest
from small_dances import BODY, small_dance, without_pictures

from biodance.cli import run
from biodance.dance.dance import Dance
from biodance.dance.expectation import expect
from biodance.dance.limits import CheckedMotion, Limit, Margin, Margins, Remaining, unconcerned
from biodance.dance.limits.balance import Balance
from biodance.dance.limits.joint_range import JointRange
from biodance.dance.performers import try_performers
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.splines import Phase, basis_at, rest_to_rest
from biodance.dance.problem.state import State
from biodance.dance.verify import _least, broken, dance_metrics, verify
from biodance.errors import BiodanceError
from biodance.pipeline.dance import DanceResult, not_safe
from biodance.report.dance import write_dance


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


# ---- Rest-to-rest splines


@pytest.mark.parametrize("via", [0, 1, 2, 4])
def test_passes_through_its_points_and_rests_at_the_ends(via: int) -> None:
    points = np.random.default_rng(via).normal(size=via + 2)
    at = basis_at(np.linspace(0, 2.0, via + 2), 2.0, via=via)
    np.testing.assert_allclose(at.position @ points, points, atol=1e-10)
    ends = basis_at(np.array([0.0, 2.0]), 2.0, via=via)
    np.testing.assert_allclose(ends.velocity @ points, 0, atol=1e-9)
    np.testing.assert_allclose(ends.acceleration @ points, 0, atol=1e-8)


def test_derivatives_agree_with_finite_differences() -> None:
    points, h = np.array([0.2, 1.0, -0.5, 0.3]), 1e-4
    t = np.linspace(0.1, 1.9, 40)
    here = basis_at(t, 2.0)
    before, after = basis_at(t - h, 2.0), basis_at(t + h, 2.0)
    np.testing.assert_allclose(here.velocity @ points, (after.position - before.position) @ points / (2 * h), atol=1e-5)
    np.testing.assert_allclose(
        here.acceleration @ points, (after.velocity - before.velocity) @ points / (2 * h), atol=1e-4
    )


def test_equal_points_do_not_move() -> None:
    basis = rest_to_rest(2.0)
    assert basis.time.size == 101
    np.testing.assert_allclose(basis.position @ np.full(4, 0.7), 0.7)
    np.testing.assert_allclose(basis.velocity @ np.full(4, 0.7), 0, atol=1e-12)


def test_no_samples_is_refused() -> None:
    with pytest.raises(BiodanceError, match="no samples"):
        rest_to_rest(0.0)


# ---- A dance that imprecise people cannot dance safely

LEADING = {"cues.md", "cues.html", "dance.c3d"}
SHORT = Margin("self_collision_of_performers", -0.04, 1.0, "m", "left_forearm_hand - left_thigh")
PLAN = Plan("one_segment", (("parallel", 2),), hold=1.0, instructions=4.0)
WHERE = "4.0 cm of the room between arms, legs and trunk that is needed are missing at 1 s"


@pytest.fixture(scope="module")
def result() -> DanceResult:
    dance = replace(small_dance(), unsafe=(SHORT,))
    return DanceResult(BODY, PLAN, dance, (SHORT,), dance_metrics(dance, PLAN), expect(dance), "", (), 1.0)


def test_the_dance_on_disk_knows_that_it_is_not_safe(result: DanceResult, tmp_path: Path) -> None:
    assert result.dance is not None
    result.dance.save(tmp_path / "dance.npz")
    assert Dance.load(tmp_path / "dance.npz").unsafe == (SHORT,)


def test_somebody_must_act_where_it_is_not_safe_or_a_limit_was_widened_and_not_for_what_is_left_out(
    result: DanceResult,
) -> None:
    assert not result.settled
    safe = replace(result, margins=(), notes=("Left out: lean to the left.",))
    assert safe.settled
    assert not replace(safe, widened=True).settled
    assert not replace(safe, dance=None).settled


def test_nothing_that_leads_is_written_of_it(result: DanceResult, tmp_path: Path) -> None:
    with without_pictures():
        found = write_dance(result, tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert not LEADING & names
    assert {"dance.npz", "results.json", "margins.md"} <= names
    assert WHERE in found["warnings"][0]


def test_despite_that_it_heads_the_cards_and_each_of_them(result: DanceResult, tmp_path: Path) -> None:
    with without_pictures():
        write_dance(result, tmp_path, despite=True)
    assert {path.name for path in tmp_path.iterdir()} >= LEADING
    cards = (tmp_path / "cues.html").read_text()
    body = cards[cards.index("<h1>") :]
    assert body.index("NOT SAFE when imprecise: " + WHERE) < body.index("postures")
    assert body.count("NOT SAFE when imprecise</p>") == len(small_dance().stances)
    text = (tmp_path / "cues.md").read_text()
    assert text.index("NOT SAFE") < text.index("**1.**")


def test_no_page_leads_through_it_unless_somebody_says_so(
    result: DanceResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert result.dance is not None
    result.dance.save(tmp_path / "dance.npz")
    words = ["feedback", str(tmp_path / "dance.npz"), "--out", str(tmp_path / "page.html")]
    assert run(words) == 2
    said = capsys.readouterr().err
    assert "NOT SAFE" in said
    assert "--despite" in said
    assert not (tmp_path / "page.html").exists()
    assert run([*words, "--despite"]) == 0
    page = (tmp_path / "page.html").read_text()
    assert page.index(WHERE) < page.index("Press Start")


def test_a_safe_dance_says_nothing(result: DanceResult, tmp_path: Path) -> None:
    assert not_safe(small_dance()) == ()
    safe = replace(result, dance=small_dance(), margins=())
    with without_pictures():
        write_dance(safe, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} >= LEADING
    assert all("NOT SAFE" not in (tmp_path / name).read_text() for name in ("cues.md", "cues.html"))


def test_what_performers_lack_becomes_what_is_not_safe(monkeypatch: pytest.MonkeyPatch) -> None:
    """As much less is left as more is asked; less than nothing is not safe, and where it is, is said."""
    monkeypatch.setattr("biodance.dance.performers._SWAYS", 0.02)
    limits = ((Balance(room=room),) for room in (0.015, 0.1))
    usual, strict = (try_performers(small_dance(), some, who=range(3)) for some in limits)
    (left,), (lacking,) = usual.margins, strict.margins
    assert left.limit == lacking.limit == "balance_of_performers"
    assert left.worst - lacking.worst == pytest.approx(0.085, abs=1e-12)
    assert (usual.safe, broken(usual.margins)) == (True, ())
    assert (strict.safe, broken(strict.margins)) == (False, (lacking,))
    assert (lacking.what, lacking.unit, lacking.where_s) == ("parallel", "m", 1.0)
    assert (strict.bad, strict.failed) == (((1, "balance"),), (1, 2))
