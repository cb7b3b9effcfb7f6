"""The page for the person who was measured: plain words, ranges first, at most two A4 pages; computes nothing."""

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape

import numpy as np

from biodance.body.body import Body
from biodance.display import BLACK, BLUE, GREY, spaced
from biodance.pipeline import for_subject
from biodance.pipeline.for_subject import PartMass, SubjectAccount
from biodance.pipeline.still import silhouettes
from biodance.records import Array
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
    "pelvis": "hips",
    "right_thigh": "right thigh",
    "right_shank": "right lower leg",
    "right_foot": "right foot",
    "left_thigh": "left thigh",
    "left_shank": "left lower leg",
    "left_foot": "left foot",
    "trunk_head": "chest, belly and head",
    "right_upper_arm": "right upper arm",
    "right_forearm_hand": "right lower arm and hand",
    "left_upper_arm": "left upper arm",
    "left_forearm_hand": "left lower arm and hand",
}
_WHY = {
    for_subject.WHY_STOPPED: "The work was stopped before its end.",
    for_subject.WHY_NOTHING: "We have no test in which you moved while both feet were on our plates.",
    for_subject.WHY_IMPOSSIBLE: "The numbers did not fit any real body. So something went wrong in the test.",
    for_subject.WHY_DOUBTED: "The small balls on your skin did not tell us well where your joints are.",
    for_subject.WHY_FAULTY: "The plates and the cameras did not agree. We must first find out why.",
    "mass on the plates": "The weight on our plates was not the weight we wrote down.",
    "centre of mass off": "The plates and the cameras did not agree on where you stood.",
    "marker distance": "The small balls on your skin were not where our model of you had them.",
    "posture left open": "The cameras could not see all parts of you all the time.",
    "markers not seen": "The cameras lost some of the small balls on your skin for too long.",
    "fully measured": "You had both feet on our plates for too short a time.",
    "force difference": "The push on the plates was not what your moves should give.",
}
"""Reason for withholding, by its beginning -> a sentence for the subject."""
_ELSE = "One of our checks failed."


def plain_reasons(reasons: tuple[str, ...]) -> tuple[str, ...]:
    """Return sentences for the subject, each once."""
    said = [next((text for start, text in _WHY.items() if one.startswith(start)), _ELSE) for one in reasons]
    return tuple(dict.fromkeys(said))


def kilograms(part: PartMass) -> str:
    """Return the range of a part; "not measured well" where there is none."""
    return _between(part.low, part.high) if part.measured else "not measured well"


def subject_page(account: SubjectAccount) -> str:
    """Return the page as HTML text; the same account gives the same characters."""
    from markupsafe import Markup

    visit = account.visit
    return render(
        "subject.html.j2",
        style=Markup(template_text("subject.css")),
        account=account,
        moved=plain_movement(account.moved) if account.moved else None,
        facts=[
            (what, str(value)[:10] if what == "Date" else value)
            for what, value in (("Lab", visit.lab), ("Done by", visit.operator), ("Date", visit.date))
            if value
        ],
        parts=[(_name(part), kilograms(part), part) for part in account.parts],
        picture=_picture(account, _WIDE),
        small_picture=_picture(account, _PHONE),
        weight=_between(*account.weight) if np.isfinite(account.weight[0]) else "",
        together=(_name(account.together), kilograms(account.together)) if account.together else None,
        reasons=plain_reasons(account.withheld),
    )


def _picture(account: SubjectAccount, room: _Room) -> str:
    """Return the address of the picture, "" without a body; on a phone the parts have no names: the table has."""
    if account.body is None or not account.parts:
        return ""
    named = room is _WIDE
    labels = {p.segments[0]: f"{_name(p)}\n{kilograms(p)}" if named else kilograms(p) for p in account.parts}
    measured = frozenset(p.segments[0] for p in account.parts if p.measured)
    drawn = subject_drawing(account.body, labels, measured, room=room)
    return "data:image/svg+xml;base64," + b64encode(drawn.encode()).decode("ascii")


def _name(part: PartMass) -> str:
    *first, last = [PLAIN_NAMES.get(name, spaced(name)) for name in part.segments]
    return f"{', '.join(first)} and {last}" if first else last


def _between(low: float, high: float) -> str:
    """Return a range rounded outwards, so that it holds at least what was found."""
    return f"{np.floor(10 * low) / 10:.1f} to {np.ceil(10 * high) / 10:.1f} kg"
