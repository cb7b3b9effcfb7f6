"""What all commands share: the application, its exit codes, its common options, and how it talks to the person at
the terminal.
"""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from biodance.version import __version__

DONE, NEEDS_A_PERSON, NOT_DONE, STOPPED = 0, 1, 2, 130

app = App(
    name="biodance",
    version=__version__,
    help="Segment inertial parameters of a person, measured from markers and force plates. For research use, not a "
    "diagnosis.",
    suppress_keyboard_interrupt=False,
)

JsonOption = Annotated[
    bool, Parameter(name="--json", negative="", help="Print one JSON document on stdout and nothing else there.")
]
ForceOption = Annotated[
    bool, Parameter(name="--force", negative="", help="Write into a folder that already holds files.")
]
Tables = Annotated[
    Path | None, Parameter(name="--tables", help="Folder for the same numbers as tables, CSV and Parquet.")
]
OutOption = Annotated[Path, Parameter(name="--out", help="Folder for the results; it is made if it is missing.")]

ReferenceOption = Annotated[
    Path | None,
    Parameter(
        name="--reference",
        help="An earlier session of the same person without load: changes and loads are then told against it.",
    ),
]
BodyOption = Annotated[
    Path | None,
    Parameter(
        name="--body",
        help="body.json of an earlier session of the same person: what is known before, instead of the table.",
    ),
]
LabOption = Annotated[
    Path | None, Parameter(name="--lab", help="lab.toml: the laboratory's accepted corrections, made first.")
]
Set = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        negative=(),
        help="Choose a setting: --set filter.cutoff=6; may be repeated. `biodance settings` prints all.",
    ),
]
MarkersFile = Annotated[
    str | None,
    Parameter(
        name="--markers", help="The marker set that was worn: a TOML file of your own (see CONTRIBUTING.md), or a name."
    ),
]


def say(sentence: str) -> None:
    """Write one line to stderr."""
    sys.stderr.write(sentence.rstrip() + "\n")


def print_json(document: object) -> None:
    """Write one JSON document to stdout."""
    from biodance.report.documents.session import to_text

    sys.stdout.write(to_text(document))
