"""A recording as a stream: the end is the batch, faults injected half way are named within 5 s, and none elsewhere."""

import json
import shutil
from dataclasses import replace
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest
from accessible import ASKED, complaints, unfold
from browser import Page
from stream_faults import exchanged, offset, silent

from biodance.body.human.human import human
from biodance.cli import run
from biodance.cli.shared import DONE, NEEDS_A_PERSON, NOT_DONE
from biodance.diagnosis.watch import LiveWarning, silent_plates
from biodance.errors import BiodanceError
from biodance.identification.identification import identify_body
from biodance.identification.knowledge import initial_posterior
from biodance.motion.kinematics import poses
from biodance.pipeline.live import LiveSession, LiveState, StreamWatch, body_and_stream, replay
from biodance.pipeline.still import asked_posture, asked_words
from biodance.records import Markers, Sip, Subject, Wrench
from biodance.report.live import LivePage
from biodance.virtual_lab.simulate import simulate_session

BODY = human(Subject(63.0, 1.68, "F", 30.0))
FAULT = 6.0
"""s at which faults begin."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("live")
    simulate_session(Subject(63.0, 1.68, "F", 30.0), "short", place / "visit", seed=5)
    return place / "visit"


@pytest.fixture(scope="module")
def streamed(folder):
    return body_and_stream(folder / "dance_1.c3d")


def until(trial, seconds: float):
    """Return the trial's first seconds."""
    keep = trial.markers.time < seconds
    markers = Markers(trial.markers.names, trial.markers.time[keep], trial.markers.xyz[keep])
    return replace(trial, markers=markers)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (offset, ("plate_offset", "plate1:Fz")),
        (silent, ("plate_gone", "plate1")),
        (exchanged, ("labels_swapped", "LASI/RASI")),
    ],
)
def test_a_fault_half_way_is_named_in_time_and_its_frames_do_not_count(streamed, change, fault):
    body, trial = streamed
    session = LiveSession(body, until(change(trial, FAULT)[0], FAULT + 2.0))
    said = [one for _ in range(session.markers.time.size) for one in session.push()]
    assert [(one.effect, one.target) for one in said] == [fault]
    assert FAULT < said[0].time_s <= FAULT + 5.0
    state = session.state()
    assert state.suspect == (said[0].text,)
    assert "Mend what is suspect" in state.advice


@pytest.mark.parametrize(("seconds", "told"), [(0.25, []), (0.35, ["plate_offset"])])
def test_a_load_on_a_plate_is_told_as_soon_as_nobody_is_on_it(streamed, seconds, told):
    body, trial = streamed
    (plate,), time = trial.plates, np.arange(100) / 100
    value = np.tile([2.0, 0.0, 30.0, 0.0, 0.0, 0.0], (100, 1)) + np.random.default_rng(1).normal(size=(100, 6))
    left, on = 80 - round(100 * seconds), np.zeros((100, 2, 1), dtype=bool)
    value[:left, 2], on[:left, 0] = 600.0, True
    value[80:, 2] = 600.0  # the filter has not settled there
    plates = (replace(plate, wrench=Wrench(time, value)),)
    watch = StreamWatch(trial, LiveSession(body, trial)._follower, weight=620.0)
    watch.look_at_plates(1.0, replace(trial, plates=plates), plates, on, until=80)
    assert [one.effect for one in watch.warnings] == told
    assert all(one.target == "plate1:Fz" and "+30 N" in one.text for one in watch.warnings)


@pytest.mark.parametrize(
    ("before", "rest", "told"), [(600.0, 0.0, ["plate_gone"]), (15.0, 0.0, []), (15.0, 15.0, ["plate_gone"])]
)
def test_a_load_that_faded_is_no_plate_that_fell_silent(streamed, before, rest, told):
    _, trial = streamed
    (plate,), time = trial.plates, np.arange(100) / 100
    value = np.random.default_rng(1).normal(size=(100, 6))
    value[:, 2] += np.linspace(2 * before, before, 100)
    value[60:] = rest
    one = replace(plate, wrench=Wrench(time, value))
    said = silent_plates(1.0, (one,), np.array([True]), 620.0)
    assert [warning.effect for warning in said] == told
    assert silent_plates(1.0, (one,), np.array([False]), 620.0) == ()


def test_the_end_is_the_batch_of_the_same_frames_and_frames_are_quick(streamed):
    body, trial = streamed
    found = replay(body, until(trial, 10.0))
    batch = identify_body(body, (found.fit,))
    assert found.warnings == ()
    assert found.fit.use.all()
    assert found.fit.motion.time.size == 1000
    np.testing.assert_allclose(found.identification.sip.phi, batch.sip.phi, rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        np.sqrt(np.diag(found.identification.sip.covariance)), np.sqrt(np.diag(batch.sip.covariance)), atol=1e-9
    )
    assert [one.verdict for one in found.identification.known] == [one.verdict for one in batch.known]
    assert np.median(found.frame_s) < 0.005


def test_the_page_shows_the_newest_state_to_this_machine_alone():
    state = LiveState(3.0, {"left_thigh": "known"}, ("Plate 1 fell silent.",), "Mend it.")
    with LivePage() as page:
        page.show(state)
        page.warn(LiveWarning(2.5, "plate_gone", "plate1", "Plate 1 fell silent."))
        assert b"biodance live" in urlopen(page.address).read()
        said = json.loads(urlopen(f"{page.address}state.json").read())
        assert (said["time_s"], said["suspect"], said["next"]) == (3.0, ["Plate 1 fell silent."], "Mend it.")
        assert said["warnings"] == [{"time_s": 2.5, "text": "Plate 1 fell silent."}]
        assert said["known"] == {"left_thigh": "known"}
        for wrong in (Request(page.address, headers={"Host": "elsewhere.example:80"}), f"{page.address}etc"):
            with pytest.raises(HTTPError, match="404") as refused:
                urlopen(wrong)
            refused.value.close()
        with pytest.raises(BiodanceError, match="Give another one"):
            LivePage(int(page.address.rsplit(":", 1)[1].strip("/")))


@ASKED
def test_nobody_is_shut_out_of_the_page():
    state = LiveState(3.0, {"left_thigh": "known", "pelvis": "partly known"}, ("Plate 1 fell silent.",), "Mend it.")
    with LivePage() as page, Page("about:blank#begin") as browser:
        page.body, state = BODY, replace(state, asked="left_thigh")
        page.show(state)
        page.warn(LiveWarning(2.5, "plate_gone", "plate1", "Plate 1 fell silent."))
        unfold(browser, page.address)
        browser.until("/Mend it/.test(document.body.innerText) && /thigh/.test(document.body.innerText)", 10.0)
        assert complaints(browser) == []


@pytest.mark.parametrize("segment", [name for name in BODY.segments if not name.endswith("foot")])
def test_what_is_asked_can_be_done_and_is_drawn(segment: str) -> None:
    said, q = asked_words(segment), asked_posture(BODY, segment)
    assert segment.partition("_")[0] in said or not segment.startswith(("left", "right")) or "both" in said
    assert "further and faster" not in said
    angles = q[BODY.nq - len(BODY.joints) :]
    assert np.all((BODY.limits.lower <= angles + 1e-9) & (angles <= BODY.limits.upper + 1e-9)), "a person can do it"
    posed = poses(BODY, q)
    soles = [BODY.segment_index(f"{side}_foot") for side in ("left", "right")]
    assert posed.rotation[0, soles][:, 2, 1] == pytest.approx(1.0, abs=1e-6), "flat on the floor"
    assert np.abs(angles).max() > 0.3


def test_the_page_draws_what_is_asked_once_it_knows_the_body() -> None:
    with LivePage() as page:
        for body, drawn in ((None, False), (BODY, True)):
            page.body = body
            page.show(LiveState(3.0, {}, (), asked_words("left_upper_arm"), "left_upper_arm"))
            said = json.loads(urlopen(f"{page.address}state.json").read())
            assert said["next"] == "Lift the left arm sideways to shoulder height, and let it down again."
            assert said["picture"].startswith("<svg") == drawn


def test_the_running_belief_is_least_squares_with_the_prior():
    rng = np.random.default_rng(0)
    prior = Sip(("one",), rng.normal(size=10), np.diag(rng.uniform(0.5, 2, 10)))
    rows, seen = rng.normal(size=(40, 6, 10)), rng.normal(size=(40, 6))
    variance, posterior = np.array([1.0, 2.0, 3.0, 0.5, 1.5, 2.5]), initial_posterior(prior)
    for W, wrench in zip(rows, seen, strict=True):
        posterior = posterior.updated(W, wrench, variance)
    weight = np.tile(1 / variance, 40)
    flat, at_once = rows.reshape(-1, 10), np.linalg.inv(np.array(prior.covariance))
    information = at_once + flat.T @ (weight[:, None] * flat)
    mean = np.linalg.solve(information, at_once @ prior.phi + flat.T @ (weight * seen.ravel()))
    np.testing.assert_allclose(posterior.mean, mean, atol=1e-10)
    np.testing.assert_allclose(posterior.covariance, np.linalg.inv(information), atol=1e-10)


def test_the_command(folder, tmp_path, capsys):
    squat = folder / "squat_1.c3d"
    assert run(["live", str(squat), "--json"]) == DONE
    found = json.loads(capsys.readouterr().out)
    assert found["warnings"] == []
    assert found["frames"] == found["frames_used"]
    assert 0 < found["frame_ms"]["median"] <= found["frame_ms"]["p99"]
    assert {row["quantity"] for row in found["known"]} == {"mass", "com x", "com y", "com z"}

    alone = tmp_path / "alone"
    alone.mkdir()
    shutil.copy(squat, alone)
    (alone / "session.toml").write_text('[subject]\nmass_kg = 63\nheight_m = 1.68\nsex = "F"\n', encoding="utf-8")
    assert run(["live", str(alone / squat.name)]) == NOT_DONE
    assert "--static FILE" in capsys.readouterr().err
    static = ["--static", str(folder / "static.c3d")]
    assert run(["live", str(alone / squat.name), *static, "--page", "0"]) in (DONE, NEEDS_A_PERSON)
    assert "next: " in capsys.readouterr().out
    assert run(["live", str(alone / "none.c3d")]) == NOT_DONE
