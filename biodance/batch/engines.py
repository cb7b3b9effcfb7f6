"""Where sessions are worked on: processes of this machine, or a Dask cluster; both survive the death of a worker."""

import multiprocessing
import os
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING

from biodance.batch.work import Outcome, SessionStatus, SessionTask, untold
from biodance.errors import BiodanceError

if TYPE_CHECKING:
    import distributed

Work = Callable[[SessionTask], Outcome]
TRIES = 3
"""Times that a session may lose its process before it is given up."""
_AHEAD = 2
"""Tasks sent to a cluster for each of its threads: the second waits where the first is worked on."""
_FRESH = 50
"""Sessions after which a process is replaced, so that memory stays flat."""


def run_here(tasks: Iterable[SessionTask], work: Work, *, workers: int) -> Iterator[tuple[SessionTask, Outcome]]:
    """Yield every task with its outcome, worked on by processes of this machine, as they are finished.

    A process that dies (killed, out of memory) is replaced; the sessions that may have been its cause are tried again
    one at a time, and given up when alone they lose their process `TRIES` times.
    """
    waiting, lost = deque(tasks), Counter[str]()
    while waiting:
        pool, flying = _pool(workers), dict[Future[Outcome], SessionTask]()
        try:
            yield from _until_broken(pool, work, workers, waiting, flying, lost)
        except BrokenProcessPool:
            gone = tuple(flying.values())
            for task in gone:
                lost[task.name] += 1 if len(gone) == 1 or not lost[task.name] else 0
                if lost[task.name] < TRIES:
                    waiting.append(task)
                else:
                    yield task, _killed(task)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _until_broken(
    pool: ProcessPoolExecutor,
    work: Work,
    workers: int,
    waiting: deque[SessionTask],
    flying: dict[Future[Outcome], SessionTask],
    lost: Counter[str],
) -> Iterator[tuple[SessionTask, Outcome]]:
    """Yield what is finished until all is, or until a process dies: then ``flying`` are the tasks that may be why.

    A task that lost a process before is worked on alone.
    """
    while waiting or flying:
        while waiting and (not flying or _together(waiting[0], flying, workers, lost)):
            flying[pool.submit(work, waiting[0])] = waiting[0]
            waiting.popleft()
        finished, _ = wait(flying, return_when=FIRST_COMPLETED)
        for future in sorted(finished, key=lambda one: one.exception() is not None):
            outcome = future.result()
            yield flying.pop(future), outcome


def _together(task: SessionTask, flying: dict[Future[Outcome], SessionTask], workers: int, lost: Counter[str]) -> bool:
    """Return whether a task may be worked on beside those that are."""
    return len(flying) < workers and not any(lost[one.name] for one in (task, *flying.values()))


def _killed(task: SessionTask) -> Outcome:
    """Return the outcome of a session that nobody survives."""
    why = f"Its process was ended from outside {TRIES} times (memory?). Report it alone to see why."
    return untold(task.name, task.fingerprint, SessionStatus.FAILED, why)


def _pool(workers: int) -> ProcessPoolExecutor:
    """Return processes that end with us, even when we are killed."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["biodance.pipeline.front", "biodance.report.write"])
    return ProcessPoolExecutor(workers, mp_context=context, initializer=end_with_parent, max_tasks_per_child=_FRESH)


def end_with_parent() -> None:
    """End this process as soon as the one that asked for it is gone."""
    parent = multiprocessing.parent_process()
    if parent is not None:

        def watch() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()


def run_on_dask(tasks: Iterable[SessionTask], work: Work, *, scheduler: str) -> Iterator[tuple[SessionTask, Outcome]]:
    """Yield every task with its outcome, worked on by the Dask cluster at the address ``scheduler``.

    Recordings and results must lie where all workers see them under the same names. Dask replaces workers that die.

    Raises
    ------
    BiodanceError
        Dask is not installed, or nobody answers at the address.
    """
    try:
        import distributed as dask
    except ImportError as error:
        raise BiodanceError("--scheduler needs Dask: pip install 'biodance[dask]'.") from error
    try:
        client = dask.Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise BiodanceError(f"--scheduler {scheduler}: no Dask scheduler answers there ({error}).") from error
    with client:
        waiting, alone = deque(tasks), deque[SessionTask]()
        yield from _on_cluster(client, work, waiting, alone, lambda: _AHEAD * max(1, sum(client.nthreads().values())))
        yield from _on_cluster(client, work, alone, None, lambda: 1)


def _on_cluster(
    client: "distributed.Client",
    work: Work,
    waiting: deque[SessionTask],
    alone: deque[SessionTask] | None,
    places: Callable[[], int],
) -> Iterator[tuple[SessionTask, Outcome]]:
    """Yield what is finished until all is, with as many tasks sent as there are ``places``.

    Dask blames a worker's death on all that it held: such a task goes to ``alone``, or, without it, is given up.
    """
    import distributed as dask

    flying, finished = dict[dask.Future, SessionTask](), dask.as_completed()
    while waiting or flying:
        while waiting and len(flying) < places():
            task = waiting.popleft()
            future = client.submit(work, task, key=f"{task.name}-{task.fingerprint}-{'alone' if alone is None else ''}")
            flying[future] = task
            finished.add(future)
        future = next(finished)
        task = flying.pop(future)
        try:
            yield task, future.result()
        except dask.KilledWorker:
            if alone is None:
                yield task, _killed(task)
            else:
                alone.append(task)
