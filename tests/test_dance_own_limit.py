"""A limit that nobody planned for: one file in the folder, and it is kept, verified, listed and named where it forbids
a dance.
"""

import json
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from small_dances import SHORT_SEARCH, without_pictures

from biodance.body.human.human import human
from biodance.cli import run
from biodance.dance import limits
from biodance.dance.design import design
from biodance.dance.limits import NOTHING, Limit, family, limits_with, unconcerned
from biodance.dance.limits.friction import Friction
from biodance.dance.limits.ground_clearance import GroundClearance
from biodance.dance.problem.plan import Plan, read_plan
from biodance.dance.search import postures
from biodance.dance.verify import broken, verify
from biodance.errors import BiodanceError, UnknownName
from biodance.pipeline.front_dance import verify_dance
from biodance.records import Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
CEILING = '''"""No hand comes higher than the ceiling."""

from dataclasses import dataclass

import numpy as np

from biodance.dance.limits import CheckedMotion, Limit, Margins, Remaining, bounded
from biodance.dance.problem.shapes import palm
from biodance.dance.problem.state import State

SIDES = ("right", "left")


@dataclass(frozen=True)
class Ceiling(Limit):
    """``height`` m of the ceiling."""

    height: float = bounded(1.2, -1.0, 3.0, "m")
    name, unit, scale = "ceiling", "m", 0.05

    def margins(self, state: State) -> Margins:
        """Return the room over each palm, (T, 2) m."""
        palms = [palm(state.chain.body, side) for side in SIDES]
        place, slope = state.points([segment for segment, _ in palms], np.array([local for _, local in palms]))
        return Margins(self.height - place[:, :, 2], -slope[None, :, :, 2])

    def check(self, motion: CheckedMotion) -> Remaining:
        """Return the room over each palm, (T, 2) m."""
        palms = [palm(motion.body, side) for side in SIDES]
        place = motion.pose.points([segment for segment, _ in palms], np.array([local for _, local in palms]))
        return Remaining(self.height - place[:, :, 2], tuple(f"{side}_hand" for side in SIDES))


LIMIT = Ceiling
'''
PROTOCOL = 'name = "tiny"\nhold_s = 1.0\nfree = true\n[postures]\nparallel = 3\n[limits.friction]\nmu = 0.4\n'


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return a folder whose files are as if they lay in biodance/dance/limits."""
    more = tmp_path / "limits"
    more.mkdir()
    monkeypatch.setattr(limits, "__path__", [*limits.__path__, str(more)])
    before = set(sys.modules)
    yield more
    for name in set(sys.modules) - before:
        if name.startswith("biodance.dance.limits."):
            del sys.modules[name]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, sweeps in {**SHORT_SEARCH, "ATTEMPTS": 3}.items():
        monkeypatch.setattr(postures, name, sweeps)


def danced(tmp_path: Path, height: float) -> tuple[int, dict[str, object], Path]:
    protocol, out = tmp_path / "tiny.toml", tmp_path / "out"
    protocol.write_text(f"{PROTOCOL}[limits.ceiling]\nheight = {height}\n")
    words = ["--sex", "F", "--height", "1.75", "--mass", "65", "--protocol", str(protocol), "--out", str(out)]
    with without_pictures():
        code = run(["dance", *words])
    return code, json.loads((out / "results.json").read_text()), out


def test_one_file_alone_is_a_limit_that_the_dance_keeps_and_that_is_listed(folder: Path, tmp_path: Path) -> None:
    (folder / "_helper.py").write_text("ANGLE = 3\n")  # an underscore: no member
    (folder / "ceiling.py").write_text(CEILING)
    code, found, out = danced(tmp_path, 1.2)
    assert code == 0
    assert found["feasible"] is True
    assert "| ceiling |" in (out / "margins.md").read_text()
    margins = {margin["limit"]: margin for margin in found["margins"]}
    assert margins["ceiling"]["worst"] >= 0
    assert margins["ceiling"]["unit"] == "m"
    assert margins["ceiling"]["what"] in ("right_hand", "left_hand")


def test_an_impossible_one_is_named_in_the_refusal(folder: Path, tmp_path: Path) -> None:
    (folder / "ceiling.py").write_text(CEILING)
    code, found, _ = danced(tmp_path, -0.2)
    assert code == 1
    assert found["feasible"] is False
    assert "without the limit on ceiling of" in found["reason"]
    assert "both feet side by side" in found["reason"]


def test_a_stray_file_is_one_sentence(folder: Path) -> None:
    (folder / "notes.py").write_text("ANGLE = 3\n")
    with pytest.raises(BiodanceError, match=r"notes\.py: defines no LIMIT, so it is no limit of a dance"):
        family()


@dataclass(frozen=True)
class Quiet(Limit):
    """Nothing moves faster than ``most`` rad/s: an object from outside."""

    most: float = 0.8
    name, unit, scale, at_rest = "quiet", "rad/s", 0.5, False

    def margins(self, state):
        rate = state.v[:, 6:]
        slope = -np.sign(rate)[:, :, None] * np.eye(state.chain.size)[6:]
        return (
            limits.Margins(self.most - np.abs(rate), np.stack([0 * slope, slope])) if rate.any() else unconcerned(state)
        )

    def check(self, motion):
        rate = np.abs(motion.motion.v[:, 6:])
        return limits.Remaining(self.most - rate, motion.joints) if rate.any() else NOTHING


def test_an_object_is_kept_like_a_member_of_the_family(tmp_path: Path) -> None:
    plan = Plan("small", (("parallel", 2),), move=4.0, hold=1.0)
    with ThreadPoolExecutor(1) as workers:
        free, _ = design(BODY, plan, seed=1, workers=workers)
        dance, margins = design(BODY, plan, seed=1, workers=workers, limits=[Quiet(), Friction(mu=0.3)])
    told = {margin.limit: margin for margin in margins}
    assert told["quiet"].worst >= 0
    assert told["quiet"].what in {joint.name for joint in BODY.joints}
    asked = plan.with_limits([Quiet, Friction(mu=0.3)])
    assert broken(verify(BODY, dance, asked.limits)) == ()
    assert {margin.limit for margin in broken(verify(BODY, free, plan.with_limits([Quiet(most=0.1)]).limits))} == {
        "quiet"
    }
    (tmp_path / "small.toml").write_text("[postures]\nparallel = 2\n")
    told = verify_dance(free, tmp_path / "small.toml", own_limits=[Quiet(most=0.1)])
    assert {margin.limit for margin in broken(told)} == {"quiet"}


def test_a_protocol_gives_the_limits_their_numbers(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"

    def read(text: str) -> Plan:
        path.write_text(f"free = true\n[postures]\nparallel = 2\n{text}")
        return read_plan(path)

    usual = {limit.name: limit for limit in read("").limits}
    assert usual == {limit.name: limit for limit in family()}
    found = {limit.name: limit for limit in read("[limits.friction]\nmu = 0.4\n[limits.balance]\nshare = 0.5\n").limits}
    assert found == {**usual, "friction": Friction(mu=0.4), "balance": replace(usual["balance"], share=0.5)}
    path.write_text("free = true\nshare_of_support = 0.5\n[postures]\nparallel = 2\n")
    assert read_plan(path).limits == read("[limits.balance]\nshare = 0.5\n").limits
    assert read_plan(path).share == 0.5


@pytest.mark.parametrize(
    ("text", "error", "said"),
    [
        ("[limits.ceiling]\nheight = 1.2\n", UnknownName, "'ceiling' is not a limit in .*friction"),
        ("[limits.friction]\nmue = 0.4\n", UnknownName, "'mue' is not a number of limits.friction.*Legal: mu"),
        ("[limits.friction]\nmu = 4\n", BiodanceError, r"limits.friction.mu = 4; legal are 0.05 to 1.5"),
        ("[limits.friction]\nmu = true\n", BiodanceError, "limits.friction.mu = True; expected a finite number"),
        ("[limits]\nfriction = 0.4\n", BiodanceError, r"\[limits.friction\] must be a table"),
        ("[limits.balance]\nshare = 0.5\n", BiodanceError, "share_of_support and limits.balance.share say the same"),
    ],
)
def test_what_a_protocol_may_not_say_of_limits_is_one_sentence(
    text: str, error: type, said: str, tmp_path: Path
) -> None:
    path = tmp_path / "p.toml"
    path.write_text(("share_of_support = 0.6\n" if "balance" in text else "") + f"[postures]\nparallel = 2\n{text}")
    with pytest.raises(error, match=said):
        read_plan(path)


def test_a_limit_of_a_robots_likeness_grows_with_it() -> None:
    assert GroundClearance(height=0.05).resized(3.0).height == pytest.approx(0.15)
    assert Friction(mu=0.4).resized(3.0) == Friction(mu=0.4)


def test_nobody_but_the_limits_themselves_knows_a_limit_by_name() -> None:
    room = Path(limits.__file__).parents[2]
    told = (room / "pipeline" / "dance.py", room / "report" / "dance.py")
    files = [*(room / "dance").rglob("*.py"), *told]
    known = {(path.name, limit.name) for path in files for limit in family() if f'"{limit.name}"' in path.read_text()}
    assert {one for one in known if f"{one[1]}.py" != one[0]} == {
        ("robot.py", "seat"),  # a size of a stance
        ("playback.py", "friction"),  # of MuJoCo's floor
        ("plan.py", "balance"),  # share_of_support, the short form in protocols
    }


def test_what_is_no_limit_is_not_taken_as_one() -> None:
    with pytest.raises(BiodanceError, match="lacks the base class Limit"):
        Plan("small", (("parallel", 2),)).with_limits(["friction"])
    with pytest.raises(UnknownName, match="Legal: mu"):
        limits_with({"friction": {"my": 1.0}}, where="here")
