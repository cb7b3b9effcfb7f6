"""Dances of robots: designed for the robot's person-sized similar model, danced by the robot itself.

All that the design knows of noticeable sizes (scales of the limits, reserves, starts) is that of persons. So a robot is
made as large and as heavy as a person, with all times, speeds and strengths as gravity demands (`body.similar`), its
dance is designed, and shrunk again: the same angles, slower or faster. Nothing is approximated by that, and the dance
is checked on the robot as it is.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from biodance.body.body import Body
from biodance.body.similarity import SimilarityScale, similar_body
from biodance.dance.dance import Dance
from biodance.dance.design import design
from biodance.dance.limits import Margin
from biodance.dance.limits.balance import Balance
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.excitation import excitation_blocks
from biodance.dance.problem.plan import FOLLOWABLE_SHARE, Plan
from biodance.dance.problem.stance import Stance
from biodance.dance.search.course import Tell
from biodance.dance.search.move import Task, exciting_move
from biodance.dance.search.postures import intermediate_posture
from biodance.dance.verify import verify
from biodance.errors import BiodanceError


def reposition(dance: Dance, plan: Plan) -> Dance:
    """Return the dance with the move from rest in front; where there is none, the dance with a note that says so."""
    feet, upright, seed = replace(dance.stances[0], over=None), np.zeros((1, dance.chain.size)), [dance.seed, 4]
    try:
        rest = intermediate_posture(dance.chain, feet, upright, plan.limits, seed=seed, mild=1.0).x
        ends = np.array([rest, dance.postures[0]])
        task = Task(dance.chain, excitation_blocks(dance.body), feet, ends, plan.move, plan.limits)
        move = exciting_move(task, np.zeros((len(dance.body.segments), 6, 6)), seed)
        why = f"the limit {move.limit.replace('_', ' ')} forbids it" if move.limit else ""
    except BiodanceError as error:
        why = str(error)
    if why:
        words = f"The robot must be put into its first posture by hand: there is no way from rest ({why})."
        return replace(dance, notes=(*dance.notes, words))
    more = 1 + len(move.stops)
    return replace(
        dance,
        postures=np.concatenate([rest[None], move.stops, dance.postures]),
        stances=(*(feet,) * more, *dance.stances),
        hold=np.concatenate([np.zeros(more), dance.hold]),
        via=np.concatenate([move.via, dance.via]),
        move=np.concatenate([move.duration, dance.move]),
        under=(*(feet,) * more, *dance.under),
    )


_LEG, MASS = 0.9, 65.0
"""m from hip to sole, kg: the person whose size a robot is given."""
_LIGHTEST = 4.0
"""kg: what lighter robots press on the ground cannot be told from noise (`motion.dynamics.zmp` needs 20 N)."""


def robot_plan(body: Body, plan: Plan) -> Plan:
    """Return the plan for the robot ``body`` (in standing frames): its own time for a move, its own distance between
    the feet.

    Raises
    ------
    BiodanceError
        The plan is one for persons only (on a stool, with hands on a frame), or the robot is too light.
    """
    if plan.seated or plan.holds:
        raise BiodanceError(
            f"Protocol {plan.name}: is danced on a stool or with hands on a frame; a robot dances standing and free."
        )
    weight = float(body.sip.mass.sum())
    if weight < _LIGHTEST:
        raise BiodanceError(
            f"{body.name}: weighs {weight:.2f} kg; a dance is designed for robots of {_LIGHTEST:g} kg and more."
        )
    usual = float(np.median(body.limits.velocity))
    # 0.1 m ahead, of legs of 0.25 m (paper III.D)
    ahead = float(np.clip(plan.forward * 2.0 * leg_length(body), 0.05, 0.4))
    free: dict[str, Any] = {"instructions": float("inf"), "simplicity": 0.0, "wide": 1.0, "plate": None}
    if any(isinstance(limit, Balance) and limit.share == FOLLOWABLE_SHARE for limit in plan.limits):
        plan = plan.with_limits([Balance()])  # people have performers instead
    # rad/s: slower joints take longer, in proportion (paper, Fig. 11)
    slower = max(1.0, 2.5 / usual)
    return replace(plan, move=plan.move * slower, slower=slower, forward=ahead, **free)


def leg_length(body: Body) -> float:
    """Return the length m of the right leg from hip to sole, straight, of a body in standing frames."""
    return float(Chain(body).legs[0].length(0.0)) - float(body.feet["right"].outline[:, 1].min())


def person_sized(body: Body) -> SimilarityScale:
    """Return the factors that make a robot as large and as heavy as a person."""
    return SimilarityScale(_LEG / leg_length(body), MASS / float(body.sip.mass.sum()))


def person_sized_plan(plan: Plan, to: SimilarityScale) -> Plan:
    """Return the ``plan`` of a robot (`robot_plan`) for its similar model of a person's size."""
    return replace(
        plan,
        move=to.time * plan.move,
        hold=to.time * plan.hold,
        slower=to.time * plan.slower,
        budget=to.time * plan.budget,
        forward=float(np.clip(to.length * plan.forward, 0.05, 0.4)),
        limits=tuple(limit.resized(to.length) for limit in plan.limits),
    )


def design_robot(
    body: Body,
    plan: Plan,
    *,
    seed: int = 0,
    tell: Tell | None = None,
    resume: Path | None = None,
) -> tuple[Dance, tuple[Margin, ...]]:
    """Return the dance of the robot ``body`` (in standing frames; its limits count) after ``plan`` (`robot_plan`), and
    what is left of every limit; see `design.design`.

    Raises
    ------
    BiodanceError
        There is no such dance: the message names the posture or move and the limit that forbids it.
    """
    to = person_sized(body)
    long = person_sized_plan(plan, to)
    large, _ = design(similar_body(body, to), long, seed=seed, tell=tell, resume=resume)
    if tell is not None:
        tell("the way from rest", 0, 0)
    dance = shrunk(reposition(large, long), body, to)
    return dance, verify(body, dance, plan.limits)


def shrunk(dance: Dance, body: Body, to: SimilarityScale) -> Dance:
    """Return the dance of ``body`` that is like ``dance`` of its similar model."""
    # Lengths of the root are m, all else is rad.
    units = np.ones(dance.postures.shape[1])
    units[:3] = to.length

    def small(stance: Stance) -> Stance:
        places = {name: getattr(stance, name) / to.length for name in ("ankle", "soles", "props", "hands", "seat")}
        return replace(stance, **places)

    return replace(
        dance,
        body=body,
        postures=dance.postures / units,
        via=dance.via / units,
        hold=dance.hold / to.time,
        move=dance.move / to.time,
        stances=tuple(small(stance) for stance in dance.stances),
        under=tuple(small(stance) for stance in dance.under),
    )
