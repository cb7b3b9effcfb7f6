"""The command on a whole archive."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from biodance.cli.app import DONE, NEEDS_A_PERSON, app, print_json, say
from biodance.cli.options import JsonOption, OutOption, Set
from biodance.cli.progress import progress


@app.command(name="batch")
def batch_command(
    archive: Path,
    *,
    out: OutOption,
    workers: int | None = None,
    scheduler: str | None = None,
    chosen: Set = (),
    pages: Annotated[bool, Parameter(negative="--no-pages")] = True,
    limit: float = 1800.0,
    json: JsonOption = False,
) -> int:
    """Report every session of an archive: thousands, on this machine or on a Dask cluster; a stopped run is gone on
    with by the same command.

    Parameters
    ----------
    archive
        Folder with the session folders, at any depth.
    workers
        Processes of this machine; by default one for each core.
    scheduler
        Address of a running Dask scheduler, such as tcp://host:8786; its workers must see both folders.
    pages
        Draw a page for every session; the numbers are written always.
    limit
        Seconds after which one session is given up.
    """
    from biodance.batch.run import run_batch, summary_of

    with progress() as tell:
        found = run_batch(
            archive, out, workers=scheduler or workers, chosen=chosen, pages=pages, limit=limit,
            tell=lambda what, done, of: tell(f"{done} of {of} sessions: {what}"),
        )  # fmt: skip
    if json:
        print_json(summary_of(found))
    else:
        words = {"needs a person": "need a person"}
        sorts = sorted(found.counts.items())
        counts = ", ".join(f"{n} {words.get(sort, sort) if n > 1 else sort}" for sort, n in sorts)
        say(f"{len(found.outcomes)} sessions: {counts}; {found.fresh} of them in this run. {out / 'report.html'}")
    return NEEDS_A_PERSON if found.needs_a_person else DONE
