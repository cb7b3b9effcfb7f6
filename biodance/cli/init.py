"""The command that writes a session's guesses into its session.toml."""

from pathlib import Path

from biodance.cli.app import DONE, NEEDS_A_PERSON, app, print_json
from biodance.cli.options import JsonOption


@app.command(name="init")
def init_command(session: Path, *, subject: str | None = None, json: JsonOption = False) -> int:
    """Write what was found and guessed of a session (subject, roles, markers, plates) into its session.toml, to be
    confirmed or corrected; never over an existing one.

    Parameters
    ----------
    session
        Folder with the recordings of one visit.
    subject
        The person, where C3D files hold several.
    """
    from rich.console import Console

    from biodance.lab.session.init import init_session
    from biodance.report.terminal import print_initialised

    found = init_session(session, subject_name=subject)
    if json:
        print_json(found)
    else:
        print_initialised(found, Console())
    return NEEDS_A_PERSON if found["refused"] or not found["marker_set"] else DONE
