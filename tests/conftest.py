"""What every test may count on: the front door is loaded before a test replaces a function that it imports, which it
would keep; one thread of linear algebra; the folder with real recordings.
"""

import os
import tomllib
from collections.abc import Callable, Generator
from functools import cache
from pathlib import Path

import pytest
from shared_markers import forward_once

import biodance.pipeline.front  # noqa: F401
from biodance.lab.session.read import read_session
from biodance.pipeline.results import SessionResult
from biodance.pipeline.session import examine
from biodance.threads import one_thread


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol() -> Generator[None, object, object]:
    """Run every test with its fixtures as the stages of the package run: with one thread. A second one, beside which
    another worker of pytest computes, cost up to seventy times the processor time.
    """
    with one_thread():
        return (yield)


@pytest.fixture(scope="session", autouse=True)
def _errors_of_a_motion_are_found_once() -> Generator[None]:
    """Let all tests of one process share what the errors of the kinematics do in the same motion of the same body."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("biodance.diagnosis.problem.forward", forward_once)
        yield


@pytest.fixture(scope="session")
def data() -> Path:
    """Return the folder with real recordings of other laboratories; skips the test where there is none."""
    folder = os.environ.get("BIODANCE_DATA")
    if not folder:
        pytest.skip("BIODANCE_DATA does not name the folder with real recordings")
    return Path(folder)


@cache
def _examined(folder: Path) -> SessionResult:
    return examine(read_session(folder))


@pytest.fixture
def recording(data: Path) -> Callable[[str], SessionResult]:
    """Return what gives the result of a real session by its name: each is examined once for the tests of all files."""
    return lambda name: _examined(data / name)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what the engine does not meet yet (``engine_gaps.toml``) as expected to fail its assertion: it is run every
    time; a gap that closed fails until it is taken out, and so does whatever breaks instead.
    """
    text = (Path(__file__).parent / "engine_gaps.toml").read_text(encoding="utf-8")
    gaps = {(one["file"], one["test"], one.get("case", "")): one["why"] for one in tomllib.loads(text)["gap"]}
    for item in items:
        test, _, case = item.name.partition("[")
        why = gaps.get((item.path.name, test, case.removesuffix("]")))
        if why is not None:
            item.add_marker(pytest.mark.xfail(reason=why, raises=AssertionError, strict=True))
