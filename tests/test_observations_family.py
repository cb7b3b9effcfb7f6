"""The family of observers keeps its contract: every file is a member, objects join, strangers are refused."""

from dataclasses import replace
from pathlib import Path

import pytest
from walking import MASS, walk

from biodance.effects import causes
from biodance.errors import BiodanceError
from biodance.observations import FAMILY, Observation, Observer, SeenTrial, observe, observers, recording

NAMES = tuple(path.stem for path in Path(FAMILY.package.replace(".", "/")).glob("[a-z]*.py"))


@pytest.mark.parametrize("name", NAMES)
def test_every_file_of_the_folder_is_an_observer(name: str) -> None:
    member = observers()[name]
    assert member.name == name
    assert set(member.responds_to) <= set(causes())
    assert member.needs.endswith(".")
    assert member.observe(recording(replace(walk(), markers=None, plates=()))) == ()
    for one in member.observe(recording(walk(), mass=MASS)):
        assert one.observer == name
        assert one.sd > 0
        assert one.expected_sd >= one.sd


def test_objects_join_and_strangers_are_refused() -> None:
    class Loud(Observer):
        """Hears one thing."""

        name, responds_to, needs, source = "loud", ("time_delay",), "Silence.", "nobody"

        def observe(self, seen: SeenTrial) -> tuple[Observation, ...]:
            return (Observation("loud", "noise", seen.trial.name, 1.0, 1.0, 0.0, "1"),)

    assert [one.observer for one in observe(recording(walk()), ["foot_outline", Loud()])][-1] == "loud"
    with pytest.raises(BiodanceError, match="it is no observer"):
        observers([object()])  # type: ignore[list-item]
