"""A dance that imprecise people cannot dance safely: nothing leads anybody through it unless somebody says --despite.

Then it says so before anything else.
"""

from dataclasses import replace
from pathlib import Path

import pytest
from small_dances import BODY, small_dance

from biodance.cli import run
from biodance.dance.dance import Dance
from biodance.dance.expectation import expect
from biodance.dance.limits._checked import Margin
from biodance.dance.metrics import dance_metrics
from biodance.dance.performers import PerformersMargin, PerformersResult
from biodance.dance.problem.plan import Plan
from biodance.pipeline.dance_result import DanceResult, not_safe
from biodance.report.dance_write import write_dance

LEADING = {"cues.md", "cues.html", "dance.c3d"}
SHORT = Margin("self_collision_of_performers", -0.04, 1.0, "m", "left_forearm_hand - left_thigh")
PLAN = Plan("one_segment", "", (("parallel", 2),), hold=1.0, instructions=4.0)
WHERE = "4.0 cm of the room between arms, legs and trunk that is needed are missing at 1 s"


@pytest.fixture(scope="module")
def result() -> DanceResult:
    dance = replace(small_dance(), unsafe=(SHORT,))
    return DanceResult(BODY, PLAN, dance, (SHORT,), dance_metrics(dance, PLAN), expect(dance), "", (), 1.0)


def test_the_dance_on_disk_knows_that_it_is_not_safe(result: DanceResult, tmp_path: Path) -> None:
    assert result.dance is not None
    result.dance.save(tmp_path / "dance.npz")
    assert Dance.load(tmp_path / "dance.npz").unsafe == (SHORT,)


def test_nothing_that_leads_is_written_of_it(result: DanceResult, tmp_path: Path) -> None:
    found = write_dance(result, tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert not LEADING & names
    assert {"dance.npz", "results.json", "margins.md"} <= names
    assert WHERE in found["warnings"][0]


def test_despite_that_it_heads_the_cards_and_each_of_them(result: DanceResult, tmp_path: Path) -> None:
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
    write_dance(safe, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} >= LEADING
    assert all("NOT SAFE" not in (tmp_path / name).read_text() for name in ("cues.md", "cues.html"))


def test_what_performers_lack_becomes_what_is_not_safe() -> None:
    """3 mm of support of the 15 that are asked, and segments that keep 21 mm of 20."""
    rooms = (
        PerformersMargin("balance", "m", 0.015, 0.003, 1, "parallel", 0.01),
        PerformersMargin("self_collision", "m", 0.02, 0.021, 1, "arm - head", 0.0),
    )
    margins = PerformersResult(200, rooms, ((1, "balance"),)).margins(small_dance())
    assert [round(margin.worst, 6) for margin in margins] == [-0.012, 0.001]
