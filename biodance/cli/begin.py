"""The commands with which a machine and a session begin: doctor, init."""

from pathlib import Path

from biodance.cli.app import DONE, NEEDS_A_PERSON, app, print_json
from biodance.cli.options import JsonOption
from biodance.cli.progress import progress


@app.command(name="doctor")
def doctor_command(*, json: JsonOption = False) -> int:
    """Say what works on this machine, and how to mend what does not."""
    from dataclasses import asdict

    from rich.console import Console

    from biodance.doctor import examine_machine
    from biodance.report.terminal import print_findings

    with progress() as tell:
        findings = examine_machine(tell=tell)
    if json:
        print_json([asdict(finding) for finding in findings])
    else:
        print_findings(findings, Console())
    return DONE if all(finding.works for finding in findings if finding.needed) else NEEDS_A_PERSON


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
