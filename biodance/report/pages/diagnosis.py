"""The page of a diagnosis for the analyst: what is wrong, how we know, how big, how sure, what else, what to do,
what changes.
"""

import sys
from dataclasses import dataclass
from typing import Any

from biodance.diagnosis.diagnosis import ABOUT, Diagnosis, Estimate
from biodance.diagnosis.heard import Testimony, sights
from biodance.effects import discrete_effects, effects
from biodance.pipeline.diagnosis import SessionDiagnosis
from biodance.pipeline.provenance import Provenance
from biodance.pipeline.results import SessionResult
from biodance.records import CHANNELS
from biodance.report.figures.diagnosis import adequacy_table, left_figure, limits_figure
from biodance.report.pages.template import print_sheet, render, template_text
from biodance.report.wording import format_number, sized, trial_and_subject


@dataclass(frozen=True)
class Words:
    """What a cause is, its signature, its look-alikes and what separates them, each a few sentences."""

    what: str
    signature: str
    alike: str
    separated: str


def words_of(effect: str) -> Words:
    """Return the words of an effect; empty ones for a cause that has no file (any more)."""
    kind = {**effects(), **discrete_effects()}.get(effect)
    text = " ".join(((sys.modules[kind.__module__].__doc__ if kind else "") or "").split())
    what, _, rest = text.partition("Signature:")
    signature, _, rest = rest.partition("Look-alikes:")
    alike, _, separated = rest.partition("Separated by")
    return Words(
        what.strip(), first_upper(signature.strip()), first_upper(alike.strip()), first_upper(separated.strip())
    )


def first_upper(text: str) -> str:
    """Return ``text`` with a capital first letter and nothing else changed."""
    return text[:1].upper() + text[1:]


def named(effect: str, target: str) -> str:
    """Return a cause with its place as words: ``added mass, left forearm hand``."""
    plain = effect.replace("_", " ")
    return f"{plain}, {target.replace('_', ' ').replace('->', ' into ')}" if target else plain


def estimated(one: Estimate) -> str:
    """Return a parameter with its 95 % interval."""
    if one.sd != one.sd:
        return sized(one.value, one.unit)
    low, high = one.interval
    return f"{sized(one.value, one.unit)} (95 % interval {sized(low, one.unit)} to {sized(high, one.unit)})"


_CERTAIN = 14.0
"""Natural logarithm of a million: above it odds are no longer printed."""


def answer(one: Diagnosis) -> str:
    """Return the verdict as one or two plain sentences, with what it rests on."""
    return next((said.text for said in one.attention if said.about == ABOUT), f"{one.told[:1].upper()}{one.told[1:]}.")


def _short_answer(one: Diagnosis) -> str:
    """Return what the section begins with below the verdict, which stands at the top of the page."""
    if one.findings:
        return "What was found, its size, and what to do:"
    return "No cause is named; the verdict stands at the top of this page."


def odds(log_bayes_factor: float) -> str:
    """Return evidence against "nothing wrong" as odds in words."""
    if log_bayes_factor != log_bayes_factor or log_bayes_factor == float("inf"):
        return "a check of the recording shows it"
    if log_bayes_factor > _CERTAIN:
        return "more than a million times as probable as nothing wrong"
    return f"{format_number(2.718281828**log_bayes_factor, 0)} times as probable as nothing wrong"


def diagnosis_section(found: SessionDiagnosis) -> str:
    """Return the section of the session's report on what the simulation gets wrong, as HTML text."""
    from markupsafe import Markup

    one = found.diagnosis
    failures = Markup("").join(
        Markup("<p class='look'><strong>Not solved, {}:</strong> {}</p>").format(what, cause)
        for what, cause in found.failures.items()
    )
    rows = Markup("").join(
        Markup("<tr><th scope='row'>{}</th><td>{}</td><td>{}</td></tr>").format(
            named(f.effect, f.target),
            "; ".join(f"{p.name.replace('_', ' ')} {estimated(p)}" for p in f.parameters),
            f.advice,
        )
        for f in one.findings
    )
    table = Markup("<table><tbody>{}</tbody></table>").format(rows) if one.findings else Markup("")
    return Markup(
        '<section id="wrong"><h2>What the simulation gets wrong</h2><p>{}</p>{}{}'
        "<p class='small'>biodance diagnose says how we know, what else it could be and what accepting it "
        "changes.</p></section>"
    ).format(_short_answer(one), failures, table)


def diagnosis_page(result: SessionResult, found: SessionDiagnosis, provenance: Provenance) -> str:
    """Return the page as HTML text; the same arguments give the same characters."""
    from markupsafe import Markup

    one = found.diagnosis
    masses, made = [], f"biodance {provenance.versions['biodance']}, {provenance.created}"
    if found.before and found.accepted:
        then, now = (
            dict(zip(one.sip.segments, one.sip.mass.tolist(), strict=True)) for one in (found.before, found.accepted)
        )
        masses = [(name.replace("_", " "), then.get(name, float("nan")), mass) for name, mass in now.items()]
    return render(
        "diagnosis.html.j2",
        filters={"sized": sized, "estimated": estimated, "odds": odds, "first_upper": first_upper},
        scripts=[template_text("curves.js")],
        sheet=Markup(print_sheet(f"Session {result.session.folder.name}", provenance.visit, made)),
        named=named,
        words_of=words_of,
        result=result,
        one=one,
        answer=answer(one),
        others=[(trial_and_subject(said), said.text) for said in one.attention if said.about != ABOUT],
        failures={**result.failures, **found.failures},
        provenance=provenance,
        channels=list(zip(CHANNELS, ("N",) * 3 + ("N·m",) * 3, strict=True)),
        masses=masses,
        left=Markup(left_figure(found.left)) if found.left else "",
        adequacy=Markup(adequacy_table(one.adequacy)) if one.adequacy else "",
        limits=Markup(limits_figure(one.limits)) if one.limits else "",
        gain=found.gain,
        witnesses=_witnesses(one.witnesses),
    )


def _witnesses(heard: Testimony | None) -> dict[str, Any] | None:
    """Return the table causes x witnesses with its blind rows in words, and all observations; None without any."""
    if heard is None:
        return None
    rows = sights(heard)
    blind: dict[str, list[str]] = {}
    for row in rows:
        if not row.witnesses:
            blind.setdefault(" ".join(row.would), []).append(named(row.effect, row.target))
    return {
        "names": list(dict.fromkeys(name for row in rows for name in row.witnesses)),
        "seen": [row for row in rows if row.witnesses],
        "blind": [("; ".join(causes), would) for would, causes in blind.items()],
        "observations": sorted(heard.observations, key=lambda one: -abs(one.z)),
    }
