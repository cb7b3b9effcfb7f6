"""The linear algebra runs on one thread inside the stages and is left as it was."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from biodance.threads import one_thread


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
