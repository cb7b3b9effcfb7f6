"""A dance for a robot, from its URDF file to the numbers of the finished dance."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from biodance.body.body import Body
from biodance.body.standing_frames import standing_frames
from biodance.body.urdf import read_urdf
from biodance.dance.limits import Limit
from biodance.dance.problem.person import PersonLimits
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.shapes import unchecked_pairs
from biodance.dance.robot import design_robot, expect_robot, robot_plan
from biodance.errors import BiodanceError
from biodance.pipeline.dance import DanceResult, Makers, Tell, make_dance

ROBOTS = Makers(design_robot, expect_robot)


def robot_dancer(path: Path, feet: str) -> Body:
    """Return the robot of a URDF file, in standing frames; ``feet`` the links of its right and left foot, "right,left".

    Raises
    ------
    BiodanceError
        Not two feet are named, or the file cannot be used (`urdf.read_urdf`, `standing_frames`).
    """
    names = [name.strip() for name in feet.split(",")]
    if len(names) != 2 or names[0] == names[1] or not all(names):
        raise BiodanceError(f"--feet {feet}: expected the links of the right and the left foot, separated by a comma.")
    return standing_frames(read_urdf(path, feet=(names[0], names[1])))


def make_robot_dance(
    body: Body,
    plan: Plan,
    person: PersonLimits,
    *,
    limits: Iterable[Limit | type[Limit]] = (),
    seed: int = 0,
    tell: Tell = lambda *_: None,
    resume: Path | None = None,
) -> DanceResult:
    """Design, check and count a dance for a robot (`robot_dancer`), with the limits of ``person`` beyond those of its file.

    See `dance.make_dance`.

    Raises
    ------
    BiodanceError
        The protocol is not one for robots.
    """
    found = make_dance(body, robot_plan(body, plan), person, limits=limits, seed=seed, tell=tell, resume=resume, makers=ROBOTS)
    coarse = unchecked_pairs(body)
    words = (f"Not kept apart, since their boxes overlap at zero angles: {', '.join(coarse)}.",) if coarse else ()
    return replace(found, notes=(*body.notes, *words, *found.notes))
