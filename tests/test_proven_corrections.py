"""What the diagnosis proves to be wrong with plates is taken off before the body is fitted, with its doubt, and said;
what is only suspected stays. Faults hidden by the virtual laboratory, and the sign, the zero and the point of a real
plate.
"""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hidden_faults import hidden
from identified_sessions import RATE, body, movement, truth
from shared_markers import markers_asked_once

from biodance.cli import run
from biodance.diagnosis.accept import Gain
from biodance.diagnosis.diagnosis import Alias, Estimate, Finding
from biodance.effects.axis_error import moment_point
from biodance.identification.identification import identify_body
from biodance.identification.statistics import Fit
from biodance.identification.validation import validate
from biodance.lab.plates.faults import OFFSET, PlateCorrection, corrected_trial, correction_doubts
from biodance.motion.dynamics import predict_wrench
from biodance.pipeline import diagnosis
from biodance.pipeline.accepted import proven
from biodance.pipeline.results import SessionDiagnosis, SessionResult
from biodance.records import Plate, Source, Trial, Wrench
from biodance.spatial import wrench_about_origin

TRIALS = ("static", "move_1", "move_5", "squat_1")
WRONG = ("axis_error:target=Fy", "plate_offset:target=Mz,offset=12")
CORNERS = np.array([[0.6, 0.5, 0.0], [0.2, 0.5, 0.0], [0.2, -0.1, 0.0], [0.6, -0.1, 0.0]])


@pytest.fixture(scope="module", autouse=True)
def _the_same_recordings_are_diagnosed_once() -> Iterator[None]:
    """Let `report` have what `identify` found in the same recordings: both ask the same function for it; and sessions
    with the same markers what these tell.
    """
    known: dict[tuple[str, ...], tuple[SessionResult, SessionDiagnosis | None]] = {}
    diagnosed = diagnosis.diagnosed_and_corrected

    def once(result: SessionResult, **how: Any) -> tuple[SessionResult, SessionDiagnosis | None]:
        assert how["reference"] is None, "what is known of an earlier session is no part of the key"
        key = tuple(sorted(one.source.sha256 for one in result.session.trials))
        if key not in known:
            known[key] = diagnosed(result, **how)
        return known[key]

    with markers_asked_once(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnosis, "diagnosed_and_corrected", once)
        yield


def identified(folder: Path, capsys: pytest.CaptureFixture[str], *texts: str) -> tuple[dict, str, str]:
    """Return results.json, the page and the terminal of `biodance identify` on a session with faults hidden in it."""
    session = hidden(folder / "S01", *texts, trials=TRIALS)
    run(["identify", str(session), "--out", str(folder / "out")])
    out = folder / "out"
    return json.loads((out / "results.json").read_text()), (out / "report.html").read_text(), capsys.readouterr().out


def masses(found: dict) -> np.ndarray:
    """Return mass and standard deviation (kg) of every segment, (2, N)."""
    return np.array([[row[key] for row in found["segments"]] for key in ("mass_kg", "mass_sd_kg")])


def test_a_turned_sign_and_a_zero_are_taken_off_before_the_fit_and_nothing_off_a_sound_session(tmp_path, capsys):
    sound, page, said = identified(tmp_path / "sound", capsys)
    assert sound["corrected"] == []
    assert "taken off" not in page + said
    wrong, page, said = identified(tmp_path / "wrong", capsys, *WRONG)
    sign, zero = wrong["corrected"]
    assert (sign["effect"], sign["target"], sign["value"], sign["trials"]) == ("axis_error", "Fy", None, [])
    assert (zero["effect"], zero["target"], zero["unit"], zero["trials"]) == ("plate_offset", "Mz", "N·m", [])
    assert abs(zero["value"] - 12.0) < 2 * zero["sd"] < 4.0
    right, sd = masses(sound)
    assert np.all(np.abs(masses(wrong)[0] - right) < 0.3 * sd)
    assert np.all(masses(wrong)[1] > 0.99 * sd)
    for text in (page, said):
        assert text.count("taken off before the body was fitted, in all trials") == 2
        assert "Mz reads 12 N·m too much" in text
    told = wrong["validation"][0]["gain"]
    assert told["distribution"]["ci95"][0] > 0.5
    assert abs(told["mass"]["value"]) < 0.05


def test_the_report_corrects_alike_and_still_names_what_is_wrong(tmp_path):
    session = hidden(tmp_path / "S01", *WRONG, trials=TRIALS)
    run(["report", str(session), "--out", str(tmp_path / "out")])
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    assert [row["effect"] for row in found["corrected"]] == ["axis_error", "plate_offset"]
    assert {row["effect"] for row in found["diagnosis"]["findings"]} == {"axis_error", "plate_offset"}
    assert sum("taken off before" in row["text"] for row in found["attention"]) == 2
    assert found["identification"]["validation"][0]["identified"]["rms"][5] < 2.0


@pytest.mark.parametrize("folder", ["c3d", "raw"])
def test_the_plate_of_a_real_laboratory(folder, data, tmp_path):
    run(["identify", str(data / "laas_human" / folder), "--out", str(tmp_path / "out")])
    found = json.loads((tmp_path / "out" / "results.json").read_text())
    corrected = {(row["effect"], row["target"]): row for row in found["corrected"]}
    labels = {key for key in corrected if key[0] == "labels_swapped"}
    assert corrected.keys() - labels == {("axis_error", "Fy"), ("plate_offset", "Mz"), ("time_delay", "")}
    assert ("labels_swapped", "RWRA/RWRB") in labels
    assert abs(corrected["plate_offset", "Mz"]["value"] - 11.0) < 1.5
    assert abs(corrected["time_delay", ""]["value"] - 0.010) < 0.004
    assert abs(corrected["axis_error", "Fy"]["value"] - 0.9) < 0.05  # both files tell of one point
    for row in found["validation"]:
        assert row["identified"]["rms"][5] < 3.0  # 14 N·m as recorded, 7.7 with the moments about the plate's centre
        assert sum(row["identified"]["rms"][3:]) / 3 < 4.0  # 4.4 N·m with the forces as late as they are
        assert row["gain"]["distribution"]["ci95"][0] > 0.1


def on_plate(value: np.ndarray, time: np.ndarray, *, name: str = "fit_0", tared: bool = False) -> Trial:
    """Return a trial on one plate that reads ``value`` (T, 6) about its centre."""
    zero = np.array([0.0, 0.0, 8.0 * tared])
    plate = Plate("plate1", 2, CORNERS, Wrench(time, wrench_about_origin(value, CORNERS.mean(axis=0))), zero=zero)
    return Trial(name, "fit", None, (plate,), Source(Path(f"/lab/S01/{name}.c3d"), "00" * 32, "C3D", RATE, RATE))


@pytest.mark.parametrize(("channel", "axis", "beside"), [("Fy", 0, -0.6), ("Fx", 1, 0.4), ("Fy", 0, 0.0)])
def test_the_point_of_the_moments_is_found_beside_a_turned_force(channel, axis, beside):
    rng, centre = np.random.default_rng(3), np.array([1.5, 0.4, 0.0])
    needed = rng.normal(size=(400, 6)) * [20.0, 40.0, 80.0, 30.0, 30.0, 2.0]
    k, point = "xyz".index(channel[1].lower()), centre + np.eye(3)[axis] * beside
    force = needed[:, :3].copy()
    force[:, k] *= -1
    measured = np.concatenate([force, needed[:, 3:] + np.cross(point - centre, force - needed[:, :3])], axis=1)
    measured += rng.normal(size=measured.shape)
    found, sd = moment_point(measured, needed, channel, centre)
    if beside:
        assert abs(found - point[axis]) < 4 * sd < 0.03
    else:
        assert np.isnan(found)


def test_a_correction_holds_for_its_trials_and_not_where_the_empty_plate_told_the_zero():
    time = np.arange(0, 2, 1 / RATE)
    value = np.tile([1.0, 2.0, 700.0, 3.0, 4.0, 12.0], (time.size, 1))
    one = PlateCorrection("plate_offset", "Mz", 12.0, 1.5, trials=("fit_0",))
    off = corrected_trial(on_plate(value, time), [one]).wrench.value
    np.testing.assert_allclose((on_plate(value, time).wrench.value - off)[:, 5], 12.0)
    for other in (on_plate(value, time, name="fit_1"), on_plate(value, time, tared=True)):
        np.testing.assert_array_equal(corrected_trial(other, [one]).wrench.value, other.wrench.value)
        assert not correction_doubts(other, [one]).any()
    doubt = correction_doubts(on_plate(value, time), [one, replace(one, sd=float("nan"))])
    np.testing.assert_allclose(doubt[:, :, 0], np.tile(1.5 * OFFSET.zero("Mz"), (time.size, 1)), atol=1e-9)
    assert not doubt[:, :, 1].any()


def test_the_doubt_of_a_correction_widens_the_intervals_that_it_touches():
    one, moved = body(), movement(body(), 1, seconds=15.0)
    wrench = predict_wrench(one, moved, truth())
    noise = np.random.default_rng(5).normal(size=wrench.value.shape) * [1, 1, 2, 0.5, 0.5, 0.3]
    fit = Fit("fit_0", moved, Wrench(moved.time, wrench.value + noise), moved.time > 0.3)
    heavier = np.zeros_like(truth())
    heavier[10 * one.segment_index("left_forearm_hand")] = 5.0  # kg at the elbow: what the doubt looks like
    like = predict_wrench(one, moved, heavier).value[:, :, None]
    plain, doubted = (identify_body(one, (some,)) for some in (fit, replace(fit, doubts=like)))
    before, after = (np.sqrt(np.diag(found.sip.covariance)[::10]) for found in (plain, doubted))
    assert np.all(after > 0.99 * before)
    assert np.max(after / before) > 1.05


@pytest.mark.parametrize(
    ("other", "gain", "expected"),
    [(None, 0.1, True), (2.0, 0.1, True), (8.5, 0.1, False), (None, -0.1, False), (None, None, False)],
)
def test_only_what_is_surely_there_and_gains_is_proven(other, gain, expected):
    alike = (Alias("plate_gain", "Fz", 9.0), *((Alias("body_mass", "", other),) if other else ()))
    measured = None if gain is None else Gain(np.ones(6), np.ones(6), (gain, 0.5), ("squat_1",))
    one = Finding("plate_gain", "Fz", (Estimate("gain", 0.05, 0.01, "1"),), alike, 1.0, gain=measured, probability=0.99)
    assert proven(one, {}) is expected
    assert not proven(replace(one, probability=0.8), {})
    assert not proven(replace(one, effect="plate_position"), {})


def test_mass_and_distribution_are_told_apart():
    one, moved = body(), movement(body(), 2, seconds=15.0)
    use = moved.time > 0.3
    heavier = replace(one, sip=replace(one.sip, phi=1.05 * one.sip.phi))
    noise = np.random.default_rng(7).normal(size=(moved.time.size, 6)) * [1, 1, 2, 0.5, 0.5, 0.3]

    def gain(phi: np.ndarray, found) -> tuple:
        fit = Fit("kept", moved, Wrench(moved.time, predict_wrench(one, moved, phi).value + noise), use)
        seen = validate(one, found, fit, about=np.zeros(3))
        return seen.gain.mass, seen.gain.distribution

    mass, spread = gain(heavier.sip.phi, heavier)  # nothing but the mass is wrong
    assert mass.ci95[0] > 0.8
    assert abs(spread.value) < 1e-9
    true = replace(one, sip=replace(one.sip, phi=truth() * one.sip.mass.sum() / truth()[::10].sum()))
    mass, spread = gain(true.sip.phi, true)  # nothing but the distribution is
    assert abs(mass.value) < 1e-9
    assert spread.ci95[0] > 0.5
    short = Fit("kept", moved, predict_wrench(one, moved), moved.time > 13.5)
    assert validate(one, true, short, about=np.zeros(3)).gain.mass.ci95 is None
