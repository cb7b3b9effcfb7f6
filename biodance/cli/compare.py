"""The command compare: visits of one person side by side."""

from functools import partial
from pathlib import Path

from biodance.cli.app import ForceOption, JsonOption, OutOption, app, progress, show
from biodance.cli.session import exit_code, put_results


@app.command(name="compare")
def compare_command(
    *visits: Path,
    out: OutOption,
    json: JsonOption = False,
    force: ForceOption = False,
) -> int:
    """Compare two or more visits of one person: what changed from the first to the last beyond its uncertainty.

    Parameters
    ----------
    visits
        Session folders of one person, the earliest first.
    """
    from biodance.lab.session.results_folder import results_folder
    from biodance.pipeline.visits import compare_visits, read_visits
    from biodance.report.visits import COMPARE_PAGE, print_compared, write_visits

    with progress() as tell:
        sessions = read_visits(visits, tell=tell)
        for one in sessions:  # the results lie among the recordings of none of them
            place = results_folder(out, one.folder, force=force)
        found = compare_visits(sessions, tell=tell)
        tell("writing the page")
        document = write_visits(found, place.part)
        inputs = {trial.source.path: trial.source.sha256 for one in sessions for trial in one.trials}
        folder = put_results(place, sessions[0].folder, inputs)
    show(document, partial(print_compared, found), json=json, path=folder / COMPARE_PAGE)
    return exit_code(document)
