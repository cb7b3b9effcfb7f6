"""The command ``biodance``: parse, call, print. Rooms are imported inside the commands, so that ``--help`` is quick.

Exit codes: 0 done, 1 done but something was refused or needs a person, 2 could not be done (one sentence on stderr), 130 stopped by Ctrl-C.
"""

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter

from biodance import __version__

if TYPE_CHECKING:
    from collections.abc import Callable

DONE, NEEDS_A_PERSON, NOT_DONE, STOPPED = 0, 1, 2, 130

app = App(
    name="biodance",
    version=__version__,
    help="Segment inertial parameters of a person, measured from markers and force plates. For research use, not a diagnosis.",
    suppress_keyboard_interrupt=False,
)

Json = Annotated[bool, Parameter(name="--json", negative="", help="Print one JSON document on stdout and nothing else there.")]
Force = Annotated[bool, Parameter(name="--force", negative="", help="Write into a folder that already holds files.")]
Out = Annotated[Path, Parameter(name="--out", help="Folder for the results; it is made if it is missing.")]


def say(sentence: str) -> None:
    """Write one line to stderr."""
    sys.stderr.write(sentence.rstrip() + "\n")


def _print(document: object) -> None:
    from biodance.report.results_json import to_text

    sys.stdout.write(to_text(document))


@contextmanager
def _progress() -> "Iterator[Callable[[str], None]]":
    """Yield a function that shows on stderr what is being done: one changing line on a terminal, nothing elsewhere."""
    from rich.console import Console

    with Console(stderr=True).status("") as status:
        yield lambda text: status.update(text)


@app.command
def inspect(*paths: Path, json: Json = False) -> int:
    """Say what is in recordings: markers, gaps, plates, the weight on them, and every decision the readers take.

    Parameters
    ----------
    paths
        Files, or folders whose recordings are all read.
    """
    from rich.console import Console

    from biodance.lab.inspect import inspect_paths
    from biodance.report.terminal import print_inspected

    with _progress() as tell:
        records = inspect_paths(paths, tell=tell)
    if json:
        _print(records)
    else:
        print_inspected(records, Console())
    states = {record["status"] for record in records}
    return NOT_DONE if states == {"refused"} else NEEDS_A_PERSON if states - {"ok"} else DONE


@app.command
def doctor(*, json: Json = False) -> int:
    """Say what works on this machine, and how to mend what does not."""
    from dataclasses import asdict

    from rich.console import Console

    from biodance.doctor import examine
    from biodance.report.terminal import print_findings

    with _progress() as tell:
        findings = examine(tell=tell)
    if json:
        _print([asdict(finding) for finding in findings])
    else:
        print_findings(findings, Console())
    return DONE if all(finding.works for finding in findings if finding.needed) else NEEDS_A_PERSON


def run(tokens: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; every expected fault is one sentence on stderr."""
    from biodance.errors import BiodanceError

    try:
        return app(tokens, exit_on_error=False, print_error=False, result_action="return_value") or DONE
    except CycloptsError as error:
        say(f"{' '.join(str(error).split())} See biodance --help.")
    except BiodanceError as error:
        say(str(error))
    except OSError as error:
        say(f"{error.filename or 'biodance'}: {error.strerror or error}.")
    except KeyboardInterrupt:
        say("Stopped before the command was done; what was already written is complete.")
        return STOPPED
    return NOT_DONE


def main() -> None:
    """Run the command line and leave with its exit code."""
    sys.exit(run())
