"""A dance for one person or robot, from what is known of it to the numbers of the finished dance, all steps in
order.
"""

import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.human.skeleton import joint_limits
from biodance.body.robot.similarity import standing_frames
from biodance.body.robot.urdf import read_urdf
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.expectation import Expectation, expect
from biodance.dance.limits import Limit
from biodance.dance.performers import OF_PERFORMERS
from biodance.dance.problem.person import PersonLimits, fit_to_person
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.shapes import pairs_of
from biodance.dance.robot import design_robot, expect_robot, robot_plan
from biodance.dance.search.word_course import NoNextPosture, freer_dance
from biodance.dance.verify import Margin, broken, dance_metrics
from biodance.display import cause_in_words
from biodance.errors import BiodanceError
from biodance.pipeline.dance_result import DanceResult
from biodance.records import Subject
from biodance.threads import one_thread

_Tell = Callable[[str, int, int], None]
"""Told what is being done, how many parts are finished and of how many (0: not counted)."""
UNFINISHED = "unfinished"
"""Folder with what is finished of a dance whose design was stopped."""
_OURS = (
    *("results.json", "dance.npz", "dance.c3d", "dance.csv", "cues.md", "cues.html", "margins.md"),
    *("postures.png", "postures_3d.png", "criterion.png", "zmp.png", "expectation.png"),
)
"""Files that a dance consists of."""


_LEGAL = {"mass": (30.0, 200.0, "kg"), "stature": (1.2, 2.2, "m")}


def dancer(subject: Subject, plan: Plan) -> Body:
    """Return the body of a person for whom a dance is designed: a generic one, joints within the ranges that the plan
    names.

    Raises
    ------
    BiodanceError
        Mass or stature are outside the range of the tables.
    """
    for name, (low, high, unit) in _LEGAL.items():
        value = getattr(subject, name)
        if not low <= value <= high:
            raise BiodanceError(
                f"The {name} is {value:g} {unit}; a dance is designed for {low:g} to {high:g} {unit}. Correct it."
            )
    return replace(human(subject), limits=joint_limits(subject, within=plan.ranges))


@one_thread()
def make_dance(
    body: Body,
    plan: Plan,
    person: PersonLimits,
    *,
    subject: Subject | None,
    limits: Iterable[Limit | type[Limit]] = (),
    seed: int = 0,
    tell: _Tell = lambda *_: None,
    resume: Path | None = None,
) -> DanceResult:
    """Design, check and count a dance of ``plan`` for the ``body`` of a ``subject`` (`dancer`), or of a robot (None;
    `robot_dancer`), with the limits of ``person``; ``resume`` keeps what is finished meanwhile.

    ``limits`` are kept beside those of the plan, or in place of one of the same name (`dance.limits`).

    Raises
    ------
    BiodanceError
        The protocol and the person contradict each other (`fit_to_person`), or it is not one for robots.
    """
    started, robot = time.perf_counter(), subject is None
    plan = robot_plan(body, plan) if robot else plan
    own, plan, notes = fit_to_person(body, plan.with_limits(limits), person)
    notes = (*(_robot_notes(body) if robot else ()), *notes)
    reason, margins, dance = "", tuple[Margin, ...](), None
    try:
        dance, margins = (design_robot if robot else design)(own, plan, seed=seed, tell=tell, resume=resume)
    except BiodanceError as error:
        reason = str(error)
    counted = expected = freely = None
    if dance is not None:
        rest = plan.rest if np.isfinite(plan.rest) else None
        dance = replace(dance, plate=plan.plate, subject=subject, care=plan.care, rest=rest)
        tell("counting what the dance tells", 0, 0)
        with ProcessPoolExecutor(1) as aside:
            numbers = aside.submit(dance_metrics, dance, plan)
            free = aside.submit(_freer_expectation, dance, plan)
            expected, counted, freely = (expect_robot if robot else expect)(dance), numbers.result(), free.result()
        reason = " ".join(
            f"The limit on {cause_in_words(m.limit, m.what)} is broken by {-m.worst:.3g} {m.unit} at {m.where_s:.2f} s."
            for m in broken(margins)
            if not m.limit.endswith(OF_PERFORMERS)
        )
    if reason:
        dance = counted = expected = freely = None
    spent = time.perf_counter() - started
    return DanceResult(own, plan, dance, margins, counted, expected, reason, notes, spent, person.reason, freely)


def _robot_notes(body: Body) -> tuple[str, ...]:
    """Return what was made of a robot's file, and which of its parts are not kept apart, in sentences."""
    coarse = pairs_of(body).unchecked
    words = (f"Not kept apart, since their boxes overlap at zero angles: {', '.join(coarse)}.",) if coarse else ()
    return (*body.notes, *words)


def _freer_expectation(dance: Dance, plan: Plan) -> Expectation | None:
    """Return what as many postures chosen freely on the same feet would tell; None where the plan leaves the choice
    free, or there are not as many.
    """
    if not np.isfinite(plan.instructions):
        return None
    try:
        return expect(freer_dance(dance.body, plan, seed=dance.seed, stances=dance.stances), steps=1)
    except NoNextPosture:
        return None


def dance_folder(out: Path, *, force: bool = False) -> Path:
    """Return the folder for a dance, made if missing; with ``force`` it may hold an earlier one.

    A folder that holds nothing but a stopped design is gone on with.

    Raises
    ------
    BiodanceError
        It is a file, holds files already and ``force`` was not given, or holds files that are not of a dance.
    """
    if out.exists() and not out.is_dir():
        raise BiodanceError(f"{out}: is a file; a dance needs a folder. Choose another --out.")
    out.mkdir(parents=True, exist_ok=True)
    found = sorted(path.name for path in out.iterdir() if path.name != UNFINISHED)
    foreign = [name for name in found if name not in _OURS]
    if foreign:
        raise BiodanceError(f"{out}: holds files that are not of a dance ({foreign[0]}). Choose another --out.")
    if found and not force:
        raise BiodanceError(
            f"{out}: holds a dance already and nothing is overwritten. Choose another --out, or --force."
        )
    return out


def robot_dancer(path: Path, feet: str, *, mend: bool = False) -> Body:
    """Return the robot of a URDF file, in standing frames; ``feet`` the links of its right and left foot, "right,left";
    ``mend`` as in `urdf.read_urdf`.

    Raises
    ------
    BiodanceError
        Not two feet are named, or the file cannot be used (`urdf.read_urdf`, `standing_frames`).
    """
    return standing_frames(read_urdf(path, feet=named_feet(feet), mend=mend))


def named_feet(feet: str) -> tuple[str, str]:
    """Return the links of the right and the left foot of "right,left"; BiodanceError if that is not two."""
    names = [name.strip() for name in feet.split(",")]
    if len(names) != 2 or names[0] == names[1] or not all(names):
        raise BiodanceError(f"--feet {feet}: expected the links of the right and the left foot, separated by a comma.")
    return names[0], names[1]
