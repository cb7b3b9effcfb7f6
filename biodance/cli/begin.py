"""The commands with which a machine and a session begin: doctor, init, register."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from biodance.cli.app import DONE, NEEDS_A_PERSON, NOT_DONE, app, print_json, progress, say
from biodance.cli.options import ForceOption, JsonOption


@app.command(name="register")
def register_command(
    markers: Path,
    forces: Path,
    *,
    out: Annotated[Path, Parameter(name="--out", help="Folder for the session; it is made if it is missing.")],
    rough: Annotated[
        bool,
        Parameter(
            name="--rough", negative="", help="Also write a pose that is known less exactly than 5 mm, 0.5 deg, 5 ms."
        ),
    ] = False,
    json: JsonOption = False,
    force: ForceOption = False,
) -> int:
    """Find from the movement where force plates lie in the room of the markers and how late their clock is, and write
    one session.

    Parameters
    ----------
    markers
        A marker file (static trial and session.toml beside it), or the folder of such a session.
    forces
        A force file whose clock and place in the room are unknown.
    """
    from biodance.pipeline.registration import register

    with progress() as tell:
        found = register(markers, forces, out, rough=rough, force=force, tell=tell)
    if json:
        print_json(found.document())
    else:
        sys.stdout.write(f"{found}\n" + "".join(f"{note}\n" for note in found.notes))
    if found.status == "refused":
        say(found.reason)
        return NOT_DONE if found.pose is None else NEEDS_A_PERSON
    if not json:
        sys.stdout.write(f"{out}\n")
    if found.status == "rough":
        say(found.reason)
        return NEEDS_A_PERSON
    return DONE


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

    from biodance.lab.session.write import init_session
    from biodance.report.terminal import print_initialised

    found = init_session(session, subject_name=subject)
    if json:
        print_json(found)
    else:
        print_initialised(found, Console())
    return NEEDS_A_PERSON if found["refused"] or not found["marker_set"] else DONE
