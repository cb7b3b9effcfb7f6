"""How many threads does the linear algebra get? One: our matrices are small and many, and threads would only wait."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


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
