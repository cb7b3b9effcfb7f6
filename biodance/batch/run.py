"""An archive through all stages: what is done stays done, what fails is told, the rest goes on."""

import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from biodance.batch.engines import Work, run_here, run_on_dask
from biodance.batch.ledger import Ledger
from biodance.batch.summary import SESSIONS, folder_name, write_summary
from biodance.batch.work import Outcome, SessionStatus, SessionTask, fingerprint_of, outcome_of, process_session
from biodance.errors import BiodanceError
from biodance.lab.session.archive import archive_folders
from biodance.settings import assignments


@dataclass(frozen=True)
class BatchRun:
    """What a run over an archive came to.

    Parameters
    ----------
    archive, folder : pathlib.Path
        Of the recordings and of the results.
    outcomes : tuple of Outcome
        One for every session of the archive, of this run or an earlier one, by name.
    fresh : int
        Sessions gone through in this run.
    left_out : tuple of str
        Tables of recordings that are no sessions.
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
    version of now are not gone through again.

    Parameters
    ----------
    archive : str or pathlib.Path
        Folder with session folders at any depth.
    out : str or pathlib.Path
        Folder for the results: empty, new, or of an earlier run over this archive.
    workers : int or str, optional
        Processes of this machine, by default one for each core; or the address of a Dask scheduler whose workers see
        both folders.
    chosen : tuple of str
        Settings, such as ``filter.cutoff=6``.
    pages : bool
        Whether a page is drawn for every session.
    limit : float
        s after which a session is given up.
    work : callable
        What is done with one session; for tests.
    tell : callable, optional
        Called with what is being done, how many sessions are finished, and of how many.

    Returns
    -------
    BatchRun
        What became of every session; ``summary.parquet``, ``summary.csv`` and ``report.html`` in ``out``.

    Raises
    ------
    BiodanceError
        There is no session, the results' folder is taken, or settings or workers are not legal.
    """
    archive, folder = Path(archive), Path(out)
    assignments(chosen)
    sessions, indices = archive_folders(archive)
    if folder.resolve() in (archive.resolve(), *archive.resolve().parents):
        raise BiodanceError(f"{folder}: results must not lie among the recordings. Choose another --out.")
    if isinstance(workers, int) and workers < 1:
        raise BiodanceError(f"--workers {workers}: at least one process is needed. Leave it out for one a core.")
    if not limit > 0:
        raise BiodanceError(f"--limit {limit:g}: legal is more than 0 s for one session.")
    inside = folder.resolve()
    tasks = [
        SessionTask(
            name,
            str(path),
            str(folder / SESSIONS / folder_name(name)),
            fingerprint_of(path, chosen),
            chosen,
            pages,
            limit,
        )
        for path in sessions
        if inside not in (path.resolve(), *path.resolve().parents)
        for name in [_name(path, archive)]
    ]
    if not tasks:
        left = f"only recordings of plates ({indices[0]}): see biodance plates" if indices else "only results"
        raise BiodanceError(f"{archive}: holds no session, {left}.")
    with Ledger(folder, archive) as ledger:
        fresh = _work_off(tasks, ledger, workers, work, tell)
        outcomes = tuple(found for task in tasks if (found := outcome_of(task) or ledger.told(task)))
        run = BatchRun(archive, folder, outcomes, fresh, tuple(str(path.relative_to(archive)) for path in indices))
        tell("writing the summary", len(tasks), len(tasks))
        write_summary(run.folder, run.archive.resolve().name, run.outcomes, run.left_out)
    return run


def _work_off(
    tasks: list[SessionTask],
    ledger: Ledger,
    workers: int | str | None,
    work: Work,
    tell: Callable[[str, int, int], None],
) -> int:
    """Go through all tasks that are open, write down each as it is finished, and return how many were open."""
    open_tasks = ledger.open_tasks(tasks)
    known = [found for task in open_tasks if (found := outcome_of(task))]  # finished when the run was killed
    for outcome in known:
        ledger.write(outcome)
    open_tasks = ledger.open_tasks(open_tasks)
    done = len(tasks) - len(open_tasks)
    tell("beginning", done, len(tasks))
    if not open_tasks:
        return 0
    if isinstance(workers, str):
        finished = run_on_dask(open_tasks, work, scheduler=workers)
    else:
        finished = run_here(open_tasks, work, workers=min(workers or os.cpu_count() or 1, len(open_tasks)))
    for task, outcome in finished:
        ledger.write(outcome)
        done += 1
        tell(f"{task.name}: {outcome.status}", done, len(tasks))
    return len(open_tasks)


def _name(session: Path, archive: Path) -> str:
    """Return the name of a session: its folder below the archive, that of the archive where it is one session."""
    below = session.resolve().relative_to(archive.resolve())
    return below.as_posix() if below.parts else archive.resolve().name


def summary_of(run: BatchRun) -> dict[str, Any]:
    """Return what a run came to, for programs."""
    return {
        "archive": str(run.archive),
        "sessions": len(run.outcomes),
        "fresh": run.fresh,
        "counts": run.counts,
        "not_done": [
            {"session": one.name, "status": one.status, "reason": one.reason} for one in run.outcomes if one.unread
        ],
        "left_out": list(run.left_out),
        "seconds": round(sum(one.seconds for one in run.outcomes), 1),
        "peak_memory_mb": max((one.memory_mb for one in run.outcomes), default=None),
    }
