"""How many pictures a second the page that leads draws and looks at, with a film of a rendered dancer as its camera and
without one, in headless Chromium without graphics.

    PYTHONPATH=.:benchmarks:tests python benchmarks/bench_frames.py FOLDER [SECONDS [WIDTH,HEIGHT]]

Frames by the clock hang on who else uses the machine; processor time a frame (all processes of the browser, Linux)
hardly does. The dancer is the first of `bench_follow.py`, 10 pictures a second for 20 s. FOLDER keeps film and page.
"""

import os
import sys
import time
from io import BytesIO
from pathlib import Path

import numpy as np
from bench_follow import known_dance, performed, pictures
from browser import Page
from PIL import Image

from biodance.body.human.human import human
from biodance.records import Subject
from biodance.report.feedback.write import write_feedback

PLAYED, RATE = 20.0, 10.0
"""s and Hz of the film, which the browser plays again and again."""
_COUNTED = "[performance.now() / 1000, Number(document.body.dataset.frames), Number(document.body.dataset.looks ?? 0)]"


def processor_time(process: int) -> float:
    """Return the processor time s of a process and of all that it has started and that still run."""
    total, left = 0.0, [process]
    while left:
        place = Path(f"/proc/{left.pop()}")
        try:
            told = (place / "stat").read_text().rsplit(")", 1)[1].split()
            total += (int(told[11]) + int(told[12])) / os.sysconf("SC_CLK_TCK")
            left += [int(one) for task in (place / "task").iterdir() for one in (task / "children").read_text().split()]
        except OSError:  # it has ended meanwhile
            continue
    return total


def row(page: Path, film: Path | None, seconds: float, size: str) -> str:
    """Return the row of a table: how many frames and looks a second, and processor time a frame."""
    with Page(page.as_uri(), film=film, size=size) as browser:
        if film:
            browser.run("document.getElementById('film').click()")
            browser.until("Number(document.body.dataset.looks ?? 0) > 2", 120.0)
        browser.run("document.getElementById('play').click()")
        browser.until("Number(document.body.dataset.frames) > 3")
        before, used = np.array(browser.run(_COUNTED)), processor_time(browser.process)
        time.sleep(seconds)
        (clock, frames, looks), used = browser.run(_COUNTED) - before, processor_time(browser.process) - used
    kind = "a film" if film else "none"
    return f"| {kind} | {frames / clock:.1f} | {looks / clock:.1f} | {1000 * used / frames:.0f} |"


def main(folder: str, seconds: str = "20", size: str = "1280,900") -> None:
    """Print the table of a window of ``size`` pixels."""
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    page, film, dance = place / "page.html", place / "film.mjpeg", known_dance(human(Subject(65.0, 1.75, "F", 33.0)))
    if not write_feedback(dance, page, force=True):
        sys.exit("The page does not follow without the bundle: make bundle.")
    if not film.exists():
        when, shots = np.arange(0.0, PLAYED, 1 / RATE), BytesIO()
        for picture in pictures(dance.body, performed(dance, 0), when):
            Image.fromarray(picture).save(shots, "JPEG", quality=90)
        film.write_bytes(shots.getvalue())
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    print("| camera | frames/s | looks of the model/s | processor time a frame (ms) |\n|" + "---|" * 4)
    for one in (film, None):
        print(row(page.resolve(), one, float(seconds), size), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
