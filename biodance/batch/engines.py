"""Where sessions are worked on: processes of this machine, or a Dask cluster; both survive the death of a worker."""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING

from biodance.batch.outcome import Outcome, SessionStatus, SessionTask, Why, untold
from biodance.child_process import start_forkserver
from biodance.errors import BiodanceError

if TYPE_CHECKING:
    import distributed

Work = Callable[[SessionTask], Outcome]
Outcomes = Generator[tuple[SessionTask, Outcome], None, None]
TRIES = 3
"""Times that a session may lose its process before it is given up."""
_AHEAD = 2
"""Tasks sent to a cluster for each of its threads: the second waits where the first is worked on."""
_FRESH = 50
"""Sessions after which a process is replaced, so that memory stays flat."""
_ASKED = 0.2
"""s between two looks at whether somebody has stopped the work."""


def run_here(
    tasks: Iterable[SessionTask], work: Work, *, workers: int, stop: threading.Event | None = None
) -> Outcomes:
    """Yield every task with its outcome, worked on by processes of this machine, as they are finished.

    A process that dies (killed, out of memory) is replaced and takes no other along; its session is tried again when
    all others are finished, one at a time, and given up when it has lost its process `TRIES` times. Once another
    thread sets ``stop``, what is at work is killed and nothing more is yielded.
    """
    lost, stop = deque[SessionTask](), stop or threading.Event()
    yield from _beside(deque(tasks), work, workers, lost, stop)
    for _ in range(TRIES - 1):
        again, lost = lost, deque[SessionTask]()
        yield from _beside(again, work, 1, lost, stop)
    for task in lost:
        if not stop.is_set():
            yield task, _killed(task)


def _beside(
    waiting: deque[SessionTask], work: Work, workers: int, lost: deque[SessionTask], stop: threading.Event
) -> Outcomes:
    """Yield what is finished until all is, or ``stop`` is set; the tasks whose process died go to ``lost``.

    Each worker is a pool of one process: the death of a process ends every process of its pool.
    """
    free = [_process() for _ in range(min(workers, len(waiting)))]
    flying = dict[Future[Outcome], tuple[SessionTask, ProcessPoolExecutor]]()
    try:
        while (waiting or flying) and not stop.is_set():
            while waiting and free:
                task, pool = waiting.popleft(), free.pop()
                flying[_submitted(pool, work, task)] = task, pool
            for future in wait(flying, timeout=_ASKED, return_when=FIRST_COMPLETED).done:
                task, pool = flying.pop(future)
                if isinstance(future.exception(), BrokenProcessPool):
                    pool.shutdown()
                    free.append(_process())
                    lost.append(task)
                else:
                    free.append(pool)
                    yield task, future.result()
    finally:
        for _, pool in flying.values():  # stopped: what is at work would write while the next run clears up
            for process in tuple(pool._processes.values()):
                process.kill()
                process.join()
        for pool in (*free, *(pool for _, pool in flying.values())):
            pool.shutdown(wait=False, cancel_futures=True)


def _submitted(pool: ProcessPoolExecutor, work: Work, task: SessionTask) -> Future[Outcome]:
    """Return the outcome to come of a task; broken already where the idle process was killed."""
    try:
        return pool.submit(work, task)
    except BrokenProcessPool as dead:
        future = Future[Outcome]()
        future.set_exception(dead)
        return future


def _killed(task: SessionTask) -> Outcome:
    """Return the outcome of a session that nobody survives."""
    why = f"Its process was ended from outside {TRIES} times (memory?). Report it alone to see why."
    return untold(task, SessionStatus.FAILED, why, Why.MACHINE)


def prepare_workers() -> None:
    """Start the process from which workers are forked and let it load what they need, so that the first is quick."""
    multiprocessing.get_context("forkserver").set_forkserver_preload(
        ["biodance.pipeline.front", "biodance.report.write"]
    )
    start_forkserver()


def _process() -> ProcessPoolExecutor:
    """Return one process that ends with us, even when we are killed."""
    prepare_workers()
    context = multiprocessing.get_context("forkserver")
    return ProcessPoolExecutor(1, mp_context=context, initializer=end_with_parent, max_tasks_per_child=_FRESH)


def end_with_parent() -> None:
    """End this process as soon as the one that asked for it is gone, and at once by Ctrl-C."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    parent = multiprocessing.parent_process()
    if parent is not None:

        def watch() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()


def run_on_dask(tasks: Iterable[SessionTask], work: Work, *, scheduler: str) -> Outcomes:
    """Yield every task with its outcome, worked on by the Dask cluster at the address ``scheduler``.

    Recordings and results must lie where all workers see them under the same names. Dask replaces workers that die.

    Raises
    ------
    BiodanceError
        Dask is not installed, nobody answers at the address, or the scheduler goes away.
    """
    try:
        import distributed as dask
    except ImportError as error:
        raise BiodanceError("--scheduler needs Dask: pip install 'biodance[dask]'.") from error
    try:
        client = dask.Client(scheduler, timeout="10s")
    except (OSError, ValueError) as error:
        raise BiodanceError(f"--scheduler {scheduler}: no Dask scheduler answers there ({error}).") from error
    waiting, alone = deque(tasks), deque[SessionTask]()
    try:
        with client:
            places = lambda: _AHEAD * max(1, sum(client.nthreads().values()))  # noqa: E731
            yield from _on_cluster(client, work, waiting, alone, places)
            yield from _on_cluster(client, work, alone, None, lambda: 1)
    except (dask.CancelledError, OSError) as error:
        raise BiodanceError(
            f"--scheduler {scheduler}: the Dask scheduler went away. What was done is kept: start it again, and run "
            f"the same command."
        ) from error


def _on_cluster(
    client: "distributed.Client",
    work: Work,
    waiting: deque[SessionTask],
    alone: deque[SessionTask] | None,
    places: Callable[[], int],
) -> Outcomes:
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
