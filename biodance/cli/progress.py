"""What is being done and how long it will take, on stderr: one updated line on a terminal, else a plain line every few
seconds.
"""

import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from biodance.errors import without_codes

_COUNTED, _EVERY = re.compile(r"(?P<done>\d+) of (?P<all>\d+)"), 5.0
"""How a message counts; s between two lines where stderr is no terminal: a short run says nothing, a long log is short.
"""


class TimeLeft:
    """Estimate of the time left in a stage from its progress messages ("3 of 11"); ``clock`` in s."""

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
        yield lambda text: status.update(escape(without_codes(left.said(text))))


def _plain(left: TimeLeft, clock: Callable[[], float] = time.monotonic) -> Callable[[str], None]:
    last = clock()

    def tell(text: str) -> None:
        nonlocal last
        line = left.said(text)
        if clock() - last >= _EVERY:
            last = clock()
            sys.stderr.write(f"{without_codes(line)}\n")

    return tell
