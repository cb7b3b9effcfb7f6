"""The page for the person who was measured: plain words, ranges first, at most two A4 pages; computes nothing."""

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from biodance.body.body import Body
from biodance.cycles.cut import PERCENT
from biodance.cycles.summary import KeySummary, Repetitions
from biodance.display import BLACK, BLUE, GREY, spaced
from biodance.pipeline import movement
from biodance.pipeline.still import silhouettes
from biodance.records import SIDES, Array
from biodance.report.figures import vector as svg
from biodance.report.pages.language import ENGLISH, N_, Language, read_language
from biodance.report.pages.template import render, template_text

_TITLES = {"squat": N_("How you squatted"), "sit_to_stand": N_("How you stood up"), "jump": N_("How you jumped")}
_SIDES = {"right": N_("Right"), "left": N_("Left")}


def plain_movement(found: Repetitions, words: Language) -> dict[str, Any]:
    """Return how somebody moved: ``title``, sentences ``said``, ``rows`` (what, left, right), ``picture``."""
    if found.kind == "gait":
        title = words.say("How you ran") if found.runs else words.say("How you walked")
        said, rows = _walk(found, words), _steps(found, words)
    else:
        title, said, rows = words.say(_TITLES[found.kind]), _counted(found, words), []
    keys = {one.name: one for one in found.keys}
    knee = keys.get("knee_flexion_maximum")
    if knee is not None and knee.right is not None and knee.left is not None:
        said = [*said, _knees(knee, words)]
        left, right = (words.say("%(number)s degrees", number=words.number(x.mean)) for x in (knee.left, knee.right))
        rows = [*rows, (words.say("How far the knee bends"), left, right)]
    return {"title": title, "said": said, "rows": rows, "picture": _knee_curves(found, words)}


def _counted(found: Repetitions, words: Language) -> list[str]:
    number = len(found.good)
    if found.kind == "squat":
        return [words.count("We saw %(number)s squat.", "We saw %(number)s squats.", number)]
    if found.kind == "jump":
        height = words.number(100 * found.spatiotemporal()["height"].mean)
        return [
            words.count("We saw %(number)s jump.", "We saw %(number)s jumps.", number),
            words.say("You went %(height)s cm up after your feet left the ground.", height=height),
        ]
    return [
        words.count(
            "We saw you stand up from the chair %(number)s time.",
            "We saw you stand up from the chair %(number)s times.",
            number,
        )
    ]


def _walk(found: Repetitions, words: Language) -> list[str]:
    values, counts = found.spatiotemporal(), [sum(one.side == side for one in found.good) for side in SIDES]
    if "speed" not in values:
        return []
    ran = N_("You ran %(speed)s metres in a second. That is %(pace)s kilometres an hour.")
    walked = N_("You walked %(speed)s metres in a second. That is %(pace)s kilometres an hour.")
    speed, (right, left) = values["speed"].mean, (words.number(one) for one in counts)
    return [
        words.say(ran if found.runs else walked, speed=words.number(speed, 1), pace=words.number(3.6 * speed, 1)),
        words.say("You made %(number)s steps in a minute.", number=words.number(values["cadence"].mean)),
        words.say("Steps we looked at: %(right)s with the right foot, %(left)s with the left.", right=right, left=left),
    ]


def _steps(found: Repetitions, words: Language) -> list[tuple[str, str, str]]:
    """Return the length of a step and the time on the ground of both feet."""
    left, right = (found.spatiotemporal(side) for side in ("left", "right"))
    rows = []
    for name, what, factor, sized in (
        ("step_length", N_("How long a step is"), 100.0, N_("%(number)s cm")),
        ("stance", N_("How long the foot is on the ground, out of each stride"), 1.0, N_("%(number)s %%")),
    ):
        if name in left and name in right:
            one, other = (words.say(sized, number=words.number(factor * side[name].mean)) for side in (left, right))
            rows.append((words.say(what), one, other))
    return rows


def _knees(knee: KeySummary, words: Language) -> str:
    """Say whether the knees bend alike, as far as the repetitions tell."""
    if knee.ci95 is None:
        return words.say("There were too few of them to say if your two knees bend equally far.")
    if knee.ci95[0] <= 0 <= knee.ci95[1]:
        return words.say("We see no sure difference in how far your two knees bend.")
    size = abs(knee.difference)
    if size < 0.5:
        return words.say("Your two knees bend equally far, to less than one degree.")
    right = N_("Your right knee bends %(number)s degrees more than the other one.")
    left = N_("Your left knee bends %(number)s degrees more than the other one.")
    return words.say(right if knee.difference > 0 else left, number=words.number(size))


def _knee_curves(found: Repetitions, words: Language) -> str:
    """Return the mean bend of both knees; "" where one of them is not known."""
    means = {one.side: one.mean for one in found.groups if one.quantity == "knee_flexion"}
    if set(means) < set(SIDES) or not all(np.isfinite(one).any() for one in means.values()):
        return ""
    gait = found.kind == "gait"
    along = words.say("from one step to the next of the same foot") if gait else words.say("from start to end")
    x = svg.Axis(0.0, 100.0, along, ())
    y = svg.around(np.concatenate(list(means.values())), least=20.0, label=words.say("bend of the knee (degrees)"))
    looks = svg.SIDE_STROKES
    marks = [svg.curve_line(x, y, PERCENT, means[side], looks[side], name=words.say(_SIDES[side])) for side in SIDES]
    about = words.say("How far each knee bends, right and left.")
    return svg.panel(x, y, marks, about, frame=svg.Frame(width=480.0, height=150.0))


_SPREAD = {"shoulder_adduction": -0.35, "hip_adduction": -0.1}
"""rad: arms and legs a little away from the body, so that no part hides another."""


@dataclass(frozen=True)
class _Room:
    """mm (of a body of 1.75 m) to the ``column`` of labels, between two, to the edge (``half``), and of ``letters``."""

    column: float = 620
    step: float = 130
    half: float = 1350
    letters: float = 50


_WIDE, _PHONE = _Room(), _Room(430, 110, 1150, 85)


def subject_drawing(body: Body, labels: Mapping[str, str], measured: frozenset[str], *, room: _Room = _WIDE) -> str:
    """Draw ``body`` from the front with ``labels`` (segment -> lines); white is what was not ``measured``."""
    front = silhouettes(body, _spread(body), (1.0, 0.0))
    # whole mm, and y downwards as in a picture
    outlines = [(segment, np.rint(1000 * outline * [1, -1])) for segment, (outline,), _ in front]
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
    q[body.nq - len(body.joints) :] = [_SPREAD.get(joint.name.split("_", 1)[1], 0.0) for joint in body.joints]
    return q


def _labels(middles: Mapping[str, Array], labels: Mapping[str, str], room: _Room, *, right: bool) -> list[str]:
    """Return the labels of one side of the body in a column, from the top down, each with a line to its part."""
    own = [name for name in middles if (name.startswith("right") or name == "trunk_head") is right]
    own.sort(key=lambda name: middles[name][1])
    x, anchor, last, found = (-room.column if right else room.column), "end" if right else "start", -np.inf, []
    for name in own:
        # beside its part, or a step below the label before it
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
    movement.WHY_STOPPED: N_("The work was stopped before its end."),
    movement.WHY_NOTHING: N_("No test of yours shows well enough what each part of your body weighs."),
    movement.WHY_IMPOSSIBLE: N_("The numbers did not fit any real body. So something went wrong in the test."),
    movement.WHY_DOUBTED: N_("The small balls on your skin did not show clearly where your joints are."),
    movement.WHY_FAULTY: N_("We could not be sure that everything in the recording was right."),
    "mass on the plates": N_("The weight on our plates differed from the weight that we wrote down."),
    "centre of mass off": N_("The plates and the cameras did not agree on where you stood."),
    "marker distance": N_("The small balls on your skin did not fit our model of your body."),
    "markers not seen": N_("The cameras lost sight of some of the small balls on your skin for too long."),
    "fully measured": N_("Your feet were on our plates for too short a time."),
    "force difference": N_("The force on the plates did not fit the way you moved."),
}
"""Reason for withholding, by its beginning -> a sentence for the subject."""
_ELSE = N_("One of our checks failed.")


def kilograms(part: movement.PartMass, words: Language) -> str:
    """Return the range of a part; "not measured well" where there is none."""
    return _between(part.low, part.high, words) if part.measured else words.say("not measured well")


def subject_page(account: movement.SubjectAccount, language: str | Path = ENGLISH) -> str:
    """Return the page as HTML text in a ``language`` of `read_language`; the same account gives the same characters."""
    from markupsafe import Markup

    visit, words = account.visit, read_language(language)
    whom = visit.operator or visit.lab or words.say("the lab")
    if visit.operator and visit.lab:
        whom = words.say("%(person)s at %(lab)s", person=visit.operator, lab=visit.lab)
    why = [next((text for start, text in _WHY.items() if one.startswith(start)), _ELSE) for one in account.withheld]
    facts = ((N_("Lab"), visit.lab), (N_("Done by"), visit.operator), (N_("Date"), words.date(visit.date)))
    return render(
        "subject.html.j2",
        style=Markup(template_text("subject.css")),
        language=words.tag,
        say=words.say,
        account=account,
        moved=plain_movement(account.moved, words) if account.moved else None,
        facts=[(words.say(what), value) for what, value in facts if value],
        who=whom,
        parts=[(_name(part, words), kilograms(part, words), part) for part in account.parts],
        picture=_picture(account, words, _WIDE),
        small_picture=_picture(account, words, _PHONE),
        weight=_between(*account.weight, words) if np.isfinite(account.weight[0]) else "",
        together=(_name(account.together, words), kilograms(account.together, words)) if account.together else None,
        reasons=tuple(words.say(one) for one in dict.fromkeys(why)),
    )


def _picture(account: movement.SubjectAccount, words: Language, room: _Room) -> str:
    """Return the address of the picture, "" without a body; on a phone the parts have no names: the table has."""
    if account.body is None or not account.parts:
        return ""
    ranges = {part.segments[0]: kilograms(part, words) for part in account.parts}
    names = {part.segments[0]: f"{_name(part, words)}\n" if room is _WIDE else "" for part in account.parts}
    measured = frozenset(p.segments[0] for p in account.parts if p.measured)
    labels = {segment: names[segment] + said for segment, said in ranges.items()}
    drawn = subject_drawing(account.body, labels, measured, room=room)
    return "data:image/svg+xml;base64," + b64encode(drawn.encode()).decode("ascii")


def _name(part: movement.PartMass, words: Language) -> str:
    *first, last = [words.say(PLAIN_NAMES[one]) if one in PLAIN_NAMES else spaced(one) for one in part.segments]
    return words.say("%(first)s and %(last)s", first=", ".join(first), last=last) if first else last


def _between(low: float, high: float, words: Language) -> str:
    """Return a range rounded outwards, so that it holds at least what was found."""
    least, most = np.floor(10 * low) / 10, np.ceil(10 * high) / 10
    return words.say("%(low)s to %(high)s kg", low=words.number(least, 1), high=words.number(most, 1))
