"""How many threads does the linear algebra get? One: our matrices are small and many, and threads would only wait.
And what may go to another process while a thread still computes with it.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """Run what follows with one BLAS thread; afterwards everything is as it was.

    Stages of long work carry it as a decorator, ``@one_thread()``. Matrices here have 10 to 500 rows, where a second
    thread costs more than it brings: a diagnosis took 45 s of processor time with two threads and 7 s with one
    (docs/decisions/2026-11-22-processing-time.md). More cores are used by whole processes instead. What the
    environment says (OMP_NUM_THREADS, ...) is left alone, and so are threads of programs that call us.
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
