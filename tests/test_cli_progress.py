"""What a command says of its progress: time left on a terminal, few plain lines elsewhere; and the page it opens."""

from pathlib import Path

import pytest

from biodance.cli.shared import Results, TimeLeft, _plain, progress, seconds_in_words


class Clock:
    """A clock that is set by hand."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def test_the_time_left_is_what_the_stage_took_so_far_times_what_is_left():
    clock = Clock()
    left = TimeLeft(clock)
    assert left.said("scaling the body") == "scaling the body"
    assert left.said("tracking walk_1, 1 of 5") == "tracking walk_1, 1 of 5"
    clock.now = 4.0
    assert left.said("tracking walk_2, 2 of 5") == "tracking walk_2, 2 of 5, about 16 s left"
    clock.now = 10.0
    assert left.said("tracking walk_3, 3 of 5") == "tracking walk_3, 3 of 5, about 15 s left"
    assert left.said("describing walk_1, 1 of 5") == "describing walk_1, 1 of 5"


@pytest.mark.parametrize(("seconds", "words"), [(0.2, "1 s"), (89, "89 s"), (100, "2 min"), (9000, "2.5 h")])
def test_durations_in_words(seconds, words):
    assert seconds_in_words(seconds) == words


def test_without_a_terminal_a_line_comes_every_few_seconds_and_a_short_run_is_silent(capsys, monkeypatch):
    clock = Clock()
    monkeypatch.setattr("time.monotonic", clock)
    tell = _plain(TimeLeft(clock), clock)
    for k in range(1, 13):
        clock.now = float(k)
        tell(f"tracking walk_{k}, {k} of 12")
    assert capsys.readouterr().err.splitlines() == [
        "tracking walk_5, 5 of 12, about 8 s left",
        "tracking walk_10, 10 of 12, about 3 s left",
    ]
    with progress() as short:
        short("reading")
    assert capsys.readouterr().err == ""


def test_the_page_is_opened_only_where_it_is_wanted_and_its_place_is_said_without_a_browser(capsys, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda address: bool(opened.append(address)))
    Results(out=Path("out")).show_page(Path("out"))
    assert opened == []
    Results(out=Path("out"), open_page=True).show_page(Path("out"))
    assert opened[0].startswith("file://")
    assert "No browser was found here. Open out/report.html" in capsys.readouterr().err
