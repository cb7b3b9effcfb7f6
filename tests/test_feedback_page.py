"""The page that leads: what is in it, that it needs nothing from outside, and what it shows in a browser."""

import re
import shutil
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest
from browser import Page
from scipy.spatial.transform import Rotation
from small_dances import small_dance

from biodance.cli import run
from biodance.dance.dance import Dance
from biodance.errors import BiodanceError
from biodance.motion.kinematics import poses
from biodance.report.feedback.write import scene_of, write_feedback

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")


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
