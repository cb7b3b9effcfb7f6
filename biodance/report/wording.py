"""How numbers and sentences are put before a person."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from biodance.diagnosis.diagnosis import ABOUT, Verdict
from biodance.display import SHOWN_UNITS, cause_in_words, spaced
from biodance.identification.knowledge import SIGMAS
from biodance.records import grouped
from biodance.records.attention import Attention, told_together

_ABSURD = 30.0  # Typical sizes above which a size from which something is seen means never
NEVER = "never"
"""Said of such a size."""
DIAGNOSED: Mapping[Verdict, str] = {
    "nothing wrong": "found nothing wrong",
    "named, complete": "named the causes of all that it found",
    "named, incomplete": "named causes of some of what it found, and left other differences without a cause",
    "unexplained": "found differences for which it could name no cause",
}
"""What a diagnosis came to, by its verdict."""
IN_SHORT: Mapping[Verdict, str] = {
    "named, complete": "cause found",
    "named, incomplete": "cause found, more is open",
    "unexplained": "cause not known",
}
"""The same in a cell of a table, where the verdict itself does not say it."""
_NAMED = 6  # Targets of a cause that are listed by name


def format_number(value: float | None, digits: int = 1) -> str:
    """Return a number as text with a true minus sign; "–" where it is unknown."""
    if value is None or not math.isfinite(value):
        return "–"
    # what rounds to zero has no sign
    text = f"{value:.{digits}f}"
    return text.replace("-", "−") if float(text) else text.lstrip("-")


def signed(value: float, digits: int = 1) -> str:
    """Return a number with its sign, nothing of which has one."""
    text = format_number(value, digits)
    return f"+{text}" if value > 0 and float(text) else text


def millimetres(value: float | None, digits: int = 1) -> str:
    """Return metres as text in millimetres; templates choose the ``digits``: ``value|mm(0)``."""
    return format_number(None if value is None else 1000 * value, digits)


def moment(created: str) -> str:
    """Return a time (ISO 8601, UTC, to the second) as a person writes it: ``2026-11-25 18:51 UTC``."""
    return f"{created[:10]} {created[11:16]} UTC"


def sized(value: float, unit: str) -> str:
    """Return a number with its unit as a person says it, with three significant digits at most: 0.02 m is 20 mm."""
    return "no size" if value == float("inf") else " ".join(filter(None, _shown(value, unit)))


def changed(value: float, unit: str) -> str:
    """Return a difference as a person says it, with its sign: 0.016 m is +16 mm."""
    return f"{'+' if value > 0 else ''}{sized(value, unit)}"


def sized_together(values: Iterable[float | None], unit: str, between: str, *, signed: bool = False) -> str:
    """Return numbers with their unit once, a dash for None: ``1057, –, 1221 mm``, ``signed`` ``+142 to +186 mm``."""
    found = ["–" if one is None else f"{'+' * (signed and one > 0)}{_shown(one, unit)[0]}" for one in values]
    return f"{between.join(found)} {_shown(0.0, unit)[1]}".strip()


def _shown(value: float, unit: str) -> tuple[str, str]:
    """Return a number and its unit as a person says them."""
    factor, name, digits = SHOWN_UNITS.get(unit, (1.0, unit, 4 if unit == "kg·m²" else 2))
    shown = factor * value
    # three significant digits: a number of the order 10^n shows 2 - n of them behind the point
    large = math.floor(math.log10(abs(shown))) if shown and math.isfinite(shown) else 0
    return format_number(shown, max(0, min(digits, 2 - large))), name


def small(value: float) -> str:
    """Return a probability as text, however small."""
    return format_number(value, 3) if value >= 0.001 else "below 0.001"


def share_of(part: float) -> str:
    """Return a share (0 to 1) in per cent; what is small is not said to be nothing."""
    return "less than 1 %" if 0 < part < 0.01 else f"{format_number(100 * part, 0)} %"


def parted_gain(gain: dict[str, dict[str, Any] | None]) -> str:
    """Return what the table gets wrong in a trial (``gain`` of a validation): mass, distribution, and what moves
    otherwise than a body of rigid segments.
    """
    # each with its 95 % interval: 3.6 % (1.2 to 5.9)
    mass, spread, tissue = (
        f"{format_number(100 * share['value'])} %"
        + (f" ({' to '.join(format_number(100 * x) for x in share['ci95'])})" if share["ci95"] else "")
        if share
        else ""
        for share in (gain["mass"], gain["distribution"], gain["tissue"])
    )
    told = f"of the table's difference {mass} is the wrong mass, and of the rest {spread} how it is distributed"
    if not gain["tissue"]:
        return told
    # what does not surely help explains nothing; without an interval (few blocks) the value counts
    if (gain["tissue"]["ci95"] or [gain["tissue"]["value"]])[0] <= 0:
        return f"{told}; what the fitted trials tell of skin, flesh and joints explains nothing of what is then left"
    moving = "skin, flesh and joints that move otherwise than the model, by what the fitted trials tell of them"
    return f"{told}; of what is then left {tissue} {moving}"


def causes_by_effect(causes: Iterable[tuple[str, str]]) -> str:
    """Return causes by effect, the first targets by name: ``marker misplaced (C7, CLAV and 3 more)``."""
    out = []
    for effect, of in grouped((spaced(effect), cause_in_words("", target)) for effect, target in causes).items():
        more = f" and {len(of) - _NAMED} more" if len(of) > _NAMED else ""
        out.append(effect + (f" ({', '.join(of[:_NAMED])}{more})" if of[0] else ""))
    return "; ".join(out)


def sizes_in_words(parameters: dict[str, dict[str, Any]]) -> str:
    """Return the parameters of a finding (its JSON) with their 95 % intervals; three axes as one vector."""
    vectors = {name: row for name, row in parameters.items() if isinstance(row["value"], list)}
    rows = {name: row for name, row in parameters.items() if name.rpartition("_")[0] not in vectors}
    return ", ".join(f"{spaced(name)} {_size_in_words(row)}" for name, row in rows.items())


def _size_in_words(row: dict[str, Any]) -> str:
    """Return a value, or three, with half their 95 % intervals and unit: ``−19, −186, −28 ± 41, 75, 40 mm``."""
    factor, unit, digits = SHOWN_UNITS.get(row["unit"], (1.0, row["unit"], 2))
    parts = [(row["value"], factor), (row["sd"], SIGMAS * factor)]
    several = [(one if isinstance(one, list) else [one], scale) for one, scale in parts]
    said = [", ".join(format_number(scale * x, digits) for x in part if x is not None) for part, scale in several]
    return f"{' ± '.join(filter(None, said))} {unit}".strip()


def size_seen(value: float | None, typical: float, unit: str) -> str:
    """Return a size from which a cause is seen or told as a person says it: 12 mm, or never."""
    return NEVER if value is None or not value < _ABSURD * typical else sized(value, unit)


def loud_and_noted(found: Iterable[Attention]) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Return where and what of the sentences that somebody must look at, and of the notes, without the headline."""
    lines = [one for one in told_together(found) if one.about != ABOUT]
    loud, noted = (
        [(trial_and_subject(one), one.text) for one in lines if (one.level == "note") == note] for note in (False, True)
    )
    return loud, noted


def headline_of(found: Iterable[Attention]) -> Attention | None:
    """Return the sentence that says the verdict; None without one."""
    return next((one for one in found if one.about == ABOUT), None)


def trial_and_subject(one: Attention) -> str:
    """Return where a sentence belongs, to stand before it: file, check and trial, step, or trial."""
    about = spaced(one.about)
    if one.trial and about in ("", "file"):
        return one.trial if about else f"Trial {one.trial}"
    place = f", {one.trial}" if one.trial else ""
    return f"{about[:1].upper()}{about[1:]}{place}" or "Session"
