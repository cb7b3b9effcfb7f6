"""How many threads does the linear algebra get? One: our matrices are small and many, and threads would only wait.
What may be done side by side all the same, and what may go to another process while a thread still computes with it.
"""

import multiprocessing
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

_Given = TypeVar("_Given")
_Made = TypeVar("_Made")
_BESIDE = 2
"""Threads at most: measured with two, and memory grows with each."""


def side_by_side(make: Callable[[_Given], _Made], given: Iterable[_Given]) -> Iterator[_Made]:
    """Yield what ``make`` makes of everything ``given``, in its order, two at a time where two cores are ours alone.

    For pieces that hold many frames and hardly touch Python, not for single small matrices. One thread where
    OMP_NUM_THREADS says 1, on one core, and in a process that another started: that one has its neighbours.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    alone = os.environ.get("OMP_NUM_THREADS") == "1" or multiprocessing.parent_process() is not None
    pieces, workers = list(given), 1 if alone else min(_BESIDE, cores)
    if workers == 1 or len(pieces) < 2:
        yield from map(make, pieces)
        return
    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(make, pieces)


@contextmanager
def one_thread() -> Iterator[None]:
    """Run what follows with one BLAS thread; afterwards everything is as it was.

    Stages of long work carry it as a decorator, ``@one_thread()``. Matrices here have 10 to 500 rows, where a second
    thread costs more than it brings: a diagnosis took 45 s of processor time with two threads and 7 s with one
    (docs/decisions). More cores are used by whole processes instead. What the environment says (OMP_NUM_THREADS, ...)
    is left alone, and so are threads of programs that call us.
    """
    with _libraries(len(sys.modules)).limit(limits=1, user_api="blas"):
        yield


@lru_cache(maxsize=1)
def _libraries(modules: int) -> "ThreadpoolController":
    """Return the libraries with threads, looked for anew where ``modules`` have been imported since: 1 ms a search."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


class Sendable:
    """A record that keeps what it has once computed (`functools.cached_property`) and may go to another process at any
    time: executors pickle in a thread of their own, while the caller's thread may just compute a further value.
    """

    def __getstate__(self) -> dict[str, Any]:
        """Return a copy of what is known now, made in one go."""
        return dict(self.__dict__)
