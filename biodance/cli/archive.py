"""Commands on the archive of a laboratory: all its sessions, its plates over time, its own tolerances."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from biodance.cli import shared
from biodance.cli.session import put_results
from biodance.errors import without_codes


@shared.app.command(name="batch", group=shared.LABORATORY)
def batch_command(
    archive: Path,
    *,
    out: shared.OutOption,
    workers: Annotated[int | None, Parameter(converter=shared.whole)] = None,
    scheduler: str | None = None,
    chosen: shared.Set = (),
    pages: Annotated[bool, Parameter(negative="--no-pages")] = True,
    limit: float = 1800.0,
    json: shared.JsonOption = False,
) -> int:
    """Report every session of an archive, on this machine or on a Dask cluster. An interrupted run is resumed by the
    same command.

    Parameters
    ----------
    archive
        Folder that contains the session folders, at any depth.
    workers
        Number of local processes; default: one per core.
    scheduler
        Address of a running Dask scheduler, e.g. tcp://host:8786; its workers need access to both folders.
    pages
        Write a report page for every session; the numerical results are always written.
    limit
        Time limit per session, s; a session that takes longer is abandoned.
    """
    from biodance.batch.run import run_batch, summary_of

    with shared.progress() as tell:
        found = run_batch(
            archive, out, workers=scheduler or workers, chosen=chosen, pages=pages, limit=limit,
            tell=lambda what, done, of: tell(f"{done} of {of} sessions: {what}"),
        )  # fmt: skip
    if json:
        shared.print_json(summary_of(found))
    else:
        words = {"needs a person": "need a person"}
        sorts = sorted(found.counts.items())
        counts = ", ".join(f"{n} {words.get(sort, sort) if n > 1 else sort}" for sort, n in sorts)
        of = len(found.outcomes)
        shared.say(f"{of} session{'s' * (of > 1)}: {counts}; {found.fresh} of them in this run. {out / 'report.html'}")
    return shared.NEEDS_A_PERSON if found.needs_a_person else shared.DONE


@shared.app.command(name="plates", group=shared.LABORATORY)
def plates_command(
    archive: Path, *, out: shared.OutOption, json: shared.JsonOption = False, force: shared.ForceOption = False
) -> int:
    """Analyse the force plates of one laboratory over all its sessions: trends, change points and outlying sessions.

    Parameters
    ----------
    archive
        Folder that contains session folders at any depth, or trials.csv with text recordings of one plate.
    """
    from biodance.lab.session.archive import archive_folder
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.learn import judge_plates
    from biodance.report.laboratory import print_plates, write_plates

    with shared.progress() as tell:
        place = results_folder(out, archive_folder(archive), force=force)
        found = judge_plates(archive, tell=tell)
        tell("writing the page")
        document = write_plates(found, place.part)
        folder = put_results(place, archive_folder(archive))
    shared.show(document, print_plates, json=json, path=folder / "report.html")
    return shared.NEEDS_A_PERSON if found.judgement.findings or found.refused else shared.DONE


@shared.app.command(name="learn", group=shared.LABORATORY)
def learn_command(
    archive: Path,
    *,
    out: Annotated[Path, Parameter(help="Output file, lab.toml; an existing file is never overwritten.")],
    healthy: Annotated[
        str,
        Parameter(help="Sessions of healthy people, as S01,S02,S03: normal bands, GPS and GDI."),
    ] = "",
    json: shared.JsonOption = False,
) -> int:
    """Estimate a laboratory's own tolerances, the usual sizes of errors that are not faults, from fault-free sessions.

    Parameters
    ----------
    archive
        Folder that contains session folders, at any depth.
    """
    from biodance.lab.plain_text import refuse_present, write_whole
    from biodance.pipeline.learn import learn_laboratory
    from biodance.report.files import refuse_missing_folder
    from biodance.report.laboratory import lab_file_text, learned_document, print_learned

    refuse_present(out)
    refuse_missing_folder(out)
    with shared.progress() as tell:
        named = [one.strip() for one in healthy.split(",") if one.strip()]
        found = learn_laboratory(archive, healthy=named, tell=tell)
        write_whole(out, lab_file_text(found).encode())
    shared.show(learned_document(found), print_learned, json=json, path=out)
    return shared.NEEDS_A_PERSON if found.left_out else shared.DONE


@shared.app.command(name="verify", group=shared.EVERYDAY)
def verify_command(place: Path, *, json: shared.JsonOption = False) -> int:
    """Check, years later too, that results are whole, of one run, and of the recordings as they lie there now.

    Parameters
    ----------
    place
        A results folder, or a folder that contains results folders at any depth.
    """
    from dataclasses import asdict

    from biodance.errors import BiodanceError
    from biodance.lab.session.results_folder import check_results, differing, results_below

    folders = results_below(place) if place.is_dir() else ()
    if not folders:
        raise BiodanceError(f"{place}: holds no results with a manifest.json (earlier versions wrote none).")
    found = [one for folder in folders if (one := check_results(folder))]
    if json:
        shared.print_json([{**asdict(one), "folder": str(one.folder), "whole": one.whole} for one in found])
    for one in () if json else found:
        wrong = {"missing": one.missing, "changed": one.changed, "recordings changed or not there": one.inputs_changed}
        wrong |= {"manifest and results.json differ in": one.otherwise}
        said = "; ".join(f"{what}: {', '.join(names)}" for what, names in wrong.items() if names)
        sys.stdout.write(without_codes(f"{one.folder}: {said or 'whole'}, biodance {one.manifest.software}") + "\n")
    if not json and (differ := differing(found)):
        sys.stdout.write(without_codes(f"look: not all of these folders were made alike; {'; '.join(differ)}") + "\n")
    return shared.DONE if all(one.whole and not one.inputs_changed for one in found) else shared.NEEDS_A_PERSON
