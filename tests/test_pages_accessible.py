"""Every page that is written, asked by axe-core on a desk and on a phone: no violation, and nothing wider than the
screen. Those of a robot and of a stream: `test_robot_recording`, `test_live`.
"""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from accessible import ASKED, complaints, unfold
from browser import Page
from example_results import html_of, refused_session
from hidden_faults import hidden
from identified_sessions import session_result
from small_dances import small_dance

import biodance
from benchmarks.plates import Step, draw
from biodance.batch.summary import write_summary
from biodance.batch.work import Outcome, trial_rows
from biodance.cli import run
from biodance.cli.shared import NOT_DONE
from biodance.dance.problem.plan import read_plan
from biodance.diagnosis.archive.judge import judge_archive
from biodance.lab.session.read import read_session
from biodance.pipeline.dance import DanceResult
from biodance.pipeline.learn import PlatesJudged
from biodance.pipeline.movement import account_for
from biodance.pipeline.session import examine, identification_of
from biodance.report.dance import cards_page
from biodance.report.laboratory import plates_document, plates_page
from biodance.report.pages.feedback import write_feedback
from biodance.report.pages.subject import subject_page
from biodance.report.write import write_diagnosis, write_session

pytestmark = ASKED
NAMES = ("report", "diagnose", "refused", "subject", "subject in German", "subject without numbers")
NAMES += ("cards", "foresee", "feedback", "group", "plates")


@pytest.fixture(scope="module")
def browser() -> Iterator[Page]:
    with Page("about:blank#begin") as page:
        yield page


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return every page, by name."""
    folder = tmp_path_factory.mktemp("pages")
    return _of_a_session(folder) | _of_a_dance(folder) | _of_archives(folder)


def _of_a_session(folder: Path) -> dict[str, Path]:
    """Return the pages of a session with a fault beside another one of the same person, of the person with and without
    numbers, and of a session in which nothing could be done.
    """
    earlier = examine(read_session(hidden(folder / "S02", visit=1, trials=("static", "move_1"))))
    before = identification_of(earlier)
    now = hidden(folder / "S01", "plate_gain:target=Fz,gain=0.06", trials=("static", "move_1", "squat_1", "squat_2"))
    result = examine(read_session(now), reference=before)
    found = biodance.diagnose(result, reference=before)
    for name in ("report", "diagnose"):
        (folder / name).mkdir()
    write_session(result, found, folder / "report")
    write_diagnosis(result, found, folder / "diagnose")
    pages = {name: folder / name / "report.html" for name in ("report", "diagnose")}
    for name, text in (
        ("refused", html_of(refused_session())),
        ("subject", subject_page(account_for(session_result()))),
        ("subject in German", subject_page(account_for(session_result()), "de")),
        ("subject without numbers", subject_page(account_for(result, found))),
    ):
        pages[name] = folder / f"{name}.html"
        pages[name].write_text(text, encoding="utf-8")
    return pages


def _of_a_dance(folder: Path) -> dict[str, Path]:
    dance = small_dance()
    dance.save(folder / "dance.npz")
    found = {name: folder / f"{name}.html" for name in ("foresee", "feedback", "cards")}
    assert run(["foresee", str(folder / "dance.npz"), "--out", str(found["foresee"])]) != NOT_DONE
    write_feedback(dance, found["feedback"])
    result = DanceResult(dance.body, read_plan("short"), dance, (), None, None, "", (), 1.0)
    found["cards"].write_text(cards_page(result), encoding="utf-8")
    return found


def _of_archives(folder: Path) -> dict[str, Path]:
    """Return the pages of nine sessions, one of which weighs more, with a refused one, and of plates that moved."""
    rows = trial_rows(json.loads((folder / "report" / "results.json").read_text(encoding="utf-8")))
    away = [{"mass_difference_percent": 20.0 if k == 4 else 0.1 * k} for k in range(9)]
    sessions = [Outcome(f"s{k}", "0", "done", "", tuple(row | one for row in rows)) for k, one in enumerate(away)]
    lost = Outcome(
        "a_session_with_a_rather_long_name" * 2, "0", "refused", f"/a_long_path{'/with_folders' * 9}: empty."
    )
    (folder / "group").mkdir()
    write_summary(folder / "group", "archive", [*sessions, lost])
    evidence = draw(5, visits=13, step=Step("plate2", "place_y", 0.005, 8))
    judged, refused = judge_archive(evidence), {"V99": "is no recording."}
    moved = PlatesJudged(folder, judged, evidence, refused, ("A date was guessed.",))
    (folder / "plates.html").write_text(plates_page(moved, plates_document(moved)), encoding="utf-8")
    return {"group": folder / "group" / "report.html", "plates": folder / "plates.html"}


def test_the_pages_hold_what_is_to_be_asked(pages: dict[str, Path]) -> None:
    text = {name: page.read_text(encoding="utf-8") for name, page in pages.items()}
    assert set(text) == set(NAMES)
    assert '<div class="curves"><div class="cells three">' in text["report"], "key values by trial"
    for part in ("replay", "changes", "movement", "predicts", "checks", "standing", "trials"):
        assert f'<section id="{part}">' in text["report"]
    assert "plate gain" in text["diagnose"]
    assert " kg" in text["subject"]
    assert " kg" not in text["subject without numbers"]


@pytest.mark.parametrize("name", NAMES)
def test_nobody_is_shut_out_of_a_page(browser: Page, pages: dict[str, Path], name: str) -> None:
    before = len(browser.said())
    unfold(browser, pages[name].as_uri())
    assert complaints(browser) == []
    assert [one for one in browser.said()[before:] if "GL" not in one] == []


def test_without_webgl_the_replay_says_so_and_the_time_still_runs(pages: dict[str, Path]) -> None:
    parts = "[...document.querySelectorAll('.replay [data-part]')].filter(one => one.checkVisibility())"
    time = "document.querySelector('[data-part=time]')"
    with Page("about:blank#begin") as browser:
        without = "HTMLCanvasElement.prototype.getContext = () => null"
        browser.send("Page.addScriptToEvaluateOnNewDocument", source=without)
        unfold(browser, pages["report"].as_uri())
        browser.run("document.getElementById('replay').scrollIntoView()")
        browser.until(f"{parts}.some(one => one.dataset.part === 'undrawn')", 10.0)
        shown = set(browser.run(f"{parts}.map(one => one.dataset.part)"))
        assert shown == {"undrawn", "play", "time", "said", "trial", "worst", "speed"}
        browser.run(f"{time}.value = 1; {time}.dispatchEvent(new Event('input'))")
        assert browser.run("document.querySelector('[data-part=said]').textContent").startswith("1.00 s")
        assert complaints(browser, "#replay") == []


def test_what_is_wrong_with_a_page_is_found(browser: Page, tmp_path: Path) -> None:
    page = tmp_path / "wrong.html"
    page.write_text('<!doctype html><title>t</title><p style="width:500px;color:#ddd">pale</p><img src="data:,">')
    unfold(browser, page.as_uri())
    found = complaints(browser)
    assert {one.split(":")[1].strip() for one in found} >= {"color-contrast", "image-alt", "html-has-lang"}
    assert [one for one in found if "wider than 390 px" in one]
    assert not [one for one in found if "wider than 1280 px" in one]
