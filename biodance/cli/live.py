"""The command that takes a recording in frame by frame, as a laboratory would send it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from biodance.cli.app import DONE, NEEDS_A_PERSON, JsonOption, MarkersFile, Set, app, print_json, say
from biodance.cli.progress import progress


@app.command(name="live")
def live_command(
    file: Path,
    *,
    static: Annotated[
        Path | None, Parameter(help="The static trial; by default that of the folder in which the file lies.")
    ] = None,
    real_time: Annotated[
        bool, Parameter(name="--real-time", negative="", help="At the recording's own rate, not as fast as it goes.")
    ] = False,
    subject: str | None = None,
    markers: MarkersFile = None,
    chosen: Set = (),
    json: JsonOption = False,
) -> int:
    """Replay a recording as a stream: track, watch for faults and identify while it runs.

    Parameters
    ----------
    file
        A recording with markers and force plates.
    subject
        The person, where C3D files hold several.
    """
    from rich.console import Console

    from biodance.pipeline.replay import body_and_stream, replay
    from biodance.report.documents.live import live_document
    from biodance.report.terminal_live import print_live, state_line, warning_line
    from biodance.settings import assignments

    with progress() as tell:
        body, trial = body_and_stream(
            file, static=static, subject=subject, markers=markers, settings=assignments(chosen), tell=tell
        )
        found = replay(
            body,
            trial,
            real_time=real_time,
            tell=lambda state: tell(state_line(state)),
            warn=lambda said: say(warning_line(said)),
        )
    document = live_document(found)
    if json:
        print_json(document)
    else:
        print_live(found, document, Console())
    return NEEDS_A_PERSON if found.warnings or found.cause else DONE
