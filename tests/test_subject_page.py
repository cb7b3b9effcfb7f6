"""The subject's page: short words, ranges first, and no mass where a check failed."""

import re
from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from identified_sessions import session_result
from made_cycles import walked_knees

from biodance.cli import run
from biodance.cli.shared import DONE, NEEDS_A_PERSON
from biodance.identification.knowledge import known_together
from biodance.pipeline.movement import account_for
from biodance.pipeline.trial import OPEN, Check
from biodance.report.pages.language import read_language
from biodance.report.pages.subject import PLAIN_NAMES, plain_movement, subject_page
from biodance.uncertainty.tolerances import shipped

JARGON = ("segment", "inertia", "interval", "marker", "prior", "posterior", "regress", "diagnos", "wrench", "95 %")
VISIT = '[session]\nlab = "Gait Lab"\noperator = "Ana Ruiz"\ndate = 2026-11-22\n'


class Prose(HTMLParser):
    """Collects the text of paragraphs, list items and headings: one block each."""

    def __init__(self) -> None:
        super().__init__()
        self.blocks, self.inside = [], False

    def handle_starttag(self, tag, attrs):
        if tag in ("p", "li", "h1", "h2", "figcaption"):
            self.inside = True
            self.blocks.append("")

    def handle_endtag(self, tag):
        self.inside = self.inside and tag not in ("p", "li", "h1", "h2", "figcaption")

    def handle_data(self, data):
        if self.inside:
            self.blocks[-1] += data


def syllables(word: str) -> int:
    """Count groups of vowels; a silent e at the end is none."""
    word = re.sub(r"(?<=[^aeiouyl])e[sd]?$", "", word.lower())
    return max(1, len(re.findall(r"[aeiouy]+", word)))


def grade(html: str) -> float:
    """Return the Flesch-Kincaid grade (Kincaid et al. 1975) of the page's prose."""
    prose = Prose()
    prose.feed(html)
    sentences = [s for block in prose.blocks for s in re.split(r"[.!?]+", block) if re.search(r"[a-z]", s)]
    words = [word for s in sentences for word in re.findall(r"[A-Za-z']+", s)]
    return 0.39 * len(words) / len(sentences) + 11.8 * sum(map(syllables, words)) / len(words) - 15.59


@pytest.fixture
def result(tmp_path):
    (tmp_path / "session.toml").write_text(VISIT, encoding="utf-8")
    found = session_result()
    return replace(found, session=replace(found.session, folder=tmp_path))


def test_the_measure_of_reading_tells_plain_from_learned():
    assert syllables("identification") == 6
    assert syllables("plates") == 1
    assert grade("<p>The cat sat on the mat. It was warm.</p>") < 2
    assert grade("<p>Segmental inertial parameters necessitate careful probabilistic interpretation.</p>") > 12


def test_a_phone_gets_a_picture_with_letters_that_can_be_read(result):
    html = subject_page(account_for(result))
    small, wide = (
        ElementTree.fromstring(b64decode(address))
        for address in re.findall(r'(?:srcset|src)="data:image/svg\+xml;base64,([^"]+)"', html)
    )
    for drawing, shown, least in ((small, 364, 11.0), (wide, 736, 11.0)):
        assert float(drawing.get("font-size")) * shown / float(drawing.get("width")) > least
    assert len(list(small.iter("{http://www.w3.org/2000/svg}text"))) == len(PLAIN_NAMES)


def test_the_weight_is_as_uncertain_as_plates_read_wrong(result):
    gain, zero = (shipped().size(f"plate_{what} Fz") for what in ("gain", "offset"))
    for plates in (1, 4):
        standing = SimpleNamespace(mass=74.0, mass_sd=0.03, plates=np.zeros((plates, 4, 2)))
        low, high = account_for(replace(result, standing=standing)).weight
        assert (low + high) / 2 == pytest.approx(standing.mass)
        # sway, gain of the load, and the zero of every plate whose readings are summed
        variance = 0.03**2 + (gain * 74.0) ** 2 + plates * (zero / 9.80665) ** 2
        assert (high - low) / 2 == pytest.approx(1.96 * variance**0.5, rel=1e-3)
        assert high - low > 0.5, "two plates seldom agree better"


def test_every_part_has_a_range_or_an_honest_word(result):
    html, known = subject_page(account_for(result)), result.identification.identification.known
    masses = [k for k in known if k.quantity == "mass"]
    assert html.count("We could not measure this well.</td>") == sum(k.verdict == "cannot be known" for k in masses) > 0
    for one in masses:
        low, high = one.interval
        row = re.search(rf"<th>{PLAIN_NAMES[one.segment]}</th>\s*<td>([\d.]+) to ([\d.]+) kg", html)
        assert (row is None) is (one.verdict == "cannot be known")
        if row:
            assert float(row[1]) <= low <= float(row[1]) + 0.1
            assert float(row[2]) - 0.1 <= high <= float(row[2])
    assert html.index(" kg") < html.index("How to read this")
    assert "data:image/svg" in html
    assert all(f"<dd>{said}</dd>" in html for said in ("Gait Lab", "Ana Ruiz", "November 22, 2026"))
    assert grade(html) <= 7
    assert not [word for word in JARGON if word in re.sub(r"base64,\S+|<style>.*?</style>", "", html, flags=re.S)]


def test_a_pelvis_that_is_not_known_alone_is_told_with_its_neighbour(result):
    pair = known_together(result.identification.identification.sip)[0]
    told = account_for(result)
    assert told.parts[0].segments == ("pelvis",)
    assert not told.parts[0].measured
    assert told.together.segments == pair.segments
    assert told.together.low == pytest.approx(pair.mass - 1.96 * pair.sd, abs=1e-3)
    assert told.together.high == pytest.approx(pair.mass + 1.96 * pair.sd, abs=1e-3)


@pytest.mark.parametrize("what", ["marker distance, RMS", "mass on the plates against declared", "a new check"])
def test_a_failed_check_gives_no_mass(result, what):
    failed = Check(what, "fit_0", "30 mm", "at most 20 mm", False)
    html = subject_page(account_for(replace(result, checks=(failed,))))
    assert "We cannot give you numbers this time" in html
    assert " kg" not in html
    assert "data:image" not in html
    assert grade(html) <= 7


def test_frames_whose_posture_is_open_take_no_mass_away_since_none_comes_from_them(result):
    failed = Check(OPEN, "fit_0", "1.4 %", "at most 1 %", False)
    account = account_for(result)
    assert account.parts
    assert repr(account_for(replace(result, checks=(failed,))).parts) == repr(account.parts)  # NaN is unlike itself


def test_who_walked_is_told_how_before_any_mass_also_where_no_mass_is_said(result):
    for one in (result, replace(result, identification=None)):
        html = subject_page(replace(account_for(one), moved=walked_knees(60.0, 50.0)))
        assert "You walked 1.2 metres in a second. That is 4.3 kilometres an hour." in html
        assert "You made 120 steps in a minute." in html
        assert "Your right knee bends 10 degrees more than the other one." in html
        assert html.index("How you walked") < html.index("What the parts of your body weigh</h2>")
        assert '<svg class="panel"' in html
        assert "Gait Lab" in html[html.index("What this is not") :]
        assert grade(html) <= 7


@pytest.mark.parametrize(
    ("right", "left", "count", "said"),
    [
        (60.0, 59.9, 4, "We see no sure difference in how far your two knees bend."),
        (50.0, 60.0, 4, "Your left knee bends 10 degrees more"),
        (60.0, 50.0, 2, "too few of them to say"),
    ],
)
def test_a_difference_of_the_knees_is_told_where_it_is_sure(right, left, count, said):
    assert said in " ".join(plain_movement(walked_knees(right, left, count), read_language())["said"])


def test_a_session_without_identification_says_so(result):
    html = subject_page(account_for(replace(result, identification=None)))
    assert "No test of yours shows" in html
    assert " kg" not in html


def test_the_command_writes_it_beside_the_report(result, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("biodance.lab.session.read.read_session", lambda folder, **_: result.session)
    monkeypatch.setattr("biodance.pipeline.session.followed", lambda session, **_: result)
    monkeypatch.setattr("biodance.pipeline.diagnosis.diagnosed_and_corrected", lambda result, **_: (result, None))
    monkeypatch.setattr("biodance.report.write.page", lambda *_, **__: "a page")
    told = run(["report", str(tmp_path), "--out", str(tmp_path / "out"), "--subject-page", "--json"])
    assert told in (DONE, NEEDS_A_PERSON)
    assert "What the parts of your body weigh" in (tmp_path / "out" / "subject.html").read_text(encoding="utf-8")
