"""An archive through all stages: what is done stays done, what fails is told, the rest goes on; on processes of this
machine or a Dask cluster, and both survive the death of a worker.

What is done is written into one SQLite file in the results' folder, under a lock, so that no two runs mix.
"""

import fcntl
import multiprocessing
import os
import signal
import sqlite3
import threading
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from biodance.batch.summary import SESSIONS, folder_name, write_summary
from biodance.batch.work import (
    Outcome,
    SessionStatus,
    SessionTask,
    Why,
    clear_up,
    fingerprint_of,
    load_all,
    outcome_of,
    process_session,
    readable,
    untold,
)
from biodance.child_process import start_forkserver
from biodance.errors import BiodanceError
from biodance.lab.session.archive import archive_folders
from biodance.settings import assignments
from biodance.version import __version__

if TYPE_CHECKING:
    import distributed


Work = Callable[[SessionTask], Outcome]
Outcomes = Generator[tuple[SessionTask, Outcome], None, None]
TRIES = 3
"""Times that a session may lose its process before it is given up."""


def run_here(
    tasks: Iterable[SessionTask],
    work: Work,
    *,
    workers: int,
    stop: threading.Event | None = None,
    idle: list[ProcessPoolExecutor] | None = None,
) -> Outcomes:
    """Yield every task with its outcome, worked on by processes of this machine, as they are finished.

    A process that dies (killed, out of memory) is replaced and takes no other along; its session is tried again when
    all others are finished, one at a time, and given up when it has lost its process `TRIES` times. Once another
    thread sets ``stop``, what is at work is killed and nothing more is yielded. ``idle`` processes are taken first
    (`ready_process`), and all that live on stay there; without it they are ended.
    """
    lost, stop = deque[SessionTask](), stop or threading.Event()
    yield from _beside(deque(tasks), work, workers, lost, stop, idle)
    # one at a time: what died beside others, of their memory perhaps, may get through alone
    for _ in range(TRIES - 1):
        again, lost = lost, deque[SessionTask]()
        yield from _beside(again, work, 1, lost, stop, idle)
    for task in lost:
        if not stop.is_set():
            yield task, _killed(task)


def _beside(
    waiting: deque[SessionTask],
    work: Work,
    workers: int,
    lost: deque[SessionTask],
    stop: threading.Event,
    idle: list[ProcessPoolExecutor] | None,
) -> Outcomes:
    """Yield what is finished until ``stop``; each worker is a pool of one, so that a death takes no other along."""
    free = [idle.pop() if idle else _process() for _ in range(min(workers, len(waiting)))]
    flying = dict[Future[Outcome], tuple[SessionTask, ProcessPoolExecutor]]()
    try:
        while (waiting or flying) and not stop.is_set():
            while waiting and free:
                task, pool = waiting.popleft(), free.pop()
                flying[_submitted(pool, work, task)] = task, pool
            # s between two looks at `stop`
            for future in wait(flying, timeout=0.2, return_when=FIRST_COMPLETED).done:
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
        ended = [pool for _, pool in flying.values()]
        (ended if idle is None else idle).extend(free)
        for pool in ended:
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
    why = f"Its process was ended from outside {TRIES} times (memory?). Report it alone to see why."
    return untold(task, SessionStatus.FAILED, why, Why.MACHINE)


def prepare_workers() -> None:
    """Start the process from which workers are forked, and let it load what every session needs."""
    multiprocessing.get_context("forkserver").set_forkserver_preload(
        [
            *("biodance.pipeline.front", "biodance.pipeline.diagnosis", "biodance.report.write"),
            *("scipy.signal", "clarabel", "jinja2", "numba", "pandas", "pyarrow.csv", "pyarrow.parquet"),
        ]
    )
    start_forkserver()


def _process() -> ProcessPoolExecutor:
    """Return one process that ends with us, even when we are killed."""
    prepare_workers()
    context = multiprocessing.get_context("forkserver")
    # a new process after 50 sessions keeps the memory flat
    return ProcessPoolExecutor(1, mp_context=context, initializer=end_with_parent, max_tasks_per_child=50)


def ready_process() -> ProcessPoolExecutor:
    """Return one process, at once, that has loaded all by the time somebody asks for a session."""
    pool = _process()
    pool.submit(load_all)
    return pool


def end_with_parent() -> None:
    """End this process as soon as the one that asked for it is gone, and at once by Ctrl-C."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    if (parent := multiprocessing.parent_process()) is not None:

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
        Dask is not installed, nobody answers at the address, the scheduler goes away, or it or a worker has no
        biodance.
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
            # two tasks a thread: the second waits where the first is worked on
            places = lambda: 2 * max(1, sum(client.nthreads().values()))  # noqa: E731
            yield from _on_cluster(client, work, waiting, alone, places)
            yield from _on_cluster(client, work, alone, None, lambda: 1)
    except (dask.CancelledError, OSError) as error:
        raise BiodanceError(
            f"--scheduler {scheduler}: the Dask scheduler went away. What was done is kept: start it again, and run "
            f"the same command."
        ) from error
    except (ImportError, RuntimeError) as error:
        raise BiodanceError(
            f"--scheduler {scheduler}: the scheduler and each worker need biodance {__version__}, as here "
            f"({str(error).partition(chr(10))[0]})."
        ) from error


def _on_cluster(
    client: "distributed.Client",
    work: Work,
    waiting: deque[SessionTask],
    alone: deque[SessionTask] | None,
    places: Callable[[], int],
) -> Outcomes:
    """Yield what is finished; what Dask blames for a worker's death goes to ``alone``, without it is given up."""
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


LEDGER = "ledger.sqlite"
_LOCK = ".running"
_TABLE = """
CREATE TABLE IF NOT EXISTS archive (folder TEXT PRIMARY KEY);
CREATE TABLE IF NOT EXISTS sessions (
    name TEXT PRIMARY KEY, fingerprint TEXT NOT NULL, status TEXT NOT NULL, reason TEXT NOT NULL,
    seconds REAL NOT NULL, memory_mb REAL NOT NULL, finished TEXT NOT NULL DEFAULT CURRENT_TIMESTAMP,
    times INTEGER NOT NULL DEFAULT 1
);
"""
_WRITE = """
INSERT INTO sessions (name, fingerprint, status, reason, seconds, memory_mb) VALUES (?, ?, ?, ?, ?, ?)
ON CONFLICT (name) DO UPDATE SET fingerprint = excluded.fingerprint, status = excluded.status, reason = excluded.reason,
    seconds = excluded.seconds, memory_mb = excluded.memory_mb, finished = CURRENT_TIMESTAMP, times = times + 1
"""


class Ledger:
    """The book of one archive's results, open for one run. Raises BiodanceError: the folder holds something else, the
    results of another archive, or another run is writing into it.
    """

    def __init__(self, folder: Path, archive: Path) -> None:
        known = folder / LEDGER
        if folder.exists() and not folder.is_dir():
            raise BiodanceError(f"{folder}: is a file; the results need a folder. Choose another --out.")
        if folder.is_dir() and any(folder.iterdir()) and not (known.exists() or (folder / _LOCK).exists()):
            raise BiodanceError(
                f"{folder}: holds files that are not of a batch run; nothing is overwritten. Choose another --out."
            )
        folder.mkdir(parents=True, exist_ok=True)
        self._lock = (folder / _LOCK).open("w", encoding="utf-8")
        try:
            # goes with the process, however that ends
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise BiodanceError(
                f"{folder}: another run is writing here. Wait for it, or choose another --out."
            ) from None
        self._book = sqlite3.connect(known)
        try:
            self._book.executescript(_TABLE)
        except sqlite3.Error:
            self.close()
            raise
        place = readable(archive.resolve())
        with self._book:
            self._book.execute("INSERT INTO archive SELECT ? WHERE NOT EXISTS (SELECT 1 FROM archive)", (place,))
        (owner,) = self._book.execute("SELECT folder FROM archive").fetchone()
        if owner != place:
            self.close()
            raise BiodanceError(f"{folder}: holds the results of another archive ({owner}). Choose another --out.")

    def write(self, outcome: Outcome) -> None:
        """Write down what became of a session; it is on disk when this returns."""
        row = attrgetter("name", "fingerprint", "status", "reason", "seconds", "memory_mb")(outcome)
        with self._book:
            self._book.execute(_WRITE, row)

    def note(self, outcomes: Iterable[Outcome]) -> None:
        """Write down what lies in the sessions' folders and is not in the book."""
        known = dict(self._book.execute("SELECT name, fingerprint FROM sessions"))
        for outcome in outcomes:
            if known.get(outcome.name) != outcome.fingerprint:
                self.write(outcome)

    def told(self, task: SessionTask) -> Outcome | None:
        """Return what is written down of a session that has no folder of its own (its process died each time)."""
        query = "SELECT fingerprint, status, reason FROM sessions WHERE name = ?"
        row = self._book.execute(query, (task.name,)).fetchone()
        if row is None or row[0] != task.fingerprint:
            return None
        return untold(task, SessionStatus(row[1]), row[2], Why.MACHINE)

    def close(self) -> None:
        """Close the book and let others in."""
        self._book.close()
        self._lock.close()


@dataclass(frozen=True)
class BatchRun:
    """What a run over an ``archive`` came to in a ``folder``: an outcome of every session, of this run (``fresh`` many)
    or an earlier one; ``left_out`` are tables of recordings that are no sessions.
    """

    archive: Path
    folder: Path
    outcomes: tuple[Outcome, ...]
    fresh: int
    left_out: tuple[str, ...] = ()

    @property
    def counts(self) -> dict[str, int]:
        """Sessions by status."""
        return dict(Counter(str(outcome.status) for outcome in self.outcomes))

    @property
    def needs_a_person(self) -> bool:
        """Whether any session is not simply done."""
        return any(one.status is not SessionStatus.DONE for one in self.outcomes)


def run_batch(
    archive: str | Path,
    out: str | Path,
    *,
    workers: int | str | None = None,
    chosen: tuple[str, ...] = (),
    pages: bool = True,
    limit: float = 1800.0,
    work: Work = process_session,
    tell: Callable[[str, int, int], None] = lambda *_: None,
) -> BatchRun:
    """Go through every session of an archive and write page, numbers and log of each, and the summary of all.

    A run that was stopped is gone on with by the same call: sessions that are done with the recordings, settings and
    version of now are not gone through again. ``archive`` holds session folders at any depth; ``out`` is empty, new, or
    of an earlier run over it, and gets ``summary.parquet``, ``summary.csv`` and ``report.html``. ``workers`` are
    processes of this machine, by default one for each core, or the address of a Dask scheduler whose workers see both
    folders; ``chosen`` settings, such as ``filter.cutoff=6``; ``pages`` whether a page is drawn for every session;
    ``limit`` s after which a session is given up; ``work`` what is done with one, for tests; ``tell`` is called with
    what is being done, how many sessions are finished, and of how many.

    Raises
    ------
    BiodanceError
        There is no session, the results' folder is taken, or settings or workers are not legal.
    """
    archive, folder = Path(archive), Path(out)
    assignments(chosen)
    sessions, indices = archive_folders(archive)
    if archive.resolve().is_relative_to(folder.resolve()):
        raise BiodanceError(f"{folder}: results must not lie among the recordings. Choose another --out.")
    if isinstance(workers, int) and workers < 1:
        raise BiodanceError(f"--workers {workers}: at least one process is needed. Leave it out for one a core.")
    if not limit > 0:
        raise BiodanceError(f"--limit {limit:g}: legal is more than 0 s for one session.")
    tasks = []
    for path in sessions:
        if not path.resolve().is_relative_to(folder.resolve()):
            below = path.relative_to(archive)  # as it is called there, also where it is a link to another disk
            name, fingerprint = readable(below if below.parts else archive.resolve().name), fingerprint_of(path, chosen)
            place = os.path.abspath(folder / SESSIONS / folder_name(name))  # workers of a cluster work elsewhere
            tasks.append(SessionTask(name, os.path.abspath(path), place, fingerprint, chosen, pages, limit))
    if not tasks:
        left = f"only recordings of plates ({indices[0]}): see biodance plates" if indices else "only results"
        raise BiodanceError(f"{archive}: holds no session, {left}.")
    with told_of_book(folder), closing(Ledger(folder, archive)) as ledger:
        clear_up(folder / SESSIONS)
        fresh = _work_off(tasks, ledger, workers, work, tell)
        outcomes = tuple(found for task in tasks if (found := outcome_of(task) or ledger.told(task)))
        left_out = tuple(str(path.relative_to(archive)) for path in indices)
        tell("writing the summary", len(tasks), len(tasks))
        write_summary(folder, archive.resolve().name, outcomes, left_out)
    return BatchRun(archive, folder, outcomes, fresh, left_out)


@contextmanager
def told_of_book(folder: Path) -> Iterator[None]:
    """Raise BiodanceError where the book cannot be written or is none: sessions' folders tell what is done."""
    try:
        yield
    except sqlite3.Error as error:
        raise BiodanceError(
            f"{folder / LEDGER}: {error}. Make room, or delete that file if it is damaged, and run the same command: "
            f"what is done is kept."
        ) from error


def _work_off(
    tasks: list[SessionTask],
    ledger: Ledger,
    workers: int | str | None,
    work: Work,
    tell: Callable[[str, int, int], None],
) -> int:
    """Go through tasks that are not final in their folders, write each down, and return how many were open."""
    # the folders tell what is done: the book does not know what was finished when a run was killed
    known = {task.name: found for task in tasks if (found := outcome_of(task))}
    open_tasks = [task for task in tasks if not (task.name in known and known[task.name].is_final(task))]
    ledger.note(known.values())  # finished when a run was killed
    done = len(tasks) - len(open_tasks)
    tell("beginning", done, len(tasks))
    if not open_tasks:
        return 0
    if isinstance(workers, str):
        finished = run_on_dask(open_tasks, work, scheduler=workers)
    else:
        finished = run_here(open_tasks, work, workers=min(workers or os.cpu_count() or 1, len(open_tasks)))
    with closing(finished):  # Ctrl-C while a line is told ends what is at work, too
        for task, outcome in finished:
            ledger.write(outcome)
            done += 1
            tell(f"{task.name}: {outcome.status}", done, len(tasks))
    return len(open_tasks)


def summary_of(run: BatchRun) -> dict[str, Any]:
    """Return what a run came to, for programs."""
    unread = [one for one in run.outcomes if one.unread]
    return {
        "archive": str(run.archive),
        "sessions": len(run.outcomes),
        "fresh": run.fresh,
        "counts": run.counts,
        "not_done": [{"session": one.name, "status": one.status, "reason": one.reason} for one in unread],
        "left_out": list(run.left_out),
        "seconds": round(sum(one.seconds for one in run.outcomes), 1),
        "peak_memory_mb": max((one.memory_mb for one in run.outcomes), default=None),
    }
