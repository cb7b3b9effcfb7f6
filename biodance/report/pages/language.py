"""The language of a page for the person (the subject's, cards and page of a dance): a catalogue of its sentences
(gettext), how numbers and dates are written, and what cards and page of a dance put together of parts, so that every
part is in the catalogue.

English is what the code says. A catalogue is one text file, ``<language>.po``; a laboratory gives its own by its path,
or offers it under the entry points ``biodance.languages``.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import date
from gettext import GNUTranslations
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from babel import Locale, UnknownLocaleError
from babel.dates import format_date
from babel.messages.catalog import Catalog
from babel.messages.mofile import write_mo
from babel.messages.pofile import PoFileError, read_po
from babel.numbers import format_decimal

from biodance.discovery import DataFamily
from biodance.errors import FileRefused
from biodance.lab.plain_text import read_text

if TYPE_CHECKING:
    from biodance.dance.cues import Say

FAMILY = DataFamily("language", "biodance.languages", "report/languages", ".po")
ENGLISH = "en"


def N_(text: str) -> str:
    """Return ``text`` as it is; marks a sentence of a table that is translated where it is said."""
    return text


@dataclass(frozen=True, eq=False)
class Language:
    """``tag`` of the page (``de``, ``pt-BR``), ``locale`` of its numbers and dates, ``catalogue`` of its sentences."""

    tag: str
    locale: Locale
    catalogue: GNUTranslations

    def say(self, text: str, **values: str) -> str:
        """Return a sentence in this language with its ``values`` in their places."""
        return self.catalogue.gettext(text) % values

    def count(self, one: str, more: str, number: int) -> str:
        """Return a sentence of a ``number`` of things: ``one`` or ``more`` by the plural rule of this language."""
        return self.catalogue.ngettext(one, more, number) % {"number": self.number(number)}

    def number(self, value: float, digits: int = 0) -> str:
        """Return a number with so many ``digits`` after the decimal sign."""
        form = f"#,##0.{digits * '0'}".strip(".")
        return format_decimal(round(float(value), digits), format=form, locale=self.locale)

    def short(self, value: float, digits: int = 1) -> str:
        """Return a number with at most so many ``digits`` after the decimal sign, without zeros at its end."""
        return format_decimal(round(float(value), digits), format=f"#,##0.{digits * '#'}", locale=self.locale)

    def date(self, day: date | str | None) -> str:
        """Return a day (a date, or as ISO 8601) in words; any other text as it is, "" for none."""
        try:
            return format_date(date.fromisoformat(str(day)[:10]), "long", locale=self.locale) if day else ""
        except ValueError:
            return str(day)


def read_language(name_or_path: str | Path = ENGLISH) -> Language:
    """Return a language by its name (``en``, ``de``, of an entry point), or a laboratory's own by the path of its .po.

    Raises
    ------
    UnknownName
        There is no such language; the message lists all.
    FileRefused
        The file is no catalogue, says no ``Language``, or does not have every sentence with its placeholders.
    """
    path = FAMILY.locate(name_or_path)
    found = _catalogue(path)
    if path != FAMILY.shipped()[ENGLISH]:
        _refuse_gaps(path, found)
    packed = BytesIO()
    write_mo(packed, found)
    packed.seek(0)
    assert found.locale is not None  # _catalogue
    return Language(str(found.locale).replace("_", "-"), found.locale, GNUTranslations(packed))


def _catalogue(path: Path) -> Catalog:
    """Return the content of a .po file whose header says a language that is known."""
    text = read_text(path)
    try:
        found = read_po(BytesIO(text.encode()), abort_invalid=True)
    except (PoFileError, ValueError, UnknownLocaleError) as error:
        raise FileRefused(
            f"{path}: is no catalogue of gettext ({error}). Begin with a copy of biodance's en.po."
        ) from error
    if found.locale is None:
        said = found.locale_identifier
        wrong = f"the Language {said!r} is not known" if said else "says no Language"
        raise FileRefused(f'{path}: {wrong}. Write "Language: de\\n" with the code of yours (ISO 639) into the header.')
    return found


def _refuse_gaps(path: Path, found: Catalog) -> None:
    """Refuse a catalogue in which a sentence is missing, or a placeholder such as ``%(number)s`` in one."""
    needed = [one.id for one in _catalogue(FAMILY.shipped()[ENGLISH]) if one.id]
    said = {one.id: one for one in found if not one.fuzzy}
    missing = [one for one in needed if one not in said or not all(_texts(said[one].string))]
    if missing:
        first = _texts(missing[0])[0]
        raise FileRefused(
            f"{path}: {len(missing)} of the {len(needed)} sentences of the page are not translated, the first of them: "
            f"{first!r}. Translate them; what a copy of biodance's en.po holds is all that is needed."
        )
    for one in needed:
        places = _PLACE.findall(_texts(one)[0])
        lost = [text for text in _texts(said[one].string) if sorted(_PLACE.findall(text)) != sorted(places)]
        if lost:
            raise FileRefused(
                f"{path}: {lost[0]!r} is to hold {', '.join(places) or 'no per cent sign'}, as {_texts(one)[0]!r} "
                "does. Correct the translation."
            )


_PLACE = re.compile(r"%(?:\(\w+\)s|.?)|\{\}")
"""What stands for a value or a limb in a sentence; also a per cent sign."""


def _texts(said: str | list[str] | tuple[str, ...] | None) -> tuple[str, ...]:
    """Return a message, or its singular and plurals."""
    return (said or "",) if said is None or isinstance(said, str) else tuple(said)


COMPOSED = (
    *(N_("both arms"), N_("the right arm"), N_("the left arm")),
    *(N_("both upper arms"), N_("the right upper arm"), N_("the left upper arm")),
    *(N_("both forearms"), N_("the right forearm"), N_("the left forearm")),
    *(N_("both elbows"), N_("the right elbow"), N_("the left elbow")),
    *(N_("both thighs"), N_("the right thigh"), N_("the left thigh")),
    *(N_("both legs"), N_("the right leg"), N_("the left leg")),
    *(N_("both knees"), N_("the right knee"), N_("the left knee")),
    *(N_("both feet"), N_("the right foot"), N_("the left foot")),
    *(N_("hold the frame with both hands"), N_("hold the frame with the right hand")),
    *(N_("hold the frame with the left hand"), N_("mirror: the same with right and left exchanged")),
    *(N_("step forward with the right foot"), N_("set the right foot back beside the left one")),
    *(N_("set the right foot down"), N_("set the left foot down")),
    *(N_("shift your weight onto the right leg"), N_("shift your weight onto the left leg")),
    *(N_("with both feet side by side"), N_("with the right foot in front"), N_("on the stool")),
    *(N_("with both feet side by side, the weight on the right one"),),
    *(N_("with both feet side by side, the weight on the left one"),),
    *(N_("with the right foot in front, the weight on the right one"),),
    *(N_("with the right foot in front, the weight on the left one"),),
    *(N_("on the right leg alone"), N_("on the left leg alone")),
    N_("Then rest: let free arms down. Take up this posture again when you are ready."),
    *(N_("one"), N_("two"), N_("three"), N_("four"), N_("five"), N_("six"), N_("seven"), N_("eight")),
    *(N_("reserve for the balance"), N_("room under hands, knees and head"), N_("room between arms, legs and trunk")),
)
"""What is called and counted, where the feet are, when to rest, and what imprecise people keep."""
SHOWN = (
    *(N_("pelvis"), N_("trunk and head")),
    *(N_("left thigh"), N_("left shank"), N_("left foot"), N_("left upper arm"), N_("left forearm and hand")),
    *(N_("right thigh"), N_("right shank"), N_("right foot"), N_("right upper arm"), N_("right forearm and hand")),
    *(N_("left shoulder"), N_("left elbow"), N_("left wrist"), N_("left knee")),
    *(N_("right shoulder"), N_("right elbow"), N_("right wrist"), N_("right knee")),
    *(N_("higher"), N_("lower"), N_("further to your left"), N_("further to your right")),
    *(N_("left arm lifted"), N_("left elbow bent"), N_("left hip bent"), N_("left knee bent")),
    *(N_("right arm lifted"), N_("right elbow bent"), N_("right hip bent"), N_("right knee bent")),
)
"""Names that the page's script takes from its data."""
_SAID = re.compile(r'\bsay\(\s*"((?:[^"\\]|\\.)*)"')


def posture_said(name: str, say: "Say") -> str:
    """Return the ``name`` of a posture, its parts (`posture_phrases`) said one by one."""
    return ", ".join(say(part) for part in name.split(", "))


def script_words(scripts: Iterable[str], translated: Callable[[str], str]) -> dict[str, str]:
    """Return what ``scripts`` say, and the names in their data, each beside its translation, places left open."""
    return {text: translated(text) for script in scripts for text in (*_SAID.findall(script), *SHOWN)}
