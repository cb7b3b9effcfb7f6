"""The linear algebra runs on one thread inside the stages and is left as it was; records may be sent at any time."""

import pickle
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.problem.chain import Chain
from biodance.dance.problem.stance import Stance
from biodance.threads import Sendable, one_thread


def counts() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


@one_thread()
def stage() -> set[int]:
    return counts()


def test_a_stage_has_one_thread_and_what_was_set_comes_back() -> None:
    assert np.isfinite(np.linalg.inv(np.eye(3))).all()  # numpy's library is loaded
    with threadpool_limits(2, user_api="blas"):
        before = counts()
        assert stage() == {1}
        assert counts() == before


def test_it_comes_back_after_a_failure() -> None:
    before, inside = counts(), []

    @one_thread()
    def fail() -> None:
        inside.append(counts())
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert inside == [{1}]
    assert counts() == before


class Meanwhile:
    """While it is pickled, somebody asks its owner for a further value."""

    owner: Any = None

    def __getstate__(self) -> dict[str, int]:
        return {"asked": self.owner.further}


@dataclass(frozen=True)
class Kept(Sendable):
    first: Meanwhile
    second: int

    @cached_property
    def further(self) -> int:
        return 2 * self.second


def test_a_value_computed_while_a_record_is_sent_does_not_stop_it() -> None:
    record = Kept(Meanwhile(), 21)
    record.first.owner = record
    assert pickle.loads(pickle.dumps(record)).second == 21
    assert record.further == 42


@pytest.mark.parametrize("kind", [Body, Dance, Chain, Stance])
def test_what_dances_send_to_processes_is_sendable(kind: type) -> None:
    assert issubclass(kind, Sendable)
