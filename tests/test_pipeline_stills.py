"""What is drawn in 3-D: the frame with the largest residual, the load where it sits, postures; with GL and without."""

import base64
import json
import re
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from identified_sessions import session_result
from scipy.spatial.transform import Rotation

from biodance.body.solids import shape_parts
from biodance.child_process import run_python
from biodance.identification.added_mass import MASSES, LoadPosterior, added_mass
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.pipeline.results import Placed
from biodance.pipeline.still import load_still, posture_still, replay_scene, worst_still
from biodance.records import Markers
from biodance.records.motion import BY_FRAME
from biodance.report.figures import solid
from biodance.report.figures.session import RESIDUAL_SCALE, VIEWS, still_figure
from biodance.report.figures.solid import sheet_png
from biodance.report.pages.template import script_json


@pytest.fixture(scope="module")
def result():
    """Return the session with markers, which the stills show."""
    found = session_result(load=2.0)
    trials = []
    for one in found.trials:
        xyz = poses(found.body, one.motion.q).points(list(found.body.markers.segment), found.body.markers.position)
        markers = Markers(found.body.markers.names, one.motion.time, xyz)
        trials.append(replace(one, trial=replace(one.trial, markers=markers)))
    return replace(found, trials=tuple(trials))


def test_the_worst_frame_is_the_one_that_was_spoilt(result):
    first = result.trials[0]
    measured, used = np.array(first.comparison.measured), np.array(first.comparison.used)
    measured[200, :3] += [300.0, -400.0, 1200.0]
    measured[100, :3] += 9000.0
    used[100] = False  # a frame that the plates do not measure does not count
    spoilt = replace(first, comparison=replace(first.comparison, measured=measured, used=used))
    still = worst_still(result.identification.identification.identified, (spoilt, *result.trials[1:]))
    assert (still.trial, still.time) == (first.trial.name, pytest.approx(first.motion.time[200]))
    np.testing.assert_allclose(still.residual, [300.0, -400.0, 1200.0], atol=60.0)
    assert "The worst frame" in still.about
    (first, _) = re.findall(r'd="M(\S+) (\S+) (\S+) (\S+)" fill="none" class="residual"', still_figure(still))
    x, y, to_x, to_y = map(float, first)
    elevation = np.radians(VIEWS[0][0])
    assert (
        abs(to_y - y)
        == pytest.approx(  # mm down, of an arrow that leans towards the eye or away from it
            1000 * RESIDUAL_SCALE * still.residual[2] * np.cos(elevation),
            abs=1000 * RESIDUAL_SCALE * np.hypot(*still.residual[:2]) * np.sin(elevation) + 1,
        )
    )
    assert abs(to_x - x) <= 1000 * RESIDUAL_SCALE * np.hypot(*still.residual[:2]) + 1


def test_without_a_measured_frame_there_is_no_worst_one(result):
    nothing = [
        replace(one, comparison=replace(one.comparison, used=np.zeros_like(one.comparison.used)))
        for one in result.trials
    ]
    assert worst_still(result.body, tuple(nothing)) is None


def test_a_load_is_drawn_where_it_sits(result):
    search = result.identification.search
    assert search.found
    place = np.array([0.0, -0.2, 0.02])
    weight = np.exp(-0.5 * ((MASSES - 2.0) / 0.1) ** 2) * np.gradient(MASSES)
    sure = LoadPosterior(0.0, weight / weight.sum())
    best = replace(search.best, segment="left_forearm_hand", place=place, posterior=sure)
    still = load_still(result.body, result.trials, replace(search, suspects=(best, *search.suspects[1:])))
    one = result.trials[0]
    pose, segment = (
        poses(result.body, one.motion.q[one.motion.time.size // 2]),
        result.body.segment_index("left_forearm_hand"),
    )
    np.testing.assert_allclose(still.load, pose.points([segment], place[None])[0, 0], atol=1e-12)
    low, high = best.interval
    assert still.about == (
        "The load that was found (yellow): 2.00 kg on the left forearm with hand "
        f"(95 % interval {low:.2f} to {high:.2f} kg; probability of no load below 0.001)."
    )
    unplaced = replace(best, place=np.full(3, np.nan))
    assert load_still(result.body, result.trials, replace(search, suspects=(unplaced, *search.suspects[1:]))) is None


def test_without_a_load_none_is_drawn():
    result = session_result()
    search = added_mass(result.identification.identification)
    if search.found:
        pytest.fail("a session without a load must not announce one")
    assert load_still(result.body, result.trials, search) is None


def test_head_and_trunk_are_two_shapes_within_their_box(result):
    body = result.body
    trunk = body.segment_index("trunk_head")
    torso, head = (box for segment, box in shape_parts(body) if segment == trunk)
    assert head[1, 1] == body.boxes[trunk, 1, 1]
    assert torso[0, 1] == body.boxes[trunk, 0, 1]
    assert head[0, 1] <= torso[1, 1] + 1e-9  # they meet
    assert np.all(head[0] >= body.boxes[trunk, 0] - 0.02)
    assert 0.15 < np.ptp(head[:, 1]) < 0.30
    assert len(shape_parts(body)) == len(body.segments) + 1


def test_pictures_are_drawn_where_the_machine_can(result):
    from PIL import Image

    stills = [posture_still(result.body, result.body.neutral, f"{k}") for k in range(2)]
    drawn = sheet_png(stills)
    if drawn is None:
        pytest.skip("this machine draws no 3-D pictures; biodance doctor says how to mend it")
    with Image.open(BytesIO(drawn)) as picture:
        assert picture.size == (600, 420)
        pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    assert 0.03 < np.mean(np.any(pixels < 240, axis=1)) < 0.6  # bodies on white ground
    warm, cold = pixels[:, 0].astype(int) - pixels[:, 2] > 40, pixels[:, 2].astype(int) - pixels[:, 0] > 40
    assert min(warm.mean(), cold.mean()) > 0.003  # a left and a right side


@pytest.mark.parametrize(
    "code", ["import os; os.abort()", "print('[]')", "print('no json')", "import time; time.sleep(30)"]
)
def test_a_child_without_gl_is_no_crash_and_no_hang(result, monkeypatch, code):
    monkeypatch.setattr(solid, "_PATIENCE", 1.5)
    monkeypatch.setattr(solid, "run_python", lambda *_, **kind: run_python("-c", code, **kind))
    assert sheet_png([posture_still(result.body, result.body.neutral, "one")]) is None


def unpacked(text: str, *shape: int) -> np.ndarray:
    """Return int16 numbers of the page, -32768 as NaN."""
    whole = np.frombuffer(base64.b64decode(text), "<i2").reshape(shape).astype(float)
    return np.where(whole == -32768, np.nan, whole)


def test_a_replay_holds_every_body_marker_and_force_where_they_were(result):
    data = json.loads(script_json(replay_scene(result)))
    one, found = data["trials"][0], result.trials[0]
    frames, segments, markers = one["frames"], one["segments"], one["markers"]
    frame = np.argmin(np.abs(found.motion.time - (one["start_s"] + 7 * one["step_s"])))
    assert 1 / one["step_s"] <= 25 + 1e-9
    places = unpacked(one["places"], frames, segments + markers + 3, 3) * one["unit"] + np.array(one["origin"])
    pose = poses(result.body, found.motion.q[frame])
    np.testing.assert_allclose(places[7, :segments], pose.position[0], atol=1e-3)
    np.testing.assert_allclose(places[7, segments:-3], found.trial.markers.xyz[frame], atol=1e-3)
    turn = unpacked(one["turns"], frames, segments, 4)[7] / 32767
    np.testing.assert_allclose(Rotation.from_quat(turn).as_matrix(), pose.rotation[0], atol=1e-3)
    forces = unpacked(one["forces"], frames, 3, 3) / 10
    identified = predict_wrench(result.identification.identification.identified, found.motion).force
    np.testing.assert_allclose(forces[7, 1], identified[frame], atol=0.06)
    left = np.where(found.comparison.used[:, None], found.comparison.measured[:, :3] - identified, np.nan)
    worst = np.nanargmax(np.linalg.norm(left, axis=1))
    assert one["worst_s"] == pytest.approx(found.motion.time[worst])
    shown = round((one["worst_s"] - one["start_s"]) / one["step_s"])
    np.testing.assert_allclose(forces[shown, 2], left[worst], atol=0.06)
    assert np.isnan(forces[:, 0]).all()  # no plate, no measured force
    assert {box["side"] for box in data["boxes"]} == {"left", "right", "middle"}
    assert [trial["name"] for trial in data["trials"]] == [trial.name for trial in result.trials]


def test_a_replay_shows_the_load_that_was_found_and_stays_small(result, monkeypatch):
    monkeypatch.setattr("biodance.pipeline.still._FRAMES", 40)
    search, place = result.identification.search, np.array([0.0, -0.2, 0.02])
    best = replace(search.best, segment="left_forearm_hand", place=place)
    found = replace(result.identification, search=replace(search, suspects=(best, *search.suspects[1:])))
    data = json.loads(script_json(replay_scene(replace(result, identification=found))))
    assert data["load"] == {"on": result.body.segment_index("left_forearm_hand"), "place": place.tolist()}
    assert sum(one["frames"] for one in data["trials"]) <= 44
    assert replay_scene(replace(result, placed=Placed(None, ""))) is None
    first, *others = result.trials
    motion = first.motion
    still = replace(first, motion=replace(motion, **{name: getattr(motion, name)[:1] for name in BY_FRAME}))
    assert first.name not in [one["name"] for one in replay_scene(replace(result, trials=(still, *others)))["trials"]]
