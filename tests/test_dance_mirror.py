"""Mirror images of postures: as possible as the posture, of another set of feet, and only for bodies whose sides are
alike.
"""

from dataclasses import replace

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.dance.limits import family
from biodance.dance.problem.chain import ROOT, Chain
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.nlp import no_objective
from biodance.dance.problem.person import PersonLimits, limit_body
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import holding
from biodance.dance.search.posture import image_feet, initial_guess, mirror_posture, mirror_vectors, solve, symmetric
from biodance.records import Subject

BODY = human(Subject(65.0, 1.75, "F", 33.0))
CHAIN = Chain(BODY)
BLOCKS = ("parallel", "right_forward", "single_right", "single_left")
FEET = tuple(s for s in support_sequence(BODY, Plan("all", "", tuple((name, 1) for name in BLOCKS))) if s.over is None)


@pytest.mark.parametrize("place", [0, 2, 3])
def test_an_image_keeps_every_limit_as_well_as_its_posture(place):
    here, there = FEET[place], FEET[image_feet(FEET[place], FEET)]
    posture = solve(
        CHAIN, here, initial_guess(CHAIN, here, np.random.default_rng(place)), no_objective, family(), iterations=8
    )
    image = solve(CHAIN, there, mirror_posture(CHAIN, posture.x, here, there), no_objective, family(), iterations=0)
    assert image.violation == pytest.approx(posture.violation, abs=1e-9)
    np.testing.assert_allclose(image.up, mirror_vectors(BODY, posture.up), atol=1e-12)
    assert np.abs(image.x[ROOT:] - posture.x[ROOT:]).max() > 0.1
    np.testing.assert_allclose(mirror_posture(CHAIN, image.x, there, here), posture.x, atol=1e-12)


def test_images_stand_on_their_own_feet():
    assert [image_feet(feet, FEET) for feet in FEET] == [0, None, 3, 2]
    assert image_feet(FEET[2], FEET[:3]) is None
    held = tuple(holding(feet, BODY, ("right",)) for feet in FEET)
    assert image_feet(held[0], held) is None


@pytest.mark.parametrize(
    "person",
    [PersonLimits(strengths=(("left_knee", 0.5),)), PersonLimits(range_shares=(("left_shoulder", 0.5),))],
    ids=["strength", "range"],
)
def test_whoever_differs_from_side_to_side_has_no_images(person):
    assert symmetric(BODY)
    assert not symmetric(replace(BODY, limits=limit_body(BODY, person)))
