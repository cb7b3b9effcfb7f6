"""The command that takes a recording in frame by frame, as a laboratory would send it."""

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from biodance.cli.app import DONE, NEEDS_A_PERSON, JsonOption, MarkersFile, Set, app, progress, say, show

if TYPE_CHECKING:
    from biodance.diagnosis.watch import LiveWarning
    from biodance.pipeline.live import LiveState


@app.command(name="live")
def live_command(
    file: Path,
    *,
    static: Annotated[Path | None, Parameter(help="Static trial; default: the one in the same folder as FILE.")] = None,
    real_time: Annotated[
        bool,
        Parameter(
            name="--real-time", negative="", help="Replay at the recorded frame rate instead of as fast as possible."
        ),
    ] = False,
    subject: str | None = None,
    markers: MarkersFile = None,
    chosen: Set = (),
    page: Annotated[
        int | None, Parameter(help="Also serve a live page on this port of 127.0.0.1; 0 picks a free port.")
    ] = None,
    json: JsonOption = False,
) -> int:
    """Replay a recording frame by frame: track, monitor for faults and identify while it runs.

    Parameters
    ----------
    file
        Recording with markers and force plates.
    subject
        Subject to read if a C3D file contains several.
    """
    from biodance.pipeline.stream import body_and_stream, replay
    from biodance.report.live import LivePage, live_document, print_live, state_line, warning_line
    from biodance.settings import assignments

    with progress() as tell, LivePage(page) if page is not None else nullcontext() as shown:
        if shown:
            say(f"Open {shown.address} on this machine.")

        def tell_state(state: "LiveState") -> None:
            tell(state_line(state))
            if shown:
                shown.show(state)

        def tell_warning(said: "LiveWarning") -> None:
            say(warning_line(said))
            if shown:
                shown.warn(said)

        body, trial = body_and_stream(
            file, static=static, subject=subject, markers=markers, settings=assignments(chosen), tell=tell
        )
        found = replay(body, trial, real_time=real_time, tell=tell_state, warn=tell_warning)
        if shown:
            shown.end(found.state, found.cause)
    document = live_document(found)
    show(document, partial(print_live, found), json=json)
    return NEEDS_A_PERSON if found.warnings or found.cause else DONE
