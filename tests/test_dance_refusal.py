"""Refusals: a healthy person is let through; whoever lacks one thing hears which one, and that it is enough to give
it back.
"""

from dataclasses import replace

import numpy as np
import pytest

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.body.human.limits import joint_limits
from biodance.dance.limits import family
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.person import HEALTHY, PersonLimits, limit_body
from biodance.dance.problem.stance import Stance, stance
from biodance.dance.search.posture import KEPT, initial_guess, refuse, solve
from biodance.errors import BiodanceError
from biodance.records import Subject

SUBJECT = Subject(65.0, 1.75, "F", 33.0)
BODY = replace(human(SUBJECT), limits=joint_limits(SUBJECT, within="comfortable"))
FEET = stance(BODY, "parallel")


def limits_of(person: PersonLimits) -> Body:
    return replace(BODY, limits=limit_body(BODY, person))


def words(person: PersonLimits, feet: Stance) -> str:
    """Return why there is no posture; nothing if there is one."""
    chain, rng = Chain(limits_of(person)), np.random.default_rng(1)
    begin = [initial_guess(chain, feet, rng) for _ in range(4)]
    if any(solve(chain, feet, x, no_objective, family(), iterations=40).violation <= KEPT for x in begin):
        return ""
    with pytest.raises(BiodanceError) as said:
        refuse(chain, feet, begin, family())
    return str(said.value)


def test_a_healthy_person_can_stand_in_all_ways() -> None:
    for feet in (FEET, stance(BODY, "right_forward", right=0.2), FEET.on(0)):
        assert words(HEALTHY, feet) == ""


def test_a_bent_leg_without_strength_does_not_bear_the_body() -> None:
    weak = PersonLimits(
        strengths=(("right_knee", 0.02), ("right_hip", 0.02)),
        ranges=(("right_knee", np.radians(60.0), np.radians(90.0)),),
    )
    said = words(weak, FEET.on(0))
    assert "on the right leg alone" in said
    assert "joint torque of right" in said


def test_an_ankle_that_stays_pointed_cannot_stand() -> None:
    stiff = PersonLimits(ranges=(("ankle_dorsiflexion", np.radians(-35.0), np.radians(-30.0)),))
    said = words(stiff, FEET)
    assert "both feet side by side" in said
    assert "ankle dorsiflexion (short by about" in said
