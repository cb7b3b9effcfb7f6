"""What all commands share: the application, its exit codes, and how it talks to the person at the terminal."""

import sys

from cyclopts import App

from biodance.version import __version__

DONE, NEEDS_A_PERSON, NOT_DONE, STOPPED = 0, 1, 2, 130

app = App(
    name="biodance",
    version=__version__,
    help="Segment inertial parameters of a person, measured from markers and force plates. For research use, not a "
    "diagnosis.",
    suppress_keyboard_interrupt=False,
)


def say(sentence: str) -> None:
    """Write one line to stderr."""
    sys.stderr.write(sentence.rstrip() + "\n")


def print_json(document: object) -> None:
    """Write one JSON document to stdout."""
    from biodance.report.documents.session import to_text

    sys.stdout.write(to_text(document))
