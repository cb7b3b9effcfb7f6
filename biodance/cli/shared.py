"""Shared by all commands: application, exit codes, options, output, and on stderr how long it will take."""

import re
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Group, Parameter, Token

from biodance.errors import without_codes
from biodance.version import __version__

if TYPE_CHECKING:
    from rich.console import Console

    from biodance.records import Session

DONE, NEEDS_A_PERSON, NOT_DONE, STOPPED = 0, 1, 2, 130

app = App(
    name="biodance",
    version=__version__,
    help="Estimate the segment inertial parameters of a person from motion capture and force plates. For research use "
    "only, not a medical device.",
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative=""),
)
EVERYDAY = Group("A session", sort_key=1)
LABORATORY = Group("A laboratory", sort_key=2)
DANCES = Group("Dances: movements that tell most", sort_key=3)
ADVANCED = Group("Advanced: single stages, simulation, settings", sort_key=4)
"""Groups of commands in the help."""
_ROBOTS = Group("Robots", sort_key=8)
_RARE = Group("Advanced", sort_key=9)
"""Groups of options, after those of every day."""


def say(sentence: str) -> None:
    """Write one line to stderr, also where a name holds a line's end or codes that a terminal would obey."""
    sys.stderr.write(without_codes(sentence.rstrip().replace("\n", "\\n")) + "\n")


def print_json(document: object) -> None:
    """Write one JSON document to stdout."""
    from biodance.report.tables.schema import to_text

    sys.stdout.write(to_text(document))


def show_place(path: Path) -> None:
    """Write where something was written to stdout, in a line."""
    sys.stdout.write(without_codes(str(path)) + "\n")


def show(document: Any, printed: "Callable[[Any, Console], None]", *, json: bool, path: Path | None = None) -> None:
    """Write results to stdout: one JSON document, or the output of ``printed`` and the ``path`` of the report."""
    from biodance.report.terminal import SafeConsole

    if json:
        return print_json(document)
    printed(document, SafeConsole())
    return None if path is None else show_place(path)


JsonOption = Annotated[bool, Parameter(help="Print the results as one JSON document on stdout.")]
ForceOption = Annotated[
    bool,
    Parameter(help="Write into a non-empty folder; overwrite existing files."),
]
Tables = Annotated[Path | None, Parameter(help="Also write the results as tables (CSV and Parquet) to this folder.")]
OutOption = Annotated[Path, Parameter(help="Output folder; created if it does not exist.")]

ReferenceOption = Annotated[
    Path | None,
    Parameter(
        help="Folder of an earlier session of the same person without added load; changes are reported relative to it."
    ),
]
BodyOption = Annotated[
    Path | None,
    Parameter(
        help="body.json from an earlier session of the same person, used as the prior in place of the segment table."
    ),
]
LabOption = Annotated[
    Path | None, Parameter(help="lab.toml of the laboratory; its accepted corrections are applied first.")
]
Set = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        help="Override a setting, e.g. --set filter.cutoff=6; repeatable. `biodance settings` lists all of them.",
    ),
]
MarkersFile = Annotated[
    str | None,
    Parameter(help="Marker set: the name of a built-in set, or a TOML file (see CONTRIBUTING.md)."),
]
SubjectOption = Annotated[
    str | None,
    Parameter(help="Subject to read if a C3D file contains several; required for such files."),
]


@Parameter(name="*", group=_RARE)
@dataclass(frozen=True, kw_only=True)
class Reading:
    """Options for reading a session: subject, marker set, settings, and what earlier sessions left."""

    reference: ReferenceOption = None
    body: BodyOption = None
    lab: LabOption = None
    subject: SubjectOption = None
    markers: MarkersFile = None
    chosen: Set = ()

    def read(self, folder: Path, tell: Callable[[str], None]) -> "Session":
        """Return the session in ``folder``."""
        from biodance.lab.session.read import read_session
        from biodance.settings import assignments

        return read_session(
            folder, subject_name=self.subject, markers=self.markers, settings=assignments(self.chosen), tell=tell
        )

    def given(self) -> tuple[str, ...]:
        """Return the names of the options that were given."""
        given = [one.name for one in fields(self) if getattr(self, one.name) != one.default]
        return tuple("--set" if name == "chosen" else f"--{name}" for name in given)


USUAL_READING = Reading()


def whole(_: object, tokens: Sequence[Token]) -> int:
    """Return a number of things: the parser itself would round 1.5."""
    text = tokens[0].value
    if not text.removeprefix("-").isdecimal():
        raise ValueError(f"{text!r} is no whole number.")
    return int(text)


def not_negative(_: object, value: float | None) -> None:
    """Refuse a number below zero."""
    if value is not None and value < 0:
        raise ValueError("Legal are 0 and more.")


def _lived(_: object, age: float) -> None:
    if age < 0 or age > 120:
        raise ValueError("Legal are 0 to 120 years.")


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PersonFacts:
    """Who moves, where no recording says it."""

    sex: Annotated[Literal["F", "M"] | None, Parameter(help="Sex of the person.")] = None
    height: Annotated[float | None, Parameter(help="Body height, m.")] = None
    mass: Annotated[float | None, Parameter(help="Body mass, kg.")] = None
    age: Annotated[
        float, Parameter(validator=_lived, show_default=False, help="Age, 0 to 120 years; strength depends on it.")
    ] = float("nan")


NOBODY = PersonFacts()


@Parameter(name="*", group=_ROBOTS)
@dataclass(frozen=True, kw_only=True)
class RobotFile:
    """The robot instead of a person: its file, its feet, and what to do about a link that is no possible body."""

    urdf: Annotated[Path | None, Parameter(help="URDF file of a robot, to be used instead of a person.")] = None
    feet: Annotated[str | None, Parameter(help="Names of the robot's foot links, given as RIGHT,LEFT.")] = None
    mend: Annotated[
        bool,
        Parameter(
            help="Replace links with physically impossible inertia by a solid box of the same mass, and report them."
        ),
    ] = False

    @property
    def given(self) -> bool:
        """Whether any of it was asked for."""
        return self != NO_ROBOT

    def named(self) -> tuple[Path, str]:
        """Return file and feet; BiodanceError if one is missing."""
        from biodance.errors import BiodanceError

        if self.urdf is None or self.feet is None:
            raise BiodanceError("A robot is told by both --urdf FILE and --feet RIGHT,LEFT; one of them is missing.")
        return self.urdf, self.feet


NO_ROBOT = RobotFile()


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Results:
    """Where results go: a folder, beside it tables where they are wanted; what is printed and opened."""

    out: OutOption
    tables: Tables = None
    open_page: Annotated[bool, Parameter(name="--open", help="Open the report in a browser when done.")] = False
    json: JsonOption = False
    force: ForceOption = False

    def make_tables_folder(self, session: Path) -> Path | None:
        """Return the folder for tables, made; None where none are wanted."""
        from biodance.report.files import tables_folder

        return None if self.tables is None else tables_folder(self.tables, session, force=self.force)

    def show_page(self, folder: Path) -> None:
        """Show the page of a results folder in the browser, where that is wanted; say where it lies without one."""
        import webbrowser

        page = folder / "report.html"
        with suppress(webbrowser.Error):
            if not self.open_page or webbrowser.open(page.resolve().as_uri()):
                return
        say(f"No browser was found here. Open {page} on a machine that has one.")


class TimeLeft:
    """Estimate of the time left in a stage from its progress messages ("3 of 11"); ``clock`` in s."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._stage, self._began, self._first = clock, ("", 0), 0.0, 0

    def said(self, text: str) -> str:
        """Return the words with the time left in this stage, where they count its items."""
        counted = re.search(r"(?P<done>\d+) of (?P<all>\d+)", text)
        if counted is None:
            return text
        done, total = int(counted["done"]), int(counted["all"])
        stage = (text.split(" ", 1)[0], total)
        if stage != self._stage or done < self._first:
            self._stage, self._began, self._first = stage, self._clock(), done
        if done <= self._first:
            return text
        each = (self._clock() - self._began) / (done - self._first)
        # the item that is told of has begun and is not done: it counts among those left
        return f"{text}, about {seconds_in_words(each * (total - done + 1))} left"


def seconds_in_words(seconds: float) -> str:
    """Return a duration in words: "8 s", "3 min", "2.5 h"."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    return f"{round(seconds / 60)} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Yield a function that shows on stderr what is being done."""
    left = TimeLeft()
    if not sys.stderr.isatty():
        yield _plain(left)
        return
    from rich.console import Console
    from rich.markup import escape

    with Console(stderr=True).status("") as status:
        yield lambda text: status.update(escape(without_codes(left.said(text))))


def _plain(left: TimeLeft, clock: Callable[[], float] = time.monotonic) -> Callable[[str], None]:
    last = clock()

    def tell(text: str) -> None:
        nonlocal last
        line = left.said(text)
        if clock() - last >= 5.0:  # s: a short run says nothing, a long log is short
            last = clock()
            sys.stderr.write(f"{without_codes(line)}\n")

    return tell
