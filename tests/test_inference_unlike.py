"""No cause is quite like its model: what the model of a named one leaves is no further cause, and no strange body."""

import numpy as np
import pytest
from diagnosed_sessions import body, known, windows
from inferred_sessions import inferred

from biodance.effects import Case, Effect, Parameter, effects
from biodance.records import Array

HERTZ = 1.3


class Cable(Effect):
    """A cable that pulls sideways with ``force`` N, one metre over the lab's origin, 1.3 times a second."""

    name = "cable"
    parameters = (Parameter("force", "N", 20.0, "a rope that somebody shakes"),)
    separated_by = "Cut it."

    def columns(self, case: Case) -> Array:
        """Return the wrench of one newton."""
        return shaken(case.motion.time, 0.0)[:, :, None]


def shaken(time: Array, late: float) -> Array:
    """Return the wrench (T, 6) of a cable of one newton, ``late`` rad late."""
    force = np.outer(np.sin(2 * np.pi * HERTZ * time - late), [0.0, 1.0, 0.0])
    return np.concatenate([force, np.cross([0.0, 0.0, 1.0], force)], axis=1)


def told(newton: float, late: float):
    """Return what is said of a cable of ``newton`` N that swings ``late`` rad behind its model."""
    some = windows(1, hidden=lambda wrench, session, moving: wrench + newton * shaken(moving.time, late))
    every = effects(("time_delay", "plate_offset", "plate_gain", "body_mass")) | {"cable": Cable()}
    return inferred(body(), some, tolerances=known(), effects=every)


def test_what_the_model_of_a_name_leaves_is_nothing() -> None:
    """Of 50 N that are 0.1 rad late, 5 N are left, eight times the noise."""
    one = told(50.0, 0.1).diagnosis
    assert [finding.effect for finding in one.findings] == ["cable"]
    assert one.findings[0].parameters[0].value == pytest.approx(50.0, rel=0.02)


def test_a_model_that_is_plainly_wrong_is_no_finding() -> None:
    assert told(50.0, 0.6).diagnosis.verdict == "unexplained"


class Strap(Cable):
    """A cable that says how poorly it is described."""

    @property
    def unlike(self) -> float:
        return 0.5


def test_a_cause_that_says_how_unlike_its_model_it_is_leaves_so_much() -> None:
    """0.6 rad late: of 50 N, 28 are left. Of a cause known to a half that is no other size in any band or trial."""
    some = windows(1, trials=2, hidden=lambda wrench, session, moving: wrench + 50.0 * shaken(moving.time, 0.6))
    every = effects(("time_delay", "plate_offset")) | {"cable": Strap()}
    (one,) = inferred(body(), some, tolerances=known(), effects=every).diagnosis.findings
    assert one.effect == "cable"


class Second(Cable):
    """The same cable as a model that swings ``late`` rad behind it."""

    name = "second_cable"
    late = 0.0

    def columns(self, case: Case) -> Array:
        """Return the wrench of one newton."""
        return shaken(case.motion.time, self.late)[:, :, None]


class Close(Second):
    """One per cent unlike the first: no cause is so near to its model."""

    late = 0.01


class Apart(Second):
    """Half unlike the first."""

    late = 0.5


class Far(Second):
    """Less than a quarter of its wrench is like the first's: not asked under the noise that the first one leaves."""

    late = 1.2


@pytest.mark.parametrize(("second", "alike"), [(Close(), True), (Apart(), False), (Far(), False)])
def test_look_alikes_are_told_apart_by_more_than_a_model_leaves(second: Second, alike: bool) -> None:
    """50 N exactly as the first model says: the second one leaves 0.5 N, as loud as the noise and in every swing, or
    25 N.
    """
    some = windows(1, hidden=lambda wrench, session, moving: wrench + 50.0 * shaken(moving.time, 0.0))
    every = effects(("plate_offset",)) | {"cable": Cable(), "second_cable": second}
    (one,) = inferred(body(), some, tolerances=known(), effects=every).diagnosis.findings
    assert one.effect == "cable"
    assert ("second_cable" in {alias.effect for alias in one.set}) is alike
