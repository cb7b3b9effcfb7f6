"""Cards and page of a dance in German: calls, places of the feet, names of postures, and what the page says."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from browser import BROWSER, Page
from small_dances import small_dance

from biodance.dance.cues import cue_sheet, dance_instructions
from biodance.dance.problem.plan import read_plan
from biodance.dance.search.known_postures import IN_PART, posture_phrases
from biodance.errors import UnknownName
from biodance.pipeline.dance import DanceResult, before_cues
from biodance.report.dance import cards_page
from biodance.report.pages.feedback import write_feedback
from biodance.report.pages.language import posture_said, read_language

GERMAN = read_language("de")


def with_care():
    return replace(small_dance(), care=read_plan("patient").care, names=("stand", "bow, the left arm back"))


def test_calls_are_said_in_the_order_of_the_language() -> None:
    assert dance_instructions(small_dance(), GERMAN.say)[1] == ("den linken Arm seitlich heben, um etwa 60°",)
    assert dance_instructions(small_dance())[1] == ("lift the left arm sideways by about 60°",)


def test_every_part_of_the_name_of_a_posture_is_said() -> None:
    mine = {text: f"<{text}>" for text in posture_phrases()}
    name = f"bow from the hips, back straight, {IN_PART}, both arms back"
    assert posture_said(name, mine.__getitem__) == (
        f"<bow from the hips>, <back straight>, <{IN_PART}>, <both arms back>"
    )


def test_cards_say_what_a_person_reads_in_german() -> None:
    dance = with_care()
    result = DanceResult(dance.body, read_plan("patient"), dance, (), None, None, "", (), 1.0)
    page = cards_page(result, "de")
    seen = re.sub(r"<style>.*?</style>|<[^>]*>", " ", page, flags=re.DOTALL)
    assert '<html lang="de">' in page
    for said in (
        "Verbeugen, der linke Arm nach hinten",
        "mit beiden Füßen nebeneinander",
        "von vorn",
        "dann 1 s still",
        "Menschen, die ermüden",
        "m Kraftmessplatte von Seite zu Seite",
    ):
        assert said in seen
    assert "Eine Hilfsperson steht" in seen
    assert not re.findall(r"\b(the|with|and|stand|arm is|hold)\b", seen)
    assert cards_page(result) == cards_page(result, "en")
    with pytest.raises(UnknownName, match="de"):
        cards_page(result, "xx")


def test_the_cue_sheet_is_german_too() -> None:
    dance, say = with_care(), GERMAN.say
    result = DanceResult(dance.body, read_plan("patient"), dance, (), None, None, "", (), 1.0, "Schlaganfall")
    sheet = cue_sheet(
        dance_instructions(dance, say),
        ("auf beiden Füßen",) * 2,
        tempo=(2.5, 1.0),
        short=GERMAN.short,
        about=before_cues(result, say, GERMAN.number),
        rests=(True, False),
        say=say,
    )
    assert sheet.startswith("# Der Tanz, Haltung für Haltung\n")
    assert "in 2,5 s dorthin, gezählt *eins und zwei*, dann 1 s still halten" in sheet
    assert "Für die Grenzen einer Person gemacht: Schlaganfall." in sheet
    assert not re.findall(r"\b(the|with|and|stand|stay|hold|one)\b", sheet)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_the_page_leads_in_german_and_colours_the_sides(tmp_path: Path) -> None:
    write_feedback(with_care(), tmp_path / "page.html", language="de")
    with Page((tmp_path / "page.html").as_uri()) as browser:
        scene = json.loads(browser.run("document.getElementById('data').textContent"))
        assert scene["cues"][0]["stance"] == "mit beiden Füßen nebeneinander"
        assert browser.run("by('now').textContent") in ("Drücken Sie Start", "Machen Sie sich bereit")
        browser.key(" ")
        seen = "[by('now').textContent, document.querySelector('#calls .left')?.textContent, by('play').textContent]"
        found = browser.until(f"document.body.dataset.phase === 'move' && {seen}", 60)
        assert found == ["Jetzt bewegen", "linken", "Pause"]
        assert browser.run("say('%(number)s of %(count)s', { number: 1, count: 2 })") == "1 von 2"
