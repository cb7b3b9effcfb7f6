"""All that is known of a cause stands in its own file, so one that is given as an object has all of it, too."""

import numpy as np
import pytest
from diagnosed_sessions import body, known, windows
from inferred_sessions import inferred

from biodance.diagnosis.consequence import matters
from biodance.diagnosis.diagnosis import Alias, Diagnosis, Estimate, Finding
from biodance.diagnosis.plate_axes import of_family
from biodance.effects import About, Case, CauseWords, CheckKind, Effect, Parameter, causes, effects, known_cause
from biodance.pipeline.attention import headline
from biodance.pipeline.words import alternatives, cause_of, in_words, spoken
from biodance.records import Array
from biodance.records.attention import Judged


class Rope(Effect):
    """A rope that pulls at the pelvis."""

    name = "rope"
    parameters = (Parameter("pull", "N or N·m", 20.0, "a spring balance", {"N": 4.0}, {"N": 6.0, "Fz": 9.0}, 0.5),)
    separated_by = "Take the rope off."
    advice = "Take the rope off and repeat the trial."
    about = About("A rope pulls.", "A constant force.", "A zero of the plate.", "Taking it off.")
    words = CauseWords("a rope {more} {size}{between}", "Take it off.", "a rope", ("pulls", "pushes"), ("down", "up"))
    explains = (CheckKind.WEIGHT,)
    habit = False

    def columns(self, case: Case) -> Array:
        """Return a unit force along z."""
        return np.broadcast_to(np.eye(6)[:, 2:3], (case.motion.time.size, 6, 1))


def roped(effect: str = "rope") -> Diagnosis:
    """Return a diagnosis as the engine writes it: effects by name."""
    size = Estimate("pull", 30.0, 2.0, "N")
    other = Finding("plate_offset", "Fz", (size,), (Alias("plate_offset", "Fz", 9.0), Alias(effect, "", 8.0)), 1.0)
    return Diagnosis(True, (Finding(effect, "", (size,), (Alias(effect, "", 9.0),), 1.0), other))


def test_a_cause_given_as_an_object_is_told_in_its_own_words() -> None:
    first, other = of_family(roped(), causes([Rope()])).findings
    assert spoken(first).fact == "a rope pulls 30 N (26 to 34)"
    assert spoken(first).do == "Take it off."
    assert "; down)" in in_words(first)
    assert alternatives(other) == ["a rope"]
    assert cause_of("mass on the plates", [first]) == "rope"
    assert cause_of("marker distance", [first]) == ""
    assert first.cause.about.signature == "A constant force."
    told = headline(of_family(roped(), causes([Rope()])), (Judged("squats", 9.0),), frozenset()).text
    assert "a rope pulls 30 N" in told


def test_a_cause_that_nobody_gave_is_told_by_its_name() -> None:
    first, other = roped("rope").findings
    assert spoken(first).plain == "a rope was found, 30 N"
    assert cause_of("mass on the plates", [first]) == ""
    assert alternatives(other) == ["a rope"]
    assert known_cause("rope").words is None
    assert known_cause("plate_gain").words is not None


@pytest.mark.parametrize(("target", "size", "matter"), [("Fx", 3.9, False), ("Fx", -4.1, True), ("Mx", 0.1, True)])
def test_its_sizes_count_at_each_target(target: str, size: float, matter: bool) -> None:
    """Of a size that nobody states every one matters."""
    rope = Rope(target=target)
    assert matters(rope, np.array([size])) is matter
    own = rope.parameters[0]
    assert [own.usual_at(at) for at in ("Fx", "plate2:Fz", "Mx")] == [6.0, 9.0, 0.0]


def shaken(time: Array) -> Array:
    """Return the wrench (T, 6) of one newton sideways, one metre over the lab's origin, 1.3 times a second."""
    force = np.outer(np.sin(2 * np.pi * 1.3 * time), [0.0, 1.0, 0.0])
    return np.concatenate([force, np.cross([0.0, 0.0, 1.0], force)], axis=1)


@pytest.mark.parametrize(("least", "found"), [(10.0, ["rope"]), (80.0, [])])
def test_the_engine_asks_an_object_which_size_matters(least: float, found: list[str]) -> None:
    """50 N are hidden."""

    class Shaken(Rope):
        """A rope that is shaken sideways."""

        parameters = (Parameter("pull", "N", 20.0, "a spring balance", least),)

        def columns(self, case: Case) -> Array:
            """Return the wrench of one newton."""
            return shaken(case.motion.time)[:, :, None]

    some = windows(1, hidden=lambda wrench, session, moving: wrench + 50.0 * shaken(moving.time))
    family = effects(("plate_offset", "plate_gain")) | {"rope": Shaken()}
    one = of_family(inferred(body(), some, tolerances=known(), effects=family).diagnosis, family)
    assert [finding.effect for finding in one.findings] == found
    assert all(finding.cause.words is Rope.words for finding in one.findings)
