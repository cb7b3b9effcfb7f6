"""The page for the person who was measured: plain words, ranges first, at most two A4 pages; computes nothing."""

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.display import BLACK, BLUE, GREY, spaced
from biodance.lab.session.file import VisitEntry
from biodance.pipeline import for_subject
from biodance.pipeline.for_subject import PartMass, SubjectAccount
from biodance.pipeline.still import silhouettes
from biodance.records import Array
from biodance.report.pages.language import ENGLISH, N_, Language, read_language
from biodance.report.pages.subject_movement import plain_movement
from biodance.report.pages.template import render, template_text

_SPREAD = {"shoulder_adduction": -0.35, "hip_adduction": -0.1}
"""rad: arms and legs a little away from the body, so that no part hides another."""


@dataclass(frozen=True)
class _Room:
    """mm (of a body of 1.75 m) from the middle to the ``column`` of labels, between two of them, to the picture's edge
    (``half``), and the size of the ``letters``.
    """

    column: float = 620
    step: float = 130
    half: float = 1350
    letters: float = 50


_WIDE, _PHONE = _Room(), _Room(430, 110, 1150, 85)


def subject_drawing(body: Body, labels: Mapping[str, str], measured: frozenset[str], *, room: _Room = _WIDE) -> str:
    """Draw ``body`` from the front, its right side on the left, as SVG text; ``labels`` (segment -> lines of text)
    beside it, in the ``room`` they have; segments in ``measured`` are filled, the others white with a broken outline.
    """
    front = silhouettes(body, _spread(body), (1.0, 0.0))
    outlines = [(segment, np.rint(1000 * outline * [1, -1])) for segment, outline, _ in front]
    marks = [_part(outline, known=segment in measured) for segment, outline in outlines]
    middles = {segment: outline.mean(axis=0) for segment, outline in reversed(outlines)}
    for right in (True, False):
        marks += _labels({name: at for name, at in middles.items() if name in labels}, labels, room, right=right)
    heights = np.concatenate([outline[:, 1] for _, outline in outlines])
    low, high, half, letters = heights.min() - room.letters, heights.max() + room.letters, room.half, room.letters
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{-half} {low:g} {2 * half} {high - low:g}" '
        f'width="{2 * half}" height="{high - low:g}" font-family="sans-serif" font-size="{letters}">'
        f"{''.join(marks)}</svg>"
    )


def _part(outline: Array, *, known: bool) -> str:
    """Return the polygon of a part with the outline (n, 2) mm."""
    look = f'fill="{BLUE}" opacity="0.45" stroke="{BLACK}"' if known else f'{_BROKEN} stroke="{GREY}"'
    return f'<polygon points="{" ".join(f"{x:g},{y:g}" for x, y in outline)}" {look} stroke-width="5"/>'


_BROKEN = 'fill="white" stroke-dasharray="18 10"'


def _spread(body: Body) -> Array:
    """Return the posture (nq,) with arms and legs a little away from the body."""
    q = np.array(body.neutral)
    for i, joint in enumerate(body.joints):
        q[body.nq - len(body.joints) + i] = _SPREAD.get(joint.name.split("_", 1)[1], 0.0)
    return q


def _labels(middles: Mapping[str, Array], labels: Mapping[str, str], room: _Room, *, right: bool) -> list[str]:
    """Return the labels of one side of the body in a column, from the top down, each with a line to its part."""
    own = [name for name in middles if (name.startswith("right") or name == "trunk_head") is right]
    own.sort(key=lambda name: middles[name][1])
    x, anchor, last, found = (-room.column if right else room.column), "end" if right else "start", -np.inf, []
    for name in own:
        last = max(float(middles[name][1]), last + room.step)
        to, lines = middles[name], labels[name].split("\n")
        found.append(f'<path d="M{x * 0.98:g} {last:g}L{to[0]:g} {to[1]:g}" stroke="{GREY}" stroke-width="4"/>')
        for k, line in enumerate(lines):
            down = last + room.letters * (1.15 * (k - len(lines) / 2) + 0.9)
            found.append(f'<text x="{x}" y="{down:g}" text-anchor="{anchor}">{escape(line)}</text>')
    return found


PLAIN_NAMES = {
    "pelvis": N_("hips"),
    "right_thigh": N_("right thigh"),
    "right_shank": N_("right lower leg"),
    "right_foot": N_("right foot"),
    "left_thigh": N_("left thigh"),
    "left_shank": N_("left lower leg"),
    "left_foot": N_("left foot"),
    "trunk_head": N_("chest, belly and head"),
    "right_upper_arm": N_("right upper arm"),
    "right_forearm_hand": N_("right lower arm and hand"),
    "left_upper_arm": N_("left upper arm"),
    "left_forearm_hand": N_("left lower arm and hand"),
}
_WHY = {
    for_subject.WHY_STOPPED: N_("The work was stopped before its end."),
    for_subject.WHY_NOTHING: N_("We have no test in which you moved while both feet were on our plates."),
    for_subject.WHY_IMPOSSIBLE: N_("The numbers did not fit any real body. So something went wrong in the test."),
    for_subject.WHY_DOUBTED: N_("The small balls on your skin did not tell us well where your joints are."),
    for_subject.WHY_FAULTY: N_("The plates and the cameras did not agree. We must first find out why."),
    "mass on the plates": N_("The weight on our plates was not the weight we wrote down."),
    "centre of mass off": N_("The plates and the cameras did not agree on where you stood."),
    "marker distance": N_("The small balls on your skin were not where our model of you had them."),
    "posture left open": N_("The cameras could not see all parts of you all the time."),
    "markers not seen": N_("The cameras lost some of the small balls on your skin for too long."),
    "fully measured": N_("You had both feet on our plates for too short a time."),
    "force difference": N_("The push on the plates was not what your moves should give."),
}
"""Reason for withholding, by its beginning -> a sentence for the subject."""
_ELSE = N_("One of our checks failed.")


def plain_reasons(reasons: tuple[str, ...], words: Language) -> tuple[str, ...]:
    """Return sentences for the subject, each once."""
    said = [next((text for start, text in _WHY.items() if one.startswith(start)), _ELSE) for one in reasons]
    return tuple(words.say(one) for one in dict.fromkeys(said))


def kilograms(part: PartMass, words: Language) -> str:
    """Return the range of a part; "not measured well" where there is none."""
    return _between(part.low, part.high, words) if part.measured else words.say("not measured well")


def subject_page(account: SubjectAccount, language: str | Path = ENGLISH) -> str:
    """Return the page as HTML text in a ``language`` of `read_language`; the same account gives the same characters."""
    from markupsafe import Markup

    visit, words = account.visit, read_language(language)
    facts = ((N_("Lab"), visit.lab), (N_("Done by"), visit.operator), (N_("Date"), words.date(visit.date)))
    return render(
        "subject.html.j2",
        style=Markup(template_text("subject.css")),
        language=words.tag,
        say=words.say,
        account=account,
        moved=plain_movement(account.moved, words) if account.moved else None,
        facts=[(words.say(what), value) for what, value in facts if value],
        who=_whom_to_ask(visit, words),
        parts=[(_name(part, words), kilograms(part, words), part) for part in account.parts],
        picture=_picture(account, words, _WIDE),
        small_picture=_picture(account, words, _PHONE),
        weight=_between(*account.weight, words) if np.isfinite(account.weight[0]) else "",
        together=(_name(account.together, words), kilograms(account.together, words)) if account.together else None,
        reasons=plain_reasons(account.withheld, words),
    )


def _whom_to_ask(visit: VisitEntry, words: Language) -> str:
    if visit.operator and visit.lab:
        return words.say("%(person)s at %(lab)s", person=visit.operator, lab=visit.lab)
    return visit.operator or visit.lab or words.say("the lab")


def _picture(account: SubjectAccount, words: Language, room: _Room) -> str:
    """Return the address of the picture, "" without a body; on a phone the parts have no names: the table has."""
    if account.body is None or not account.parts:
        return ""
    ranges = {part.segments[0]: kilograms(part, words) for part in account.parts}
    names = {part.segments[0]: f"{_name(part, words)}\n" if room is _WIDE else "" for part in account.parts}
    measured = frozenset(p.segments[0] for p in account.parts if p.measured)
    labels = {segment: names[segment] + said for segment, said in ranges.items()}
    drawn = subject_drawing(account.body, labels, measured, room=room)
    return "data:image/svg+xml;base64," + b64encode(drawn.encode()).decode("ascii")


def _name(part: PartMass, words: Language) -> str:
    *first, last = [words.say(PLAIN_NAMES[one]) if one in PLAIN_NAMES else spaced(one) for one in part.segments]
    return words.say("%(first)s and %(last)s", first=", ".join(first), last=last) if first else last


def _between(low: float, high: float, words: Language) -> str:
    """Return a range rounded outwards, so that it holds at least what was found."""
    least, most = np.floor(10 * low) / 10, np.ceil(10 * high) / 10
    return words.say("%(low)s to %(high)s kg", low=words.number(least, 1), high=words.number(most, 1))
