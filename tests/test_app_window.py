"""The window in a real browser, as somebody uses it: from the folder to a download, on a desk and on a phone."""

import select
import subprocess
import sys
import time
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from accessible import ASKED, complaints
from browser import Page
from hidden_faults import hidden

from biodance.lab.c3d.raw import read_raw
from biodance.lab.c3d.results import write_exchanged

pytestmark = ASKED
TABS = ("trials", "markers", "steps", "quality", "gait", "body", "files")


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("window") / "archive"
    hidden(folder / "S01", trials=("static", "squat_1"))
    squats = hidden(folder / "S03", trials=("static", "squat_1")) / "squat_1.c3d"
    exchanged = write_exchanged(
        squats, folder / "squat_1.c3d", {("LASI", "RASI"): ((0, len(read_raw(squats).points)),)}
    )
    exchanged.replace(squats)
    (folder / "S02").mkdir()
    (folder / "S02" / "static.c3d").write_bytes(b"no recording")
    return folder


@pytest.fixture(scope="module")
def address(archive: Path) -> Iterator[str]:
    command = [sys.executable, "-m", "biodance", "app", str(archive), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert select.select([process.stdout], [], [], 60.0)[0]
        yield process.stdout.readline().strip()
        process.terminate()
        process.wait(timeout=30)


@pytest.fixture(scope="module")
def browser(address: str) -> Iterator[Page]:
    with Page(address) as page:
        page.until("document.querySelectorAll('tbody tr').length === 3")
        yield page


def go(browser: Page, place: str, ready: str) -> None:
    browser.run(f"location.hash = '{place}'")
    browser.until(f"Boolean({ready})")


def press(browser: Page, text: str) -> None:
    browser.run(
        f"[...document.querySelectorAll('button, a')].find(one => one.textContent.startsWith({text!r})).click()"
    )


def choose(browser: Page, field: str, value: str) -> None:
    browser.run(
        f"(one => {{ one.focus(); one.value = {value!r}; one.dispatchEvent(new Event('change')); }})"
        f"(document.querySelector({field!r}))"
    )


def test_the_token_leaves_the_address(browser):
    assert "token" not in browser.run("location.href")


def test_a_role_is_changed_by_menu_and_undone(browser, archive):
    file = archive / "S01" / "session.toml"
    before = file.read_text(encoding="utf-8")
    go(browser, "#/S01/trials", "document.querySelector('[data-key=\"role squat_1\"]')")
    choose(browser, '[data-key="role squat_1"]', "fit")
    browser.until("document.querySelector('[data-key=undo]').disabled === false")
    assert tomllib.loads(file.read_text(encoding="utf-8"))["trials"]["squat_1"]["role"] == "fit"
    browser.run("document.querySelector('[data-key=undo]').click()")
    browser.until("document.querySelector('[data-key=redo]').disabled === false")
    assert file.read_text(encoding="utf-8") == before


def test_a_value_that_is_not_legal_is_said_and_the_old_one_shown(browser, archive):
    go(browser, "#/S01/trials", "document.querySelector('[data-key=mass_kg]')")
    before = browser.run("document.querySelector('[data-key=mass_kg]').value")
    choose(browser, "[data-key=mass_kg]", "6400")
    browser.until("!document.querySelector('#said').hidden")
    assert "mass_kg" in browser.run("document.querySelector('#said').textContent")
    browser.until(f"document.querySelector('[data-key=mass_kg]').value === {before!r}")


def test_another_editor_is_noticed(browser, archive):
    go(browser, "#/S01/trials", "document.querySelector('[data-key=age]')")
    file = archive / "S01" / "session.toml"
    before = file.read_text(encoding="utf-8")
    file.write_text(before.replace("[subject]", "[subject]\nname = 'somebody'"), encoding="utf-8")
    browser.until("document.querySelector('#said').textContent.includes('changed elsewhere')", 15)
    browser.until("document.querySelector('legend').textContent.includes('somebody')")
    file.write_text(before, encoding="utf-8")
    assert browser.until("!document.querySelector('legend').textContent.includes('somebody')", 15)


def test_two_markers_are_exchanged_by_a_click_in_the_picture(browser, archive):
    go(browser, "#/S01/markers", "document.querySelector('canvas')")
    time.sleep(0.5)  # one picture is drawn
    box = browser.run(
        "(b => [b.left, b.top, b.width, b.height])(document.querySelector('canvas').getBoundingClientRect())"
    )
    chosen = ""
    for share in range(15, 90, 2):  # down the middle of the picture, until a marker is met
        x, y = box[0] + box[2] / 2, box[1] + box[3] * share / 100
        for kind in ("mousePressed", "mouseReleased"):
            browser.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)
        chosen = browser.run("document.querySelector('tr.chosen th')?.textContent || ''")
        if chosen:
            break
    assert chosen
    browser.run("document.querySelector('[data-key=exchange]').click()")
    browser.until("[...document.querySelectorAll('li')].some(one => one.textContent.includes('exchanged'))")
    (pair,) = tomllib.loads((archive / "S01" / "session.toml").read_text(encoding="utf-8"))["trials"]["squat_1"][
        "exchange"
    ]
    assert pair[0] == chosen
    press(browser, "Take back")
    browser.until("![...document.querySelectorAll('li')].some(one => one.textContent.includes('exchanged'))")


def test_from_the_folder_to_the_download(browser, archive, tmp_path):
    go(browser, "#/", "document.querySelector('tbody a')")
    press(browser, "S01")
    browser.until("Boolean(document.querySelector('[data-key=run]'))")
    browser.run("document.querySelector('[data-key=run]').click()")
    browser.until("document.querySelector('#run').textContent.includes('Stop')", 20)
    browser.until("document.querySelector('[data-key=run]')?.textContent === 'Results are up to date'", 240)
    go(browser, "#/S01/files", "[...document.querySelectorAll('a')].some(one => one.textContent === 'Excel')")
    browser.send("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    for text, name in (("Excel", "S01.xlsx"), ("CSV", "S01_tables.zip"), ("HTML", "report.html")):
        press(browser, text)
        end = time.monotonic() + 60
        while not (tmp_path / name).exists():
            assert time.monotonic() < end, name
            time.sleep(0.1)
    assert "xl/workbook.xml" in zipfile.ZipFile(tmp_path / "S01.xlsx").namelist()
    assert "mean_curves.csv" in zipfile.ZipFile(tmp_path / "S01_tables.zip").namelist()


def test_a_squat_is_switched_off_and_the_next_run_leaves_it_out(browser, archive):
    rows = "document.querySelectorAll('tbody tr').length"
    go(browser, "#/S01/steps", f"{rows} > 1")
    before = browser.run(rows)
    browser.run("document.querySelector('[data-key=\"cycle 0\"]').click()")
    browser.until("Boolean(document.querySelector('tr.off'))")
    browser.until("document.querySelector('[data-key=run]').textContent === 'Run'")
    browser.run("document.querySelector('[data-key=run]').click()")
    browser.until("document.querySelector('[data-key=run]').textContent === 'Results are up to date'", 240)
    assert browser.until(f"{rows} === {before - 1}")


def events_of(archive: Path) -> list[dict]:
    return tomllib.loads((archive / "S01" / "session.toml").read_text(encoding="utf-8"))["trials"]["squat_1"].get(
        "events", []
    )


def add(browser: Page, what: str, time: float) -> None:
    browser.run(
        f"document.querySelector('[aria-label=\"Time of the event, in s\"]').value = '{time}'; "
        f"document.querySelector('[data-key=\"add {what}\"]').click()"
    )


def take(browser: Page, what: str) -> None:
    browser.until(f"(one => one ? (one.focus(), true) : false)(document.querySelector('[data-key=\"event {what}\"]'))")


def key(browser: Page, name: str) -> None:
    for kind in ("keyDown", "keyUp"):
        browser.send("Input.dispatchKeyEvent", type=kind, key=name, code=name)


def test_steps_are_added_moved_and_taken_out_by_keyboard_and_pointer(browser, archive):
    go(browser, "#/S01/steps", "document.querySelector('[data-key=\"add left strike\"]')")
    events = "document.querySelectorAll('g.event').length"
    add(browser, "left strike", 1.0)
    browser.until(f"{events} === 1")
    add(browser, "left strike", 2.0)  # without an off between them: said, kept in the window, not written
    browser.until("document.querySelector('#said').textContent.includes('no off between')")
    browser.until(f"{events} === 2")
    assert [one["time"] for one in events_of(archive)] == [1.0]
    add(browser, "left off", 1.6)
    browser.until("document.querySelector('#said').hidden && !document.querySelector('[data-key=discard]')")
    assert [(one["kind"], one["time"]) for one in events_of(archive)] == [
        ("strike", 1.0),
        ("off", 1.6),
        ("strike", 2.0),
    ]

    time.sleep(1.0)  # the answer is drawn
    take(browser, "left off 0")
    key(browser, "ArrowRight")
    key(browser, "ArrowRight")
    browser.until("document.querySelector('[data-key=\"event left off 0\"]').ariaLabel.includes('1.620')")
    end = time.monotonic() + 10
    while [one["time"] for one in events_of(archive)] != [1.0, 1.62, 2.0]:
        assert time.monotonic() < end
        time.sleep(0.1)

    time.sleep(1.0)  # the answer is drawn
    box = "(b => [b.left + b.width / 2, b.top + b.height / 2])(document.querySelector("
    browser.run("document.querySelector('g.event').scrollIntoView({block: 'center'})")
    x, y = browser.run(f"{box}'[data-key=\"event left strike 1\"]').getBoundingClientRect())")
    for kind, way in (("mousePressed", 0), ("mouseMoved", 20), ("mouseMoved", 40), ("mouseReleased", 40)):
        browser.send("Input.dispatchMouseEvent", type=kind, x=x + way, y=y, button="left", buttons=1, clickCount=1)
    browser.until("document.querySelector('[data-key=undo]').disabled === false")
    end = time.monotonic() + 10
    while not events_of(archive)[-1]["time"] > 2.05:
        assert time.monotonic() < end
        time.sleep(0.1)

    time.sleep(1.0)
    take(browser, "left strike 1")
    key(browser, "Delete")
    browser.until(f"{events} === 2")
    press(browser, "Use those found again")
    browser.until(f"{events} === 0")
    assert events_of(archive) == []


@pytest.mark.parametrize("tab", TABS)
def test_nobody_is_shut_out_of_a_tab(browser, tab):
    go(browser, f"#/S01/{tab}", f"document.querySelector('#tab-{tab}')?.ariaSelected === 'true'")
    browser.until("document.querySelector('#panel').children.length > 0")
    time.sleep(0.5)
    browser.run("document.querySelectorAll('details').forEach(one => one.open = true)")
    assert complaints(browser) == []
    browser.send("Emulation.clearDeviceMetricsOverride")


def test_a_person_s_limits_are_filled_in_and_saved(browser, tmp_path):
    go(browser, "#limits", "document.querySelector('[data-key=template]')")
    choose(browser, "[data-key=template]", "stroke")
    browser.until("document.querySelector('[data-key=reason]').value === 'stroke, left side'")
    choose(browser, '[data-key="deg left_arm_forward"]', "65")
    choose(browser, '[data-key="strength left_arm"]', "grade 4")
    browser.run("document.querySelector('[data-key=\"hold_frame right\"]').click()")
    browser.until("document.querySelector('[data-key=file]').textContent.includes('\\nhold_frame = [\"right\"]')")
    assert complaints(browser) == []
    browser.send("Emulation.clearDeviceMetricsOverride")
    choose(browser, "[data-key=seat_height_m]", "6")
    browser.until("document.querySelector('#said').textContent.includes('between 0.3 and 1.2')")
    assert not browser.run("document.querySelector('main a.button')")
    choose(browser, "[data-key=seat_height_m]", "0.6")
    browser.until("Boolean(document.querySelector('main a.button'))")
    browser.send("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    press(browser, "Save person.toml")
    end = time.monotonic() + 60
    while not (tmp_path / "person.toml").exists():
        assert time.monotonic() < end
        time.sleep(0.1)
    saved = tomllib.loads((tmp_path / "person.toml").read_text(encoding="utf-8"))
    assert saved["at_most_deg"]["left arm forward"] == 65
    assert saved["strength"] == {"left_arm": "grade 4", "left_leg": 0.7}
    assert (saved["hold_frame"], saved["seat_height_m"]) == (["right"], 0.6)


def test_another_folder_is_chosen_in_the_window(browser, archive):
    go(browser, "#/", "document.querySelectorAll('tbody tr').length === 3")
    chooser = "document.querySelector('[data-key=folder]')"
    found = "Boolean(document.querySelector('[aria-label=\"Look into S01\"]'))"
    browser.until(f"{found} || ({chooser}.parentElement.open || {chooser}.click(), false)")
    assert complaints(browser) == []
    browser.send("Emulation.clearDeviceMetricsOverride")
    browser.run("document.querySelector('[aria-label=\"Look into S01\"]').click()")
    browser.until("document.querySelector('details p').textContent.endsWith('S01')")
    browser.run("document.querySelector('[data-key=open]').click()")
    browser.until("document.querySelectorAll('tbody tr').length === 1")
    browser.run(
        f"fetch('/api/open', {{method: 'POST', headers: {{'Content-Type': 'application/json'}}, "
        f"body: JSON.stringify({{folder: {str(archive)!r}}})}})"
    )
    go(browser, "#/S01/trials", "document.querySelector('[data-key=mass_kg]')")
    go(browser, "#/", "document.querySelectorAll('tbody tr').length === 3")


def test_a_dropped_folder_is_copied_run_and_its_page_shown(browser, archive, tmp_path):
    stick = hidden(tmp_path / "S07", trials=("static", "squat_1"))
    go(browser, "#/", "document.querySelectorAll('tbody tr').length === 3")
    data = {"items": [], "files": [str(stick)], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        browser.send("Input.dispatchDragEvent", type=kind, x=500, y=500, data=data)
    browser.until("location.hash === '#/S07/gait'", 30)
    browser.until("Boolean(document.querySelector('iframe'))", 240)
    # what is dropped over the page of results comes to the window, too: it passes the window's own part on its way
    (tmp_path / "nothing").mkdir()
    (tmp_path / "nothing" / "notes.txt").write_text("no recording")
    data["files"] = [str(tmp_path / "nothing")]
    for kind, y in (("dragEnter", 5), ("dragOver", 5), ("dragOver", 500), ("drop", 500)):
        browser.send("Input.dispatchDragEvent", type=kind, x=500, y=y, data=data)
    browser.until("document.querySelector('#said').textContent.includes('nothing')", 30)
    copy = archive.with_name(f"{archive.name}-results") / "dropped" / "S07"
    assert (copy / "squat_1.c3d").read_bytes() == (stick / "squat_1.c3d").read_bytes()
    assert complaints(browser, "main > :not(#panel)") == []
    browser.send("Emulation.clearDeviceMetricsOverride")
    browser.run(
        f"fetch('/api/open', {{method: 'POST', headers: {{'Content-Type': 'application/json'}}, "
        f"body: JSON.stringify({{folder: {str(archive)!r}}})}})"
    )
    go(browser, "#/", "document.querySelectorAll('tbody tr').length === 3")


def test_nobody_is_shut_out_of_the_list_or_a_session_that_cannot_be_read(browser):
    go(browser, "#/", "document.querySelectorAll('tbody tr').length === 3")
    assert complaints(browser) == []
    go(browser, "#/S02/trials", "document.querySelector('.verdict.fail')")
    assert "static.c3d" in browser.run("document.querySelector('.verdict.fail').textContent")
    assert complaints(browser) == []
    browser.send("Emulation.clearDeviceMetricsOverride")


def test_tabs_are_reached_with_the_keyboard(browser):
    go(browser, "#/S01/quality", "document.querySelector('#tab-quality')?.ariaSelected === 'true'")
    browser.run("document.querySelector('#tab-quality').focus()")
    browser.run(
        "document.activeElement.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', bubbles: true}))"
    )
    assert browser.until("document.activeElement.id === 'tab-gait' && document.activeElement.ariaSelected === 'true'")


def test_two_labels_are_exchanged_from_the_finding_after_before_and_after_are_seen(browser, archive):
    go(browser, "#/S03/quality", "document.querySelector('h1').textContent === 'S03'")
    browser.run("document.querySelector('[data-key=run]').click()")
    correct = "document.querySelector('[data-key=\"correct LASI/RASI\"]')"
    browser.until(f"Boolean({correct})", 240)
    assert browser.run(f"{correct}.textContent") == "Exchange LASI and RASI in squat_1 …"
    browser.run(f"{correct}.click()")
    browser.until("Boolean(document.querySelector('[data-key=write]'))", 120)
    assert not (archive / "S03" / "session.toml").read_text(encoding="utf-8").count("exchange")
    rows = (
        "[...document.querySelectorAll('.compared tbody tr')].map(one => [...one.cells].map(cell => cell.textContent))"
    )
    far = {when: float(cells[-1]) for trial, when, *cells in browser.run(rows) if trial == "squat_1"}
    assert far["after"] < 0.5 * far["before"]
    assert complaints(browser) == []
    browser.send("Emulation.clearDeviceMetricsOverride")
    browser.run("document.querySelector('[data-key=write]').click()")
    browser.until("document.querySelector('#run').textContent.includes('Stop')", 60)
    browser.until("document.querySelector('[data-key=run]')?.textContent === 'Results are up to date'", 240)
    said = tomllib.loads((archive / "S03" / "session.toml").read_text(encoding="utf-8"))
    assert said["trials"]["squat_1"]["exchange"] == [["LASI", "RASI"]]
    assert not browser.run(f"Boolean({correct})")


def test_two_quick_changes_are_both_written(browser, archive):
    go(browser, "#/S03/trials", "document.querySelector('[data-key=age]')")
    browser.run(
        "for (const [key, value] of [['age', '41'], ['height_m', '1.71']]) { const one = document.querySelector("
        "`[data-key=${key}]`); one.value = value; one.dispatchEvent(new Event('change')); }"
    )
    end = time.monotonic() + 30
    subject: dict = {}
    while (subject.get("age"), subject.get("height_m")) != (41, 1.71):
        assert time.monotonic() < end, subject
        time.sleep(0.1)
        subject = tomllib.loads((archive / "S03" / "session.toml").read_text(encoding="utf-8"))["subject"]
    assert browser.run("document.querySelector('#said').hidden")


def test_all_guesses_that_are_orange_are_accepted_at_once(browser, archive):
    file = archive / "S03" / "session.toml"
    before = file.read_text(encoding="utf-8")
    file.write_text("", encoding="utf-8")
    go(browser, "#/", "document.querySelectorAll('tbody tr').length === 3")
    go(browser, "#/S03/trials", "document.querySelector('[data-key=accept]')")
    orange = "document.querySelectorAll('#panel .guess').length"
    browser.until(f"{orange} > 0", 60)
    count = browser.run(orange)
    assert browser.run("document.querySelector('[data-key=accept]').textContent").startswith(f"Accept the {count} ")
    browser.run("document.querySelector('[data-key=accept]').click()")
    browser.until(f"{orange} === 0", 60)
    file.write_text(before, encoding="utf-8")


def test_nothing_is_asked_of_the_network_and_nothing_fails(browser, address):
    assert {one.split("/")[2] for one in browser.asked() if "://" in one} == {address.split("/")[2]}
    said = [one for one in browser.said() if "WebGL" not in one and "GL Driver" not in one]
    assert [one for one in said if "400" not in one] == []  # the value that was not legal is answered with 400
