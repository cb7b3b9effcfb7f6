"""How the person who was measured moved, in plain words with one picture; computes nothing."""

from typing import Any

import numpy as np

from biodance.cycles.cut import PERCENT
from biodance.cycles.summary import KeySummary, Repetitions
from biodance.records import SIDES
from biodance.report.figures.vector import LEFT_SIDE, RIGHT_SIDE, Axis, Frame, around, curve_line, panel
from biodance.report.pages.language import N_, Language

_TITLES = {"squat": N_("How you squatted"), "sit_to_stand": N_("How you stood up"), "jump": N_("How you jumped")}
_SIDES = {"right": N_("Right"), "left": N_("Left")}


def plain_movement(found: Repetitions, words: Language) -> dict[str, Any]:
    """Return how somebody moved, by all good repetitions of one kind: ``title``, sentences ``said``, ``rows`` (what,
    left, right), ``picture`` as SVG ("" none).
    """
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
    return {"title": title, "said": said, "rows": rows, "picture": _picture(found, words)}


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
    went = (
        N_("You ran %(speed)s metres in a second. That is %(pace)s kilometres an hour.")
        if found.runs
        else N_("You walked %(speed)s metres in a second. That is %(pace)s kilometres an hour.")
    )
    speed, (right, left) = values["speed"].mean, (words.number(one) for one in counts)
    return [
        words.say(went, speed=words.number(speed, 1), pace=words.number(3.6 * speed, 1)),
        words.say("You made %(number)s steps in a minute.", number=words.number(values["cadence"].mean)),
        words.say(
            "We looked at %(right)s steps with the right foot and %(left)s with the left.", right=right, left=left
        ),
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
        return words.say("Your two knees bend equally far, as well as we can tell.")
    size = abs(knee.difference)
    if size < 0.5:
        return words.say("Your two knees bend equally far, to less than one degree.")
    if knee.difference > 0:
        more = N_("Your right knee bends %(number)s degrees more than the other one.")
    else:
        more = N_("Your left knee bends %(number)s degrees more than the other one.")
    return words.say(more, number=words.number(size))


def _picture(found: Repetitions, words: Language) -> str:
    """Return the mean bend of both knees; "" where one of them is not known."""
    means = {one.side: one.mean for one in found.groups if one.quantity == "knee_flexion"}
    if set(means) < set(SIDES) or not all(np.isfinite(one).any() for one in means.values()):
        return ""
    gait = found.kind == "gait"
    along = words.say("from one step to the next of the same foot") if gait else words.say("from start to end")
    x = Axis(0.0, 100.0, along, ())
    y = around(np.concatenate(list(means.values())), least=20.0, label=words.say("bend of the knee (degrees)"))
    looks = {"right": RIGHT_SIDE, "left": LEFT_SIDE}
    marks = [curve_line(x, y, PERCENT, means[side], looks[side], name=words.say(_SIDES[side])) for side in SIDES]
    about = words.say("How far each knee bends, right and left.")
    return panel(x, y, marks, about, frame=Frame(width=480.0, height=150.0))
