"""Commands on a machine and what lies on its disk: app, doctor, init, register, inspect, settings, export, live."""

import sys
from contextlib import nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from biodance.cli import shared

if TYPE_CHECKING:
    from biodance.diagnosis.watch import LiveWarning
    from biodance.pipeline.live import LiveState


@shared.app.command(name="register", group=shared.LABORATORY)
def register_command(
    markers: Path,
    forces: Path,
    *,
    out: Annotated[Path, Parameter(help="Folder of the new session; created if it does not exist.")],
    rough: Annotated[
        bool,
        Parameter(help="Write the session even if the registration is less certain than 5 mm, 0.5 deg or 5 ms."),
    ] = False,
    json: shared.JsonOption = False,
    force: shared.ForceOption = False,
) -> int:
    """Register a force file to a marker file: estimate the position, rotation and time delay of the plates from the
    movement, and write both as one session.

    Parameters
    ----------
    markers
        Marker file, with the static trial and session.toml in the same folder; or the folder of such a session.
    forces
        Force file with unknown clock and unknown plate positions.
    """
    from biodance.pipeline.front import register

    with shared.progress() as tell:
        found = register(markers, forces, out, rough=rough, force=force, tell=tell)
    if json:
        shared.print_json(found.document())
    else:
        sys.stdout.write(f"{found}\n" + "".join(f"{note}\n" for note in found.notes))
    if found.status == "refused":
        shared.say(found.reason)
        return shared.NOT_DONE if found.pose is None else shared.NEEDS_A_PERSON
    if not json:
        shared.show_place(out)
    if found.status == "rough":
        shared.say(found.reason)
        return shared.NEEDS_A_PERSON
    return shared.DONE


@shared.app.command(name="doctor", group=shared.EVERYDAY)
def doctor_command(*, json: shared.JsonOption = False) -> int:
    """Check the installation, and explain how to fix what does not work."""
    from dataclasses import asdict

    from biodance.doctor import examine_machine
    from biodance.report.terminal import print_findings

    with shared.progress() as tell:
        findings = examine_machine(tell=tell)
    shared.show([asdict(one) for one in findings] if json else findings, print_findings, json=json)
    return shared.DONE if all(finding.works for finding in findings if finding.needed) else shared.NEEDS_A_PERSON


@shared.app.command(name="init", group=shared.EVERYDAY)
def init_command(session: Path, *, subject: str | None = None, json: shared.JsonOption = False) -> int:
    """Create session.toml with the detected and guessed metadata of a session (subject, trial roles, markers, plates)
    for review. An existing session.toml is never overwritten.

    Parameters
    ----------
    session
        Folder with the recordings of one visit.
    subject
        Subject to read if a C3D file contains several.
    """
    from biodance.lab.inspect import init_session
    from biodance.report.terminal import print_initialised

    found = init_session(session, subject_name=subject)
    shared.show(found, print_initialised, json=json)
    return shared.NEEDS_A_PERSON if found["refused"] or not found["marker_set"] else shared.DONE


@shared.app.command(name="inspect", group=shared.EVERYDAY)
def inspect_command(
    *paths: Path,
    subject: shared.SubjectOption = None,
    markers: shared.MarkersFile = None,
    json: shared.JsonOption = False,
) -> int:
    """Show the contents of recordings: markers, gaps, plates, the load on them, and every decision made on reading.

    Parameters
    ----------
    paths
        Files or folders; all recordings of a folder are read.
    """
    from biodance.lab.inspect import inspect_paths
    from biodance.report.terminal import print_inspected

    with shared.progress() as tell:
        records = inspect_paths(paths, subject=subject, markers=markers, tell=tell)
    shared.show(records, print_inspected, json=json)
    states = {record["status"] for record in records}
    if states == {"refused"}:
        more = f" Nor can the other {len(records) - 1}." if len(records) > 1 else ""
        shared.say(f"{records[0]['reason']}{more}")
        return shared.NOT_DONE
    return shared.NEEDS_A_PERSON if states - {"ok"} else shared.DONE


@shared.app.command(group=shared.ADVANCED)
def settings(session: Path | None = None, *, chosen: shared.Set = (), json: shared.JsonOption = False) -> int:
    """Print all settings with value, unit, meaning and allowed range, in the format of session.toml.

    Parameters
    ----------
    session
        Session folder; the settings of its session.toml are applied.
    """
    from biodance.lab.session.file import read_session_file
    from biodance.lab.session.read import session_place
    from biodance.settings import USUAL, assignments

    usual = read_session_file(session_place(session)[1]).settings if session else USUAL
    found = usual.changed(assignments(chosen))
    if json:
        shared.print_json([row._asdict() for row in found.all()])
    else:
        sys.stdout.write(found.to_toml())
    return shared.DONE


@shared.app.command(name="export", group=shared.EVERYDAY)
def export_command(
    source: Path,
    *,
    format: Annotated[
        str,
        Parameter(
            help="Models: osim, urdf, mjcf, biomod, glb, csv. One trial: trc, mot, c3d, rerun. Folders: opensim, bids."
        ),
    ],
    out: Annotated[Path, Parameter(help="Output file, or folder for opensim and bids.")],
    trial: Annotated[str | None, Parameter(help="Name of the trial to export, for trial formats.")] = None,
    subject: shared.SubjectOption = None,
    meshes: Annotated[
        Path | None,
        Parameter(help="Folder with one closed mesh per segment (right_thigh.stl, in m), for glb and osim."),
    ] = None,
    markers: shared.MarkersFile = None,
    force: Annotated[bool, Parameter(help="Overwrite an existing file.")] = False,
) -> int:
    """Export a session, or the results of `biodance identify`, to the format of another program.

    Parameters
    ----------
    source
        Session folder; results folder of `biodance identify`; or hoap3, the built-in robot model.
    """
    from biodance.lab.plain_text import whole_file
    from biodance.pipeline.export import FOLDERS
    from biodance.pipeline.export import export as write
    from biodance.report.files import refuse_file

    if format not in FOLDERS:
        refuse_file(out, force=force)
    replaced = whole_file(out, over=True) if force and out.is_file() else nullcontext(out)
    with shared.progress() as tell, replaced as place:
        _, sentence = write(
            source, place, format=format, trial=trial, subject=subject, markers=markers, meshes=meshes, tell=tell
        )
    shared.say(sentence)
    shared.show_place(out)
    return shared.DONE


@shared.app.command(name="live", group=shared.LABORATORY)
def live_command(
    file: Path,
    *,
    static: Annotated[Path | None, Parameter(help="Static trial; default: the one in the same folder as FILE.")] = None,
    real_time: Annotated[
        bool,
        Parameter(help="Replay at the recorded frame rate instead of as fast as possible."),
    ] = False,
    subject: str | None = None,
    markers: shared.MarkersFile = None,
    chosen: shared.Set = (),
    page: Annotated[
        int | None, Parameter(help="Also serve a live page on this port of 127.0.0.1; 0 picks a free port.")
    ] = None,
    json: shared.JsonOption = False,
) -> int:
    """Replay a recording frame by frame: track, monitor for faults and identify while it runs.

    Parameters
    ----------
    file
        Recording with markers and force plates.
    subject
        Subject to read if a C3D file contains several.
    """
    from biodance.pipeline.live import body_and_stream, replay
    from biodance.report.live import LivePage, live_document, print_live, state_line, warning_line
    from biodance.settings import assignments

    with shared.progress() as tell, LivePage(page) if page is not None else nullcontext() as shown:
        if shown:
            shared.say(f"Open {shown.address} on this machine.")

        def tell_state(state: "LiveState") -> None:
            tell(state_line(state))
            if shown:
                shown.show(state)

        def tell_warning(said: "LiveWarning") -> None:
            shared.say(warning_line(said))
            if shown:
                shown.warn(said)

        body, trial = body_and_stream(
            file, static=static, subject=subject, markers=markers, settings=assignments(chosen), tell=tell
        )
        if shown:
            shown.body = body
        found = replay(body, trial, real_time=real_time, tell=tell_state, warn=tell_warning)
        if shown:
            shown.end(found.state, found.cause)
    document = live_document(found)
    shared.show(document, partial(print_live, found), json=json)
    return shared.NEEDS_A_PERSON if found.warnings or found.cause else shared.DONE


@shared.app.command(name="app", group=shared.EVERYDAY)
def app_command(
    folder: Path | None = None,
    *,
    out: Annotated[
        Path | None, Parameter(help="Folder of the results; default: FOLDER-results beside the folder.")
    ] = None,
    port: Annotated[int, Parameter(converter=shared.whole, help="Port of 127.0.0.1; 0 takes a free one.")] = 0,
    browser: Annotated[
        bool, Parameter(negative=("--no-browser", "--no-open"), help="Open the window in the browser.")
    ] = True,
) -> int:
    """Open the laboratory's window in the browser: the sessions of a folder, their roles, markers, plates and steps to
    be corrected with the mouse, runs, results and exports. Ends with Ctrl-C; nothing leaves this machine.

    Parameters
    ----------
    folder
        Archive or session folder; default: the working folder.
    """
    from biodance.app.server import serve_window
    from biodance.app.sessions import results_beside

    place = Path(folder or ".").resolve()
    results = out or results_beside(place)

    def tell(address: str) -> None:
        sys.stdout.write(f"{address}\n")
        sys.stdout.flush()
        shared.say(f"The window over {place} is open; its results go to {results}. Ctrl-C ends it.")

    with suppress(KeyboardInterrupt):  # that is how a window ends
        serve_window(place, results, port=port, opened=browser, tell=tell)
    return shared.DONE
