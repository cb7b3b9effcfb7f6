"""Commands on recordings and results as they lie on disk: inspect, settings, export."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from biodance.cli.app import DONE, NEEDS_A_PERSON, NOT_DONE, app, print_json, progress, say
from biodance.cli.options import JsonOption, MarkersFile, Set, SubjectOption


@app.command(name="inspect")
def inspect_command(
    *paths: Path, subject: SubjectOption = None, markers: MarkersFile = None, json: JsonOption = False
) -> int:
    """Say what is in recordings: markers, gaps, plates, the weight on them, and every decision the readers take.

    Parameters
    ----------
    paths
        Files, or folders whose recordings are all read.
    """
    from rich.console import Console

    from biodance.lab.inspect import inspect_paths
    from biodance.report.terminal import print_inspected

    with progress() as tell:
        records = inspect_paths(paths, subject=subject, markers=markers, tell=tell)
    if json:
        print_json(records)
    else:
        print_inspected(records, Console())
    states = {record["status"] for record in records}
    return NOT_DONE if states == {"refused"} else NEEDS_A_PERSON if states - {"ok"} else DONE


@app.command
def settings(session: Path | None = None, *, chosen: Set = (), json: JsonOption = False) -> int:
    """Print everything an analyst may choose: value, unit, meaning and legal range, as it may stand in session.toml.

    Parameters
    ----------
    session
        A session folder, whose session.toml is then followed.
    """
    from biodance.lab.session.file import read_session_file
    from biodance.settings import USUAL, assignments

    found = (read_session_file(session).settings if session else USUAL).changed(assignments(chosen))
    if json:
        print_json([row._asdict() for row in found.all()])
    else:
        sys.stdout.write(found.to_toml())
    return DONE


@app.command(name="export")
def export_command(
    source: Path,
    *,
    format: Annotated[
        str,
        Parameter(help="osim, urdf, mjcf, biomod, glb, csv; of one trial trc, mot, c3d, rerun; folders opensim, bids."),
    ],
    out: Annotated[Path, Parameter(help="The file to write.")],
    trial: Annotated[str | None, Parameter(help="Name of the trial for trc, mot and c3d.")] = None,
    subject: SubjectOption = None,
    meshes: Annotated[
        Path | None, Parameter(help="Folder with a closed mesh a segment (right_thigh.stl, m) for glb and osim.")
    ] = None,
    markers: MarkersFile = None,
    force: Annotated[bool, Parameter(name="--force", negative="", help="Replace the file if it exists.")] = False,
) -> int:
    """Write a session, or the results of `biodance identify`, for another program.

    Parameters
    ----------
    source
        Session folder, or folder with the results of `biodance identify`; or hoap3, the robot from our own tables.
    """
    from biodance.pipeline.export import export as write
    from biodance.pipeline.export import replaceable

    with progress() as tell, replaceable(out, force=force) as place:
        _, sentence = write(
            source, place, format=format, trial=trial, subject=subject, markers=markers, meshes=meshes, tell=tell
        )
    say(sentence)
    sys.stdout.write(f"{out}\n")
    return DONE
