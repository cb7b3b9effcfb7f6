"""What a dance that can be followed costs, and the sentences that say what it cannot teach."""

from dataclasses import replace

import numpy as np
from small_dances import BODY

from biodance.dance.cues import dance_instructions
from biodance.dance.expectation import Expectation
from biodance.dance.metrics import DanceMetrics
from biodance.dance.problem.plan import Plan
from biodance.dance.search.word_course import freer_dance
from biodance.pipeline.dance_result import DanceResult
from biodance.report.tables.dance import dance_document

PLAN = Plan("x", "", (("parallel", 4),), hold=1.0, instructions=3.0, simplicity=1.0, wide=1.35, gentle=True)


def expected(mass: float, com: float) -> Expectation:
    told = [np.array([np.full(12, before), np.full(12, after)]) for before, after in ((1.0, mass), (0.02, com))]
    told[0][1, 3] = 0.99
    return Expectation(BODY.segments, np.array([0.0, 60.0]), *told, told[1], np.zeros((2, 12)))


def test_freely_chosen_postures_are_of_the_same_number_and_ask_more_at_once() -> None:
    free = freer_dance(BODY, PLAN, seed=1)
    assert free.counted.sum() == 4
    assert max(map(len, dance_instructions(free)[1:])) > PLAN.instructions


def test_what_came_of_an_emphasis_is_said_and_why_it_is_no_more() -> None:
    """The table takes the masses of both forearms for alike, so that what one tells holds of the other."""
    plan = replace(PLAN, weights=(("left_forearm_hand", 1.0),), other_weight=0.0)
    result = DanceResult(BODY, plan, None, (), None, expected(0.5, 0.010), "", (), 1.0)
    (said,) = result.emphasis
    assert "Emphasis on the left forearm hand: its mass becomes known to 0.50 kg (table: 1.00)" in said
    assert "sides are alike (correlation in the table 0.80)" in said
    assert replace(result, plan=PLAN).emphasis == ()
    told = result.expectation
    assert told is not None
    mass = told.mass.copy()
    mass[-1, BODY.segment_index("left_forearm_hand")] = 0.3
    (more,) = replace(result, expectation=replace(told, mass=mass)).emphasis
    assert "alike" not in more


def test_the_price_and_what_cannot_be_learned_are_said() -> None:
    free = freer_dance(BODY, replace(PLAN, blocks=(("parallel", 2),)))
    poor = DanceMetrics(300.0, 65.0, np.ones(1), 65.0, ("left_foot",), ())
    result = DanceResult(BODY, PLAN, free, (), poor, expected(0.5, 0.010), "", (), 1.0, freely=expected(0.4, 0.008))
    price = dance_document(result)["simplicity_price"]
    assert price["mass_kg"]["with"] > price["mass_kg"]["without"]
    assert price["com_m"] == {"with": 0.010, "without": 0.008}
    assert "chosen freely" in result.price
    assert result.price not in result.about  # which the person reads who dances
    (warning,) = result.warnings
    assert "4.6 times its bound" in warning
    assert "left foot" in warning
    assert f"It cannot teach the mass of {BODY.segments[3].replace('_', ' ')}" in warning
    near = replace(result, account=replace(poor, static=180.0))
    assert near.warnings == ()
    assert not any("criterion" in sentence for sentence in result.about)
