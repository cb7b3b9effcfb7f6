"""The command app: the laboratory's window."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from biodance.cli.app import DONE, app, say, whole


@app.command(name="app")
def app_command(
    folder: Path | None = None,
    *,
    out: Annotated[
        Path | None, Parameter(help="Folder of the results; default: FOLDER-results beside the folder.")
    ] = None,
    port: Annotated[int, Parameter(converter=whole, help="Port of 127.0.0.1; 0 takes a free one.")] = 0,
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
    import sys

    from biodance.app.server import serve_window
    from biodance.app.sessions import results_beside

    place = Path(folder or ".").resolve()
    results = out or results_beside(place)

    def tell(address: str) -> None:
        sys.stdout.write(f"{address}\n")
        sys.stdout.flush()
        say(f"The window over {place} is open; its results go to {results}. Ctrl-C ends it.")

    serve_window(place, results, port=port, opened=browser, tell=tell)
    return DONE
