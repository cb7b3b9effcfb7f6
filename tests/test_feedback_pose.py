"""The page that follows: what a dance tells is the same in Python and in the browser; who is not seen is told so."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from browser import BROWSER, Page
from PIL import Image
from small_dances import small_dance

from biodance.body.body import Body
from biodance.dance.dance import Dance
from biodance.dance.expectation import MovementInformation, expect, movement_information
from biodance.motion.dynamics import regressor
from biodance.records import Array, Motion
from biodance.report.feedback import write
from biodance.report.feedback.write import follow_scene
from biodance.spatial import wrench_shift
from biodance.uncertainty.bands import Bands
from biodance.uncertainty.noise import Noise

BUILT = write.bundle() is not None
SEEN = pytest.mark.skipif(not (BUILT and BROWSER), reason="no Chromium, or `make bundle` could not reach npm")
SUMS = Path(__file__).parents[1] / "web" / "bundle.sha256"


@pytest.fixture(scope="module")
def dance() -> Dance:
    return small_dance()


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
    white = noise.whiten(W).reshape(-1, W.shape[2])
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
    from dataclasses import replace

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
    folder = Path(write.__file__).parent / "bundle"
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
    for path in (Path(write.__file__).parent / "bundle").glob("*") if BUILT else ():
        assert b"axe-core" not in path.read_bytes(), path.name


def test_without_the_bundle_the_page_leads_and_asks_for_nothing(
    dance: Dance, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(write, "bundle", lambda: None)
    assert write.write_feedback(dance, tmp_path / "page.html") is False
    text = (tmp_path / "page.html").read_text()
    assert "wasm" not in text.split("<style>")[0]
    assert 'id="known"' not in text


@SEEN
def test_a_browser_follows_counts_and_says_whom_it_does_not_see(dance: Dance, tmp_path: Path) -> None:
    page, film = tmp_path / "page.html", tmp_path / "empty.mjpeg"
    assert write.write_feedback(dance, page)
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


@SEEN
def test_a_camera_that_is_denied_is_told_and_the_dance_goes_on(dance: Dance, tmp_path: Path) -> None:
    write.write_feedback(dance, tmp_path / "page.html")
    with Page((tmp_path / "page.html").as_uri(), denied=True, size="500,420") as browser:
        browser.run("document.getElementById('film').click()")
        said = browser.until("document.getElementById('said').textContent")
        assert "was not allowed; the dance works without it" in said
        browser.run("document.getElementById('play').click()")
        browser.until("Number(document.body.dataset.frames) > 3")
