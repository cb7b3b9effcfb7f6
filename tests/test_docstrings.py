"""The docstrings of the front door: complete, and what their examples print is true."""

import doctest
import inspect
import os
from functools import cache

import pytest
from docstrings import faults, public
from small_dances import small_dance

import biodance
from biodance.pipeline import diagnosis, front

SLOW = ("examine", "identify", "diagnose", "register")
"""What an example asks for again with the same arguments is computed once."""
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def both(result):
    """Return what a visit says of the body, and its diagnosis, which the identification asks for as well: once."""
    diagnosed, kept = front.diagnose_session, []

    def once(visit, **how):
        if not kept:
            kept.append(diagnosed(visit, **how))
        return kept[0]

    with pytest.MonkeyPatch.context() as patch:
        for place in (front, diagnosis):
            patch.setattr(place, "diagnose_session", once)
        return biodance.identify(result), biodance.diagnose(result)


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """Return the names that the examples share, in a folder that holds the simulated visit they read."""
    import matplotlib.pyplot as plt

    folder, before = tmp_path_factory.mktemp("examples"), os.getcwd()
    os.chdir(folder)
    biodance.simulate(biodance.Subject(62.0, 1.70, "F", 31.0), "short", "visit", seed=1)
    patch = pytest.MonkeyPatch()
    for name in SLOW:
        patch.setattr(biodance, name, cache(getattr(biodance, name)))
    session = biodance.read_session("visit")
    result = biodance.examine(session)
    identified, found = both(result)
    shared = {
        "session": session,
        "result": result,
        "identified": identified,
        "found": found,
        "registered": biodance.register("visit/dance_1.c3d", "visit/dance_1.c3d"),
    }
    small_dance().save("dance.npz")
    yield {"biodance": biodance, "dance": small_dance(), **shared}
    patch.undo()
    plt.close("all")
    os.chdir(before)


@pytest.mark.parametrize("name", biodance.__all__)
def test_examples_print_what_they_say(name, names):
    thing = biodance.front_door(name)
    runner, told = doctest.DocTestRunner(optionflags=FLAGS), []
    inherited = [cls for cls in getattr(thing, "__mro__", ())[1:] if cls.__module__.startswith("biodance")]
    for home in (thing, *inherited):
        for example in doctest.DocTestFinder().find(home, name, globs=dict(names)):
            runner.run(example, out=told.append)
    assert runner.failures == 0, "".join(told)


def test_every_docstring_of_the_front_door_is_complete():
    pytest.importorskip("numpydoc")
    assert faults() == []


def test_the_check_sees_methods_and_properties():
    homes = [name for name, _ in public()]
    assert "biodance.records.wrench.Wrench.cop" in homes
    assert "biodance.records.motion.Motion.angles" in homes
    assert sum(inspect.isclass(thing) for _, thing in public()) >= 15
