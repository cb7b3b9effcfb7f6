"""Pages in other languages (the subject's, the cards and the page of a dance): every sentence in every catalogue, and a
laboratory's own catalogue.
"""

import re
import tomllib
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import pytest
from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_file
from babel.messages.pofile import read_po
from identified_sessions import session_result
from made_cycles import walked_knees

from biodance.cli import run
from biodance.cli.shared import NOT_DONE
from biodance.dance.problem.plan import read_plan
from biodance.dance.search.known_postures import posture_phrases
from biodance.errors import FileRefused, UnknownName
from biodance.lab.session.file import VisitEntry
from biodance.library import folder, names
from biodance.pipeline.movement import SubjectAccount, account_for
from biodance.report.pages.language import FAMILY, read_language
from biodance.report.pages.subject import subject_page

REPORT = Path(__file__).parents[1] / "biodance" / "report"
WRITTEN = (
    (REPORT / "pages" / "subject.py", "python"),
    (REPORT / "templates" / "subject.html.j2", "jinja2"),
)
DANCED = (
    (REPORT.parent / "dance" / "cues.py", "python"),
    (REPORT.parent / "pipeline" / "dance.py", "python"),
    (REPORT / "dance.py", "python"),
    (REPORT / "pages" / "language.py", "python"),
    (REPORT / "pages" / "feedback.py", "python"),
    *((REPORT / "templates" / f"{name}.html.j2", "jinja2") for name in ("cues", "feedback")),
    *((REPORT / "templates" / f"{name}.js", "javascript") for name in ("feedback", "follow", "visit")),
)
KEYWORDS = {"say": None, "N_": None, "count": (1, 2)}


def sentences() -> set[str]:
    """Return what the pages' code says, a singular for both numbers, the words and care of shipped protocols, and the
    care of limits.
    """
    written = (*WRITTEN, *DANCED)
    found = [one[1] for path, method in written for one in extract_from_file(method, path, keywords=KEYWORDS)]
    code = {one if isinstance(one, str) else one[0] for one in found}
    cues = tomllib.loads((folder("protocols") / "vocabulary" / "cues.toml").read_text(encoding="utf-8"))
    words = {one for group in cues.values() for _, *texts in group.values() for one in texts}
    plans = [read_plan(name) for name in names("protocols/dances")]
    asked = {one for plan in plans for one in (plan.whom, *plan.care)}
    limits = (path.read_text(encoding="utf-8") for path in (folder("protocols") / "limits").glob("*.toml"))
    care = {one for text in limits for one in tomllib.loads(text).get("care", ())}
    return code | words | asked | care | set(posture_phrases())


def catalogue(language: str) -> Catalog:
    return read_po(BytesIO(FAMILY.shipped()[language].read_bytes()))


def ids(found: Catalog) -> list[str]:
    return [one.id if isinstance(one.id, str) else one.id[0] for one in found if one.id]


def accounts() -> list[SubjectAccount]:
    """Return somebody with numbers, one without, and one who walked."""
    result, visit = session_result(), VisitEntry(lab="77", operator="88", date="2026-11-22")
    some = [account_for(result), account_for(replace(result, identification=None))]
    return [replace(one, visit=visit, moved=moved) for one in some for moved in (None, walked_knees(60.0, 50.0))]


@pytest.mark.parametrize("language", sorted(FAMILY.shipped()))
def test_every_sentence_is_in_the_catalogue_of_every_language(language):
    assert len(sentences()) > 60
    assert sorted(ids(catalogue(language))) == sorted(sentences())
    assert not [one.id for one in catalogue(language) if one.fuzzy]
    assert read_language(language).tag == language


def bracketed() -> str:
    """Return a catalogue that puts every sentence in brackets."""
    lines = ['msgid ""', 'msgstr ""', r'"Language: fr\n"', r'"Plural-Forms: nplurals=2; plural=(n > 1);\n"', ""]
    for one in (message.id for message in catalogue("en") if message.id):
        if isinstance(one, str):
            lines += [f'msgid "{one}"', f'msgstr "⟦{one}⟧"', ""]
        else:
            lines += [f'msgid "{one[0]}"', f'msgid_plural "{one[1]}"']
            lines += [*(f'msgstr[{k}] "⟦{form}⟧"' for k, form in enumerate(one)), ""]
    return "\n".join(lines)


def test_nothing_on_the_page_is_said_without_the_catalogue(tmp_path):
    (tmp_path / "fr.po").write_text(bracketed(), encoding="utf-8")
    for account in accounts():
        html = subject_page(replace(account, visit=VisitEntry(lab="77")), tmp_path / "fr.po")
        assert '<html lang="fr">' in html
        html = re.sub(r"<style>.*?</style>", "", html, flags=re.S)
        while "⟦" in html:
            html = re.sub("⟦[^⟦⟧]*⟧", "", html)
        assert not re.findall(r"[A-Za-z]{2,}", re.sub(r"<[^>]*>", " ", html))
        assert not re.findall(r'(?:alt|aria-label|title)="[^"]*[A-Za-z]', html)


def test_german_says_numbers_and_dates_as_german_does():
    numbers, walked, *_ = [subject_page(one, "de") for one in accounts()]
    assert '<html lang="de">' in numbers
    assert "22. November 2026" in numbers
    assert re.search(r"<th>linker Oberschenkel</th>\s*<td>\d+,\d bis \d+,\d\skg</td>", numbers)
    assert "Sie sind 1,2 Meter in der Sekunde gegangen. Das sind 4,3 Kilometer in der Stunde." in walked
    assert "Fragen zu dieser Seite beantwortet Ihnen gern: 88, 77." in walked


def test_a_language_that_is_not_there_is_refused_before_the_work_with_the_legal_ones(tmp_path, capsys):
    with pytest.raises(UnknownName, match=r"Legal: de, en\..*\*\.po"):
        read_language("fr")
    assert run(["report", str(tmp_path), "--language", "fr", "--out", str(tmp_path / "out")]) == NOT_DONE
    assert "Legal: de, en" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('msgstr "Ihre Zahlen"', 'msgstr ""', "1 of the .* not translated, the first of them: 'Your numbers'"),
        ('msgstr "%(number)s Grad"', 'msgstr "Grad"', "'%\\(number\\)s degrees'"),
        ('"Language: de\\n"', '"Language: qq\\n"', "ours.po: the Language 'qq' is not known"),
        ('"Language: de\\n"\n', "", "ours.po: says no Language"),
        ('msgstr "Ihre Zahlen"', "Ihre Zahlen", "is no catalogue of gettext"),
    ],
)
def test_a_catalogue_of_ones_own_is_taken_or_refused_with_what_is_wrong(tmp_path, old, new, said):
    own, text = tmp_path / "ours.po", FAMILY.shipped()["de"].read_text(encoding="utf-8")
    assert old in text
    own.write_text(text, encoding="utf-8")
    assert read_language(own).say("Your numbers") == "Ihre Zahlen"
    own.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(FileRefused, match=said) as refused:
        read_language(own)
    assert str(refused.value).count("ours.po") == 1


def test_a_catalogue_that_loses_a_limb_is_refused(tmp_path):
    (tmp_path / "fr.po").write_text(bracketed().replace("⟦lift {} forward⟧", "⟦lift forward⟧"), encoding="utf-8")
    with pytest.raises(FileRefused, match=r"is to hold \{\}"):
        read_language(tmp_path / "fr.po")
