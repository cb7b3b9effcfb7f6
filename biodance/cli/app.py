"""What all commands share: the application, its exit codes, how it talks to the person at the terminal, and how it says
what it is doing: one changing line with the time left on a terminal, a plain line every few seconds elsewhere.
"""

import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

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
    """Write one line to stderr, also where a name holds a line's end."""
    sys.stderr.write(sentence.rstrip().replace("\n", "\\n") + "\n")


def print_json(document: object) -> None:
    """Write one JSON document to stdout."""
    from biodance.report.documents.session import to_text

    sys.stdout.write(to_text(document))


_COUNTED = re.compile(r"(?P<done>\d+) of (?P<all>\d+)")
_EVERY = 5.0
"""s between two lines where stderr is no terminal: a short run says nothing, a log of a long one stays short."""


class TimeLeft:
    """What a stage still takes, from the items that it has done: told words with "3 of 11" in them.

    ``clock`` returns s.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._stage = ("", 0)
        self._began = 0.0
        self._first = 0

    def said(self, text: str) -> str:
        """Return the words with the time left in this stage, where they count its items."""
        counted = _COUNTED.search(text)
        if counted is None:
            return text
        done, total = int(counted["done"]), int(counted["all"])
        stage = (text.split(" ", 1)[0], total)
        if stage != self._stage or done < self._first:
            self._stage, self._began, self._first = stage, self._clock(), done
        if done <= self._first:
            return text
        each = (self._clock() - self._began) / (done - self._first)
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
        yield lambda text: status.update(escape(left.said(text)))


def _plain(left: TimeLeft, clock: Callable[[], float] = time.monotonic) -> Callable[[str], None]:
    last = clock()

    def tell(text: str) -> None:
        nonlocal last
        line = left.said(text)
        if clock() - last >= _EVERY:
            last = clock()
            sys.stderr.write(f"{line}\n")

    return tell
