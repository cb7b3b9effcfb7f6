"""How the person who was measured moved, in plain words with one picture; computes nothing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from biodance.cycles.cut import PERCENT
from biodance.cycles.summary import KeySummary, Repetitions
from biodance.records import SIDES
from biodance.report.figures.vector import LEFT_SIDE, RIGHT_SIDE, Axis, Frame, around, curve_line, panel
from biodance.report.wording import format_number


@dataclass(frozen=True)
class PlainMovement:
    """``title``, sentences and rows (what, left, right) for the subject; ``picture`` as SVG, "" for none."""

    title: str
    said: Sequence[str]
    rows: Sequence[tuple[str, str, str]]
    picture: str


_TITLES = {"squat": "How you squatted", "sit_to_stand": "How you stood up"}
_ACTS = {"squat": ("squat", "squats"), "sit_to_stand": ("rise from the chair", "rises from the chair")}


def plain_movement(found: Repetitions) -> PlainMovement:
    """Return how somebody moved, by all good repetitions of one kind."""
    if found.kind == "gait":
        title, said, rows = "How you ran" if found.runs else "How you walked", _walk(found), _steps(found)
    else:
        number, (one, more) = len(found.good), _ACTS[found.kind]
        title, said, rows = _TITLES[found.kind], [f"We saw {number} {one if number == 1 else more}."], []
    keys = {one.name: one for one in found.keys}
    knee = keys.get("knee_flexion_maximum")
    if knee is not None and knee.right is not None and knee.left is not None:
        said = [*said, _knees(knee)]
        left, right = (f"{format_number(one.mean, 0)} degrees" for one in (knee.left, knee.right))
        rows = [*rows, ("How far the knee bends", left, right)]
    return PlainMovement(title, said, rows, _picture(found))


def _walk(found: Repetitions) -> list[str]:
    values, counts = found.spatiotemporal(), [sum(one.side == side for one in found.good) for side in SIDES]
    if "speed" not in values:
        return []
    speed, pace = values["speed"].mean, values["cadence"].mean
    went = "ran" if found.runs else "walked"
    return [
        f"You {went} {format_number(speed, 1)} metres in a second. That is {format_number(3.6 * speed, 1)} kilometres "
        "an hour.",
        f"You made {format_number(pace, 0)} steps in a minute.",
        f"We looked at {counts[0]} steps with the right foot and {counts[1]} with the left.",
    ]


def _steps(found: Repetitions) -> list[tuple[str, str, str]]:
    """Return the length of a step and the time on the ground of both feet."""
    left, right = (found.spatiotemporal(side) for side in ("left", "right"))
    rows = []
    for name, what, factor, unit in (
        ("step_length", "How long a step is", 100.0, "cm"),
        ("stance", "How long the foot is on the ground, out of each stride", 1.0, "%"),
    ):
        if name in left and name in right:
            one, other = (f"{format_number(factor * side[name].mean, 0)} {unit}" for side in (left, right))
            rows.append((what, one, other))
    return rows


def _knees(knee: KeySummary) -> str:
    """Say whether the knees bend alike, as far as the repetitions tell."""
    if knee.ci95 is None:
        return "There were too few of them to say if your two knees bend equally far."
    if knee.ci95[0] <= 0 <= knee.ci95[1]:
        return "Your two knees bend equally far, as well as we can tell."
    more = "right" if knee.difference > 0 else "left"
    size = abs(knee.difference)
    if size < 0.5:
        return "Your two knees bend equally far, to less than one degree."
    return f"Your {more} knee bends {format_number(size, 0)} degrees more than the other one."


def _picture(found: Repetitions) -> str:
    """Return the mean bend of both knees; "" where one of them is not known."""
    means = {one.side: one.mean for one in found.groups if one.quantity == "knee_flexion"}
    if set(means) < set(SIDES) or not all(np.isfinite(one).any() for one in means.values()):
        return ""
    x = Axis(
        0.0, 100.0, "from one step to the next of the same foot" if found.kind == "gait" else "from start to end", ()
    )
    y = around(np.concatenate(list(means.values())), least=20.0, label="bend of the knee (degrees)")
    looks = {"right": RIGHT_SIDE, "left": LEFT_SIDE}
    marks = [curve_line(x, y, PERCENT, means[side], looks[side], name=side) for side in SIDES]
    about = "How far each knee bends over a step, right and left."
    return panel(x, y, marks, about, frame=Frame(width=480.0, height=150.0))
