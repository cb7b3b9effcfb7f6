"""A newcomer's first hour in the window: three faulty sessions of three laboratories, with clicks and pictures.

``BIODANCE_DATA=... python docs/figures/app_hour.py PICTURES`` copies three public sessions, spoils two of them, and
drives a Chromium through `biodance app` with a mouse, from the list to the gait page of each. It prints clicks and
seconds.
"""

import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from browser import Page

from biodance.lab.c3d.raw import read_raw
from biodance.lab.c3d.results import write_exchanged

DATA, PICTURES = Path(os.environ["BIODANCE_DATA"]), Path(sys.argv[1])
UP_TO_DATE = "document.querySelector('[data-key=run]')?.textContent === 'Results are up to date'"


def spoiled(archive: Path) -> None:
    """Write the sessions ``roles``, ``labels`` and ``feet``."""
    roles, labels, feet = (archive / name for name in ("roles", "labels", "feet"))
    shutil.copytree(DATA / "c3d_parser_QCMAS", roles)
    (roles / "session.toml").write_text(
        '[trials."QCMAS.dynamic"]\nrole = "static"\n[trials."QCMAS.static"]\nrole = "fit"\n', encoding="utf-8"
    )
    shutil.copytree(DATA / "biomechzoo" / "HC044A", labels)
    for path in sorted(labels.glob("*.c3d"))[1:]:
        frames = len(read_raw(path).points)
        exchanged = write_exchanged(path, archive / path.name, {("LKNE", "RKNE"): ((0, frames),)})
        exchanged.replace(path)
    shutil.copytree(DATA / "c3d_parser_FMC", feet)
    for path in archive.rglob("*"):
        path.chmod(0o755 if path.is_dir() else 0o644)


class Newcomer:
    """Who sits before the ``browser``; counts clicks."""

    def __init__(self, browser: Page) -> None:
        self.browser, self.clicks, self.pictures = browser, 0, 0

    def click(self, found: str) -> None:
        """Press the mouse on what a JavaScript expression finds, as soon as it is there."""
        self.browser.until(f"Boolean({found})", 300)
        x, y = self.browser.run(
            f"(one => {{ one.scrollIntoView({{block: 'center'}}); const box = one.getBoundingClientRect(); "
            f"return [box.x + box.width / 2, box.y + box.height / 2]; }})({found})"
        )
        for kind in ("mousePressed", "mouseReleased"):
            self.browser.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
        self.clicks += 1

    def press(self, text: str) -> None:
        """Click the button or link that begins with a text."""
        self.click(
            "[...document.querySelectorAll('main button:enabled, main a')]"
            f".find(one => one.textContent.startsWith({text!r}))"
        )

    def choose(self, field: str, value: str) -> None:
        """Choose of a menu: one click opens it, one takes it."""
        self.browser.until(f"Boolean(document.querySelector({field!r}))")
        self.browser.run(
            f"(one => {{ one.value = {value!r}; one.dispatchEvent(new Event('change')); }})"
            f"(document.querySelector({field!r}))"
        )
        self.clicks += 2

    def ran(self) -> None:
        """Wait until the results are of what is seen."""
        self.browser.until(UP_TO_DATE, 600)

    def picture(self, name: str) -> None:
        """Keep what is seen, as soon as nothing moves any more."""
        time.sleep(1.5)
        self.pictures += 1
        self.browser.picture(PICTURES / f"app_{name}_{self.pictures}.png")

    def tab(self, name: str, shown: str) -> None:
        """Go to a tab, until what ``shown`` selects is on it."""
        self.click(f"document.querySelector('#tab-{name}')")
        self.browser.until(f"Boolean(document.querySelector({shown!r}))")

    def gait(self) -> None:
        """Go to the gait page."""
        self.tab("gait", "iframe[src*='part=gait']")


def roles(one: Newcomer) -> None:
    """Give static and walk their roles back, run."""
    one.picture("roles")
    one.choose('[data-key="role QCMAS.static"]', "static")
    one.browser.until("document.querySelector('[data-key=undo]').disabled === false")
    one.choose('[data-key="role QCMAS.dynamic"]', "fit")
    one.press("Run")
    one.ran()
    one.gait()
    one.picture("roles")


def labels(one: Newcomer) -> None:
    """Run, exchange the labels that are named, run."""
    one.press("Run")
    one.ran()
    one.tab("quality", "[data-key^=correct]")
    one.picture("labels")
    one.click("document.querySelector('[data-key=\"correct LKNE/RKNE\"]')")
    one.browser.until("Boolean(document.querySelector('[data-key=write]'))", 300)
    one.browser.run("document.querySelector('.compared').scrollIntoView({block: 'start'})")
    one.picture("labels")
    one.click("document.querySelector('[data-key=write]')")
    one.browser.until("document.querySelector('#run').textContent.includes('Stop')", 60)
    one.ran()
    one.gait()
    one.picture("labels")


def feet(one: Newcomer) -> None:
    """Run, and see what does not count."""
    one.press("Run")
    one.ran()
    one.tab("quality", ".verdict")
    one.picture("feet")
    one.tab("steps", "#panel svg")
    one.picture("feet")
    one.gait()
    one.picture("feet")


def main() -> None:
    """Go through all three."""
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="hour-") as place:
        archive = Path(place) / "Laboratory"
        spoiled(archive)
        command = [sys.executable, "-m", "biodance", "app", str(archive), "--no-browser"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as window:
            assert window.stdout is not None
            assert select.select([window.stdout], [], [], 120.0)[0]
            with Page(window.stdout.readline().strip(), size="1100,760") as browser:
                for session in (roles, labels, feet):
                    began, name = time.monotonic(), session.__name__
                    browser.run("location.hash = '#/'")
                    one = Newcomer(browser)
                    one.click(f"[...document.querySelectorAll('tbody a')].find(one => one.textContent === {name!r})")
                    browser.until(f"document.querySelector('h1').textContent === {name!r}")
                    session(one)
                    sys.stdout.write(f"{name}: {one.clicks} clicks, {time.monotonic() - began:.0f} s\n")
            window.terminate()


if __name__ == "__main__":
    main()
