"""How many threads does the linear algebra get? One: our matrices are small and many, and threads would only wait."""

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_thread() -> Iterator[None]:
    """Run what follows with one BLAS thread; afterwards everything is as it was.

    Stages of long work carry it as a decorator, ``@one_thread()``. Matrices here have 10 to 500 rows, where a second
    thread costs more than it brings: a diagnosis took 45 s of processor time with two threads and 7 s with one
    (docs/decisions). More cores are used by whole processes instead. What the environment says (OMP_NUM_THREADS, ...)
    is left alone, and so are threads of programs that call us.
    """
    from threadpoolctl import ThreadpoolController

    with ThreadpoolController().limit(limits=1, user_api="blas"):
        yield
