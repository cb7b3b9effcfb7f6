"""The linear algebra runs on one thread inside the stages and is left as it was; records may be sent at any time."""

import os
import pickle
import threading
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
from biodance.threads import Sendable, one_thread, side_by_side


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


def test_two_pieces_at_a_time_and_the_answers_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2}, raising=False)
    both = threading.Barrier(2, timeout=60.0)

    def meet(piece: int) -> tuple[int, int]:
        both.wait()  # never passed by one thread alone
        return piece, threading.get_ident()

    found = list(side_by_side(meet, iter(range(6))))
    assert [piece for piece, _ in found] == list(range(6))
    assert len({thread for _, thread in found}) == 2


@pytest.mark.parametrize("why", ["the environment says so", "one core", "another process has started this one"])
def test_who_has_neighbours_goes_one_by_one(why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "1" if "environment" in why else "2")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0} if why == "one core" else {0, 1}, raising=False)
    monkeypatch.setattr("multiprocessing.parent_process", lambda: object() if "process" in why else None)
    assert set(side_by_side(lambda _: threading.get_ident(), range(4))) == {threading.get_ident()}


def test_a_failure_beside_others_is_told() -> None:
    with pytest.raises(ZeroDivisionError):
        list(side_by_side(lambda piece: 1 // piece, [1, 2, 0, 3]))


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
