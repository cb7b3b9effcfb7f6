"""The page that leads: what is in it, that it needs nothing from outside, and what it shows in a browser."""

import hashlib
import json
import re
from base64 import b64decode
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import BROWSER, Page
from direct_information import whiten
from PIL import Image
from scipy.spatial.transform import Rotation
from small_dances import small_dance

from biodance.body.body import Body
from biodance.cli import run
from biodance.dance.dance import Dance
from biodance.dance.expectation import MovementInformation, expect, movement_information
from biodance.dance.visit_log import read_visit_logs
from biodance.errors import BiodanceError, FileRefused
from biodance.motion.dynamics import regressor
from biodance.motion.kinematics import poses
from biodance.records import Array, Motion
from biodance.report.pages import feedback
from biodance.report.pages.feedback import follow_scene, scene_of, write_feedback
from biodance.report.tables.identification import VISIT_ROW, log_in_words
from biodance.spatial import wrench_shift
from biodance.uncertainty.bands import Bands, Noise


@pytest.fixture(scope="module")
def dance() -> Dance:
    return small_dance()


@pytest.fixture(scope="module")
def page(dance: Dance, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("feedback") / "dance.html"
    write_feedback(dance, path)
    return path


def test_the_page_has_the_body_where_the_dance_has_it(dance: Dance) -> None:
    scene = scene_of(dance)
    names = [one["name"] for one in scene["segments"]]
    assert set(names) == set(dance.body.segments)
    packed = np.frombuffer(b64decode(scene["poses"]), "<i2").reshape(scene["frames"], len(names), 7)
    motion = dance.motion(scene["rate_hz"])
    k, hand = 20, dance.body.segments.index("left_forearm_hand")
    point = poses(dance.body, motion.q[k]).points([hand], np.array([[0.0, -0.3, 0.0]]))[0, 0]
    x, y, z, w = packed[k, names.index("left_forearm_hand"), 3:] / 32767
    shown = packed[k, names.index("left_forearm_hand"), :3] / 1e4
    arm = np.array([0.0, -0.3, 0.0])
    turned = arm + 2 * np.cross([x, y, z], np.cross([x, y, z], arm) + w * arm)
    assert shown + turned == pytest.approx(point, abs=2e-4)
    assert {one["side"] for one in scene["segments"]} == {"left", "right", ""}


def test_cues_follow_each_other_as_the_dance_does(dance: Dance) -> None:
    cues = scene_of(dance)["cues"]
    assert [cue["number"] for cue in cues] == list(range(1, len(dance.stances) + 1))
    moves = [phase for phase in dance.phases if phase.kind == "move"]
    assert [cue["move_s"] for cue in cues[1:]] == [phase.start for phase in moves]
    assert [cue["hold_s"] for cue in cues[1:]] == [phase.end for phase in moves]
    assert all(cue["stance"] and cue["feet"] for cue in cues)
    assert all(cue["calls"] for cue in cues[1:])


def test_nothing_comes_from_outside(page: Path) -> None:
    text = page.read_text()
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', text)
    assert policy is not None
    assert "default-src 'none'" in policy.group(1)
    assert not re.search(r"https?:|ws:", policy.group(1))
    assert not re.search(r'(?:src|href)\s*=\s*"', text.split("<script>")[0])
    assert "Three.js Authors" in text
    assert "SPDX-License-Identifier: MIT" in text


def test_the_command_writes_one_file_and_overwrites_none(
    dance: Dance, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dance.save(tmp_path / "dance.npz")
    out = tmp_path / "page.html"
    assert run(["feedback", str(tmp_path), "--out", str(out)]) == 0
    assert out.stat().st_size < 12_000_000
    assert run(["feedback", str(tmp_path / "dance.npz"), "--out", str(out)]) == 2
    assert "is not overwritten" in capsys.readouterr().err
    assert run(["feedback", str(tmp_path), "--out", str(tmp_path / "page")]) == 2
    assert "a page is one file that ends in .html" in capsys.readouterr().err
    with pytest.raises(BiodanceError, match="there is no such folder"):
        write_feedback(dance, tmp_path / "nowhere" / "page.html")


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_a_browser_shows_the_cue_of_the_second(dance: Dance, page: Path) -> None:
    cue = scene_of(dance)["cues"][1]
    shown = {}
    with Page(page.as_uri()) as browser:
        for name, second in (("hold", cue["move_s"] - 0.4), ("move", cue["move_s"] + 0.1), ("end", dance.duration)):
            browser.open(f"{page.as_uri()}#t={second}")
            shown[name] = browser.run("document.documentElement.outerHTML")
    for name, dom in shown.items():
        assert f'data-phase="{name}"' in dom
    words = [_words(dom) for dom in (shown["hold"], shown["move"])]
    assert words[0] == words[1] == cue["calls"], "what comes is told before, and again when it is time"
    assert re.search(r'id="count"[^>]*>1<', shown["hold"])
    assert "Move now" in shown["move"]
    assert "Thank you" in shown["end"]


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_without_webgl_the_words_lead_and_the_page_says_why(dance: Dance, page: Path) -> None:
    cue = scene_of(dance)["cues"][1]
    with Page("about:blank#begin") as browser:
        without = "HTMLCanvasElement.prototype.getContext = () => null"
        browser.send("Page.addScriptToEvaluateOnNewDocument", source=without)
        browser.open(f"{page.as_uri()}#t={cue['move_s'] + 0.1}")
        shown = "(id) => document.getElementById(id).checkVisibility()"
        names = ["undrawn", "scene", "label-left", "label-right", "view", "now"]
        assert browser.run(f"{names}.map({shown})") == [True, False, False, False, False, True]
        assert "Move now" in browser.run("document.getElementById('now').innerText")
        assert "hardware acceleration" in browser.run("document.getElementById('undrawn').innerText")


def _words(dom: str) -> list[str]:
    items = re.search(r'<ol id="calls">(.*?)</ol>', dom, re.DOTALL)
    assert items is not None
    return [re.sub(r"<[^>]+>", "", one) for one in re.findall(r"<li>(.*?)</li>", items.group(1), re.DOTALL)]


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_the_corners_of_the_plate_tell_the_focal_length_of_the_camera(page: Path, yaw: float) -> None:
    with Page(page.as_uri()) as browser:
        for focal, tilt in ((1.3, 0.3), (2.4, 0.5)):
            turn = Rotation.from_euler("ZYX", [yaw, tilt, 0.0]).as_matrix()  # columns: away from the floor's axes
            right, up, back = np.array([-turn[:, 1], turn[:, 2], -turn[:, 0]])
            axes = [[focal * right[k], focal * up[k], -back[k]] for k in (0, 1)]
            scaled = [[float(value / 2.7) for value in axis] for axis in axes]
            assert browser.run(f"focal({scaled[0]}, {scaled[1]})") == pytest.approx(focal, rel=1e-6)
        assert browser.run("focal([0, 0.1, 0], [0.1, 0, 0])") == 1.9  # straight from above: nothing to be told


# ---- The page that follows

BUILT = feedback.bundle() is not None
SEEN = pytest.mark.skipif(not (BUILT and BROWSER), reason="no Chromium, or `make bundle` could not reach npm")
SUMS = Path(__file__).parents[1] / "web" / "bundle.sha256"


def planned_shares(dance: Dance, told: MovementInformation) -> Array:
    """Return the share (N,) of the table's variance that the whole dance removes as planned."""
    plan, total = dance.motion(told.rate), np.zeros_like(told.root)
    for phase in dance.phases:
        inside = (plan.time >= phase.start - 1e-9) & (plan.time <= phase.end + 1e-9)
        total += gathered(dance.body, plan.at(inside), told, held=phase.kind == "hold")
    return removed(total, told)


def gathered(body: Body, motion: Motion, told: MovementInformation, *, held: bool = False) -> Array:
    """Return the information (p, p) of a ``motion``, or of the posture in which it ends."""
    W = regressor(body, motion)
    if held:
        rows = (wrench_shift(told.about) @ W[-1])[2:5]
        return rows.T @ (told.still[:, None] * rows)
    noise = Noise(np.array([np.diag(1.0 / row) for row in told.weights]), told.about, Bands(told.edges, told.rate))
    white = whiten(noise, W).reshape(-1, W.shape[2])
    return white.T @ white


def removed(H: Array, told: MovementInformation) -> Array:
    """Return the share (N,) of the table's variance that an information (p, p) removes, mean over ten parameters."""
    after = told.root @ np.linalg.solve(np.eye(len(H)) + told.root.T @ H @ told.root, told.root.T)
    before = np.sum(told.root**2, axis=1)
    share = np.where(before > 0, 1.0 - np.diag(after) / np.where(before > 0, before, 1.0), 0.0)
    return share.reshape(-1, 10).mean(axis=1)


def test_what_the_parts_tell_adds_up_to_what_is_expected_of_the_dance(dance: Dance) -> None:
    planned, expected = planned_shares(dance, movement_information(dance)), expect(dance, steps=1).share[-1]
    assert np.corrcoef(planned, expected)[0, 1] > 0.9
    assert planned.mean() == pytest.approx(expected.mean(), abs=0.08)


def test_more_movement_tells_more_and_no_movement_nothing_new(dance: Dance) -> None:
    told, plan = movement_information(dance), dance.motion(12.5)
    move = next(phase for phase in dance.phases if phase.kind == "move")
    inside = (plan.time >= move.start) & (plan.time <= move.end)
    motion = Motion(*(each[inside] for each in (plan.time, plan.q, plan.v, plan.a)))
    H = gathered(dance.body, motion, told)
    arm, other = (dance.body.segment_index(f"{side}_forearm_hand") for side in ("left", "right"))
    assert removed(np.zeros_like(H), told) == pytest.approx(0.0, abs=1e-9)
    once, twice = removed(H, told), removed(4 * H, told)
    assert np.all(twice >= once)
    assert once[arm] > once[other], "the left arm moves, the right one hangs"
    rest = Motion(motion.time, np.tile(motion.q[0], (len(motion.q), 1)), 0 * motion.v, 0 * motion.a)
    gain = once - removed(gathered(dance.body, rest, told), told)
    assert dance.body.segments[int(np.argmax(gain))] in ("left_upper_arm", "left_forearm_hand")


def test_a_body_that_the_camera_does_not_know_is_not_followed(dance: Dance) -> None:
    scene = follow_scene(dance)
    assert scene is not None
    assert {one["name"] for one in scene["points"]} >= {"left wrist", "right ankle"}
    other = replace(
        dance.body,
        segments=tuple(f"link_{k}" for k in range(12)),
        sip=replace(dance.body.sip, segments=tuple(f"link_{k}" for k in range(12))),
    )
    assert follow_scene(replace(dance, body=other)) is None


@pytest.mark.skipif(not BUILT, reason="`make bundle` could not reach npm")
def test_the_bundle_is_that_of_the_lock_file() -> None:
    folder = Path(feedback.__file__).parents[1] / "feedback" / "bundle"
    lines = SUMS.read_text().splitlines()
    assert lines
    for line in lines:
        digest, name = line.split()
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest, f"{name}: run make clean bundle"


def test_what_only_tests_need_is_shipped_with_nothing() -> None:
    """axe-core (MPL-2.0) is asked about the pages, and is in none of them."""
    lock = json.loads((SUMS.parent / "package-lock.json").read_text())
    tools = {name.removeprefix("node_modules/"): one for name, one in lock["packages"].items() if one.get("dev")}
    assert {name: one["license"] for name, one in tools.items()} == {"axe-core": "MPL-2.0"}
    assert not set(tools) & set(lock["packages"][""]["dependencies"])
    for path in (Path(feedback.__file__).parents[1] / "feedback" / "bundle").glob("*") if BUILT else ():
        assert b"axe-core" not in path.read_bytes(), path.name


def test_without_the_bundle_the_page_leads_and_asks_for_nothing(
    dance: Dance, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(feedback, "bundle", lambda: None)
    assert feedback.write_feedback(dance, tmp_path / "page.html") is False
    text = (tmp_path / "page.html").read_text()
    assert "wasm" not in text.split("<style>")[0]
    assert 'id="known"' not in text


@SEEN
def test_a_browser_follows_counts_and_says_whom_it_does_not_see(dance: Dance, tmp_path: Path) -> None:
    page, film = tmp_path / "page.html", tmp_path / "empty.mjpeg"
    assert feedback.write_feedback(dance, page)
    Image.new("RGB", (320, 240), "#90a090").save(tmp_path / "one.jpg")
    film.write_bytes((tmp_path / "one.jpg").read_bytes() * 60)
    with Page(page.as_uri(), film=film, size="500,420") as browser:
        browser.run("document.getElementById('film').click()")
        goal = browser.until("document.body.dataset.goal")
        assert np.array(goal.split(), dtype=float) == pytest.approx(
            planned_shares(dance, movement_information(dance)), abs=0.02
        )
        assert "I see nobody" in browser.until(
            "/nobody/.test(document.body.dataset.followed) && document.body.dataset.followed"
        )
        browser.key(" ")
        browser.until("document.body.dataset.phase === 'hold'")
        at = browser.run(
            "[second, cues.map((cue) => cue.move_s), moment(cues[1].move_s - 1e-6).phase, moment(cues[1].move_s).phase]"
        )
        assert at[2:] == ["hold", "move"], "the cue changes at its instant"
        browser.key("Escape")
        assert browser.run("[document.body.dataset.phase, playing]") == ["ready", False]
        assert browser.asked() == [page.as_uri()]
        assert not [said for said in browser.said() if "WebGL" not in said]


def four_postures() -> Dance:
    """Return the small dance once more behind itself: four postures on the same feet, a rest after the second one."""
    dance = small_dance()
    x, via = np.tile(dance.postures, (2, 1)), np.concatenate([dance.via, dance.via[:, ::-1], dance.via])
    feet, under = dance.stances[:1] * 4, dance.under * 3
    twice = Dance(dance.protocol, dance.body, x, feet, np.ones(4), via, np.full(3, 2.0), under, 0)
    return replace(twice, care=("A helper stands beside.",), rest=3.5)


@pytest.fixture(scope="module")
def leading(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Page, str]]:
    """Yield a browser and the address of a page that leads through `four_postures` and does not follow."""
    dance, path = four_postures(), tmp_path_factory.mktemp("leads") / "page.html"
    path.write_text(feedback.feedback_page(dance.protocol, scene_of(dance), None, care=dance.care), encoding="utf-8")
    with Page(path.as_uri()) as browser:
        yield browser, path.as_uri()


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_a_posture_is_left_out_half_as_far_or_once_more_and_the_log_says_so(
    leading: tuple[Page, str], tmp_path: Path
) -> None:
    dance, (browser, address) = four_postures(), leading
    cues = scene_of(dance)["cues"]
    assert [cue["rest"] for cue in cues] == [False, True, False, False]
    assert [len(cue["after_skips"]) for cue in cues] == [0, 0, 1, 2]
    assert cues[2]["after_skips"] == [[]], "the third posture is the first one: nothing moves"
    assert cues[3]["after_skips"] == [[], cues[1]["calls"]]
    now = "[document.getElementById('now').textContent, document.getElementById('calls').innerText]"
    browser.open(f"{address}#t=0.5")
    assert "A helper stands beside." in browser.run("document.getElementById('care').textContent")
    browser.key("e")
    assert browser.run(now)[1].split("\n") == ["only half of the way:", *cues[1]["calls"]]
    browser.run("second = cues[1].hold_s + 0.5; show()")
    planned = browser.run("body.children.map((one) => one.quaternion.toArray())")
    browser.run("half.clear(); second = (cues[1].move_s + cues[1].hold_s) / 2; show()")
    assert np.allclose(planned, browser.run("body.children.map((one) => one.quaternion.toArray())"))
    browser.run("second = 0.5; show()")
    browser.key("ArrowRight")
    assert browser.run("[second, [...left_out], reached(1)]") == [cues[1]["hold_s"], [1], cues[0]["hold_s"]]
    assert browser.run("document.getElementById('skip').disabled") is False
    browser.key("ArrowLeft")
    assert browser.run("[second, left_out.size, pausing, wait]") == [cues[0]["hold_s"], 0, "back", 2.0]
    assert browser.run(now)[0] == "Take up posture 1 again. Next:"
    danced = "dispatchEvent(new CustomEvent('danced', { detail: { phase: 'hold', cue: %d, spent: %g } }))"
    browser.run("pausing = ''; " + danced % (0, 1.0) + ";" + danced % (1, 0.5))
    browser.run("second = cues[1].hold_s + 0.5; repeat(); second = cues[1].hold_s + 0.5; skip(); easier()")
    log = browser.run("visit()")
    (tmp_path / "dance_log_a.json").write_text(json.dumps(log))
    (tmp_path / "dance_log_b.json").write_text(json.dumps(log | {"mark": "0", "begun": "2020-01-01T10:00:00Z"}))
    other, mine = read_visit_logs(tmp_path, dance)
    assert (other.same, mine.same, mine.camera) == (False, True, False)
    assert [one.times for one in mine.postures] == [1, 2, 0, 0]
    assert [one.held_s for one in mine.postures] == [1.0, 0.5, 0.0, 0.0]
    assert [mine.numbers(what) for what in ("repeated", "skipped", "easier")] == [(2,), (3,), (4,)]
    row = VISIT_ROW.row(mine)
    assert log_in_words(row) == "dance_log_a.json: 2 of 4 postures danced; skipped 3; easier 4; repeated 2."
    (tmp_path / "dance_log_c.json").write_text(json.dumps(log | {"speed": "fast"}))
    with pytest.raises(FileRefused, match=r"dance_log_c.json: is no log of a dance \(.*speed"):
        read_visit_logs(tmp_path, dance)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_the_page_rests_shows_first_and_speaks_only_when_asked_by_a_voice_of_this_computer(
    leading: tuple[Page, str],
) -> None:
    dance, (browser, address) = four_postures(), leading
    cue = scene_of(dance)["cues"][2]
    voices = """window.spoken = []; speechSynthesis.getVoices = () => window.own ?? [];
        speechSynthesis.speak = (one) => window.spoken.push(one.text);
        window.SpeechSynthesisUtterance = function (text) { this.text = text; };
        window.requestAnimationFrame = () => 0; """
    frame = "; stamp = 0; tick(100)"  # a tenth of a second, however slow the browser draws
    browser.open(f"{address}#t=0.9")
    browser.run(voices + "run(true)" + frame)
    assert browser.run("document.body.dataset.phase") == "move"
    assert browser.run("spoken") == [], "off unless asked for"
    own = "own = [{ localService: false, lang: 'en-GB' }, { localService: true, lang: 'en-GB' }]; "
    browser.run("by('speak').checked = by('first').checked = true; speak('one')")
    assert "no voice of its own for this language" in browser.run("by('said').textContent")
    browser.run(own + "second = cues[1].hold_s - 0.05" + frame)
    assert browser.run("spoken.at(-1)") == " ".join(["Stand still. Next:", *cue["calls"]]).replace("°", " degrees")
    slow = 2 * (cue["hold_s"] - cue["move_s"]) - 0.5  # the slow motion, which the hold is too short for
    assert browser.run("wait") == pytest.approx(slow + 0.05, abs=1e-6)
    browser.run(f"wait = 0; second = {cue['move_s']} - 0.05" + frame)
    assert not browser.run("playing")
    assert browser.run("[by('now').textContent, pausing]") == ["Rest. Let free arms down", "rest"]
    browser.run("run(true)")
    assert browser.run("[pausing, wait]") == ["back", 5]
    browser.run(frame)
    assert browser.run("spoken.at(-1)").startswith("Take up posture 2 again. Next:")


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")
def test_progress_shows_a_column_a_visit_and_names_files_that_are_no_logs(leading: tuple[Page, str]) -> None:
    browser, address = leading
    browser.open(address)
    posture = {"times": 1, "held_s": 2.0, "skipped": False, "easier": True, "reached_deg": {"left arm lifted": 62}}
    log = {"biodance_dance_log": 1, "dance": "patient", "begun": "2026-03-0%dT10:00:00Z", "postures": [posture]}
    files = [json.dumps(log).replace("%d", str(day)) for day in (2, 1)] + ["{}"]
    browser.run(
        "(() => { const some = new DataTransfer(); "
        + json.dumps(files)
        + ".forEach((text, k) => some.items.add(new File([text], `log${k}.json`)));"
        "by('earlier').files = some.files; return by('earlier').onchange(); })()"
    )
    rows = browser.run("[...by('progress').rows].map((row) => [...row.cells].map((one) => one.textContent))")
    assert rows[0] == ["visit", "2026-03-01", "2026-03-02"]
    assert rows[1:4] == [["dance", *["patient"] * 2], ["postures", *["1 of 1"] * 2], ["easier", "1", "1"]]
    assert rows[-1] == ["left arm lifted", "62°", "62°"]
    assert browser.run("by('unread').textContent").startswith("No log of a dance: log2.json")


@SEEN
def test_how_far_joints_go_is_told_in_degrees(tmp_path: Path) -> None:
    dance = small_dance()
    write_feedback(dance, tmp_path / "page.html")
    with Page((tmp_path / "page.html").as_uri()) as browser:
        assert browser.run("window.followed.reach(0)") is None, "nothing was seen"
        found = browser.run("window.followed.angles(cues[1].hold_s)")
    assert found["left arm lifted"] - found["right arm lifted"] == pytest.approx(np.degrees(0.6), abs=4.0)
    assert found["left elbow bent"] == pytest.approx(np.degrees(0.2), abs=8.0), "the wrist is where its markers are"


@SEEN
def test_a_camera_that_is_denied_is_told_and_the_dance_goes_on(dance: Dance, tmp_path: Path) -> None:
    feedback.write_feedback(dance, tmp_path / "page.html")
    with Page((tmp_path / "page.html").as_uri(), denied=True, size="500,420") as browser:
        browser.run("document.getElementById('film').click()")
        said = browser.until("document.getElementById('said').textContent")
        assert "was not allowed; the dance works without it" in said
        browser.run("document.getElementById('play').click()")
        browser.until("Number(document.body.dataset.frames) > 3")
