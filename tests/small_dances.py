"""A dance that is made by hand, in no time: two postures on both feet, an arm is raised; and a search for postures
that is cut short.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure

from biodance.body.human.human import human
from biodance.dance.dance import Dance
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.feet import support_sequence
from biodance.dance.problem.plan import Plan
from biodance.dance.problem.stance import feet_in_move
from biodance.dance.search.postures import initial_guess
from biodance.records import Subject

SHORT_SEARCH = {"SWEEPS": ((4, 8),), "FRESH": ((8, 8),), "POLISH": ((8, 4),)}
"""Numbers of `biodance.dance.search.postures` that find allowed postures quickly, not the best ones."""
BODY = human(Subject(65.0, 1.75, "F", 33.0, "S01"))


@cache
def small_dance() -> Dance:
    """Return 1 s of standing, 2 s of raising the left arm to the side, 1 s with it raised."""
    chain = Chain(BODY)
    stances = support_sequence(BODY, Plan("one_segment", (("parallel", 2),), hold=1.0))
    stand = initial_guess(chain, stances[0], np.random.default_rng(0))
    stand[2], stand[3:] = 0.86, 0.0
    for side in ("left", "right"):
        stand[6 + BODY.joint_index(f"{side}_shoulder_adduction")] = -0.4
        stand[6 + BODY.joint_index(f"{side}_elbow_flexion")] = 0.2
    raised = stand.copy()
    raised[6 + BODY.joint_index("left_shoulder_adduction")] = -1.0
    x = np.array([stand, raised])
    via = x[:1, None] + np.array([[0.21], [0.79]]) * np.diff(x, axis=0)[:, None]
    return Dance("one_segment", BODY, x, stances, np.ones(2), via, np.array([2.0]), (feet_in_move(*stances),), 0)


@contextmanager
def without_pictures(*, figures: bool = False) -> Iterator[None]:
    """Let dances be written without their shaded postures, which `test_pipeline_stills` draws, and with empty figures
    unless they are asked for: `test_dance_command` draws all of a dance.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("biodance.report.dance.sheet_png", lambda stills: None)
        for name in () if figures else ("postures", "criterion", "zmp", "expectation"):
            patch.setattr(f"biodance.report.dance.{name}_figure", lambda *_: Figure())
        yield
