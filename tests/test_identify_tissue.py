"""What fitted trials tell of skin, flesh and joints: known errors come back in kept movement, no others."""

from dataclasses import replace

import numpy as np
import pytest
from identify_trials import noisy_fit, smooth_motion
from scipy.optimize import minimize_scalar

from biodance.body.body import Body
from biodance.body.human.human import human
from biodance.identification.statistics import Fit
from biodance.identification.tissue import TISSUE_KINDS, Tissue, TissueInTrial, _scales
from biodance.identification.validation import validate
from biodance.motion.dynamics import predict_wrench
from biodance.motion.kinematics import poses
from biodance.records import Array, Motion, Subject, Wrench
from biodance.report.wording import parted_gain

ABOUT = np.zeros(3)
LOOSE = np.array([0.012, -0.02, 0.009])
"""m per radian of the knee: how far the matter of the right thigh is carried, along its axes."""


def person() -> Body:
    return human(Subject(70.0, 1.75, "M", 30.0))


def carried(body: Body, motion: Motion) -> Array:
    """Return (T, 6): what a thigh of which the matter moves by `LOOSE` times the knee's angle adds to the wrench, from
    its momentum and its weight.
    """
    s, knee = body.segment_index("right_thigh"), body.joint_index("right_knee_flexion")
    pose, mass, inertia = poses(body, motion.q), body.sip.mass[s], np.zeros((motion.time.size, 3))
    com = pose.points([s], body.sip.com[[s]])[:, 0]
    away = motion.q[:, 7 + knee, None] * (pose.rotation[:, s] @ LOOSE)

    def rate(value: Array) -> Array:
        return np.gradient(value, 1.0 / motion.rate, axis=0, edge_order=2)

    before, after = (mass * np.cross(at, rate(at)) + inertia for at in (com, com + away))
    moment = rate(after - before) - np.cross(away, mass * body.gravity)
    return np.concatenate([mass * rate(rate(away)), moment], axis=1)


def trials(loose: float, seed: int) -> tuple[Body, Fit, Fit]:
    """Return a body, a trial to fit and one kept, of a person whose thigh is ``loose`` times as loose as `LOOSE`."""
    body, rng = person(), np.random.default_rng(seed)
    found = []
    for _ in range(2):
        fit = noisy_fit(body, smooth_motion(body, rng, frames=1500, size=0.3), body.sip.phi, rng, size=0.2)
        more = loose * carried(body, fit.motion)
        found.append(replace(fit, wrench=Wrench(fit.wrench.time, fit.wrench.value + more)))
    return body, found[0], found[1]


def told(body: Body, fit: Fit) -> Tissue:
    return Tissue(body, (fit,), (np.zeros((fit.motion.time.size, 6)),), ABOUT)


def left(body: Body, fit: Fit, tissue: Tissue | None = None) -> Array:
    """Return (6,) RMS of what a body leaves of a trial, with or without its tissue."""
    added = TissueInTrial(tissue, fit.motion).added if tissue else 0.0
    inner = slice(100, -100)
    off = fit.wrench.value - predict_wrench(body, fit.motion).value - added
    return np.asarray(np.sqrt(np.mean(off[inner] ** 2, axis=0)))


@pytest.mark.parametrize("seed", [1, 2])
def test_matter_that_is_carried_is_taken_off_movement_that_was_kept(seed: int) -> None:
    body, fit, kept = trials(8.0, seed)
    rigid = left(body, trials(0.0, seed)[2])
    before, after = left(body, kept), left(body, kept, told(body, fit))
    assert np.all(before > 5 * rigid)
    assert np.all(after**2 - rigid**2 < 0.1 * (before**2 - rigid**2))


def test_a_rigid_body_is_hardly_touched() -> None:
    body, fit, kept = trials(0.0, 3)
    tissue = told(body, fit)
    assert np.all(left(body, kept, tissue) < 1.05 * left(body, kept))
    assert all(scale < 1.2 for scale in tissue.readings.scales.values())
    assert set(tissue.readings.scales) == set(TISSUE_KINDS.values())


def test_the_scales_say_what_is_loose() -> None:
    body, fit, _ = trials(4.0, 4)
    scales = dict(told(body, fit).readings.scales)
    assert scales.pop("flesh") > 2.0
    assert max(scales.values()) < 1.0


def test_what_the_plates_read_is_no_tissue() -> None:
    body, fit, _ = trials(4.0, 8)
    read = np.tile([3.0, -2.0, 5.0, 1.0, 2.0, -1.0], (fit.motion.time.size, 1)) * np.cos(fit.motion.time)[:, None]
    there = replace(fit, wrench=Wrench(fit.wrench.time, fit.wrench.value + read))
    beside = Tissue(body, (there,), (read,), ABOUT)
    np.testing.assert_allclose(beside.readings.size, told(body, fit).readings.size, rtol=1e-6, atol=1e-9)
    assert not np.allclose(told(body, there).readings.size, beside.readings.size, rtol=0.1, atol=1e-4)


def test_nothing_is_told_by_what_a_low_pass_has_taken_out() -> None:
    body, fit, _ = trials(4.0, 9)
    # One coefficient, at 4.5 Hz, of the cosine transform of every fourth of 1500 frames at 100 Hz.
    low, wave = replace(fit, cutoff=3.0), 20.0 * np.cos(np.pi * 135 * (2 * np.arange(1500) / 4 + 1) / (2 * 375))
    loud = replace(low, wrench=Wrench(fit.wrench.time, fit.wrench.value + wave[:, None]))
    quiet, disturbed = (told(body, one).readings.size for one in (low, loud))
    np.testing.assert_allclose(disturbed, quiet, atol=1e-6 * np.abs(quiet).max())


def test_without_a_run_of_usable_frames_nothing_is_told() -> None:
    body, fit, kept = trials(1.0, 5)
    tissue = told(body, replace(fit, use=np.zeros_like(fit.use)))
    assert not tissue.readings.size.any()
    np.testing.assert_array_equal(TissueInTrial(tissue, kept.motion).added, 0.0)
    one = validate(body, body, kept, about=ABOUT, tissue=tissue)
    assert one.extended is None
    assert one.extended_agreement is None
    assert one.gain.tissue is None


def test_what_it_gains_on_kept_movement_stands_beside_what_the_body_gains() -> None:
    body, fit, kept = trials(4.0, 7)
    one = validate(body, body, kept, about=ABOUT, tissue=told(body, fit))
    plain = validate(body, body, kept, about=ABOUT)
    assert plain.extended is None
    assert plain.gain.tissue is None
    assert one.gain.tissue is not None
    assert one.extended_agreement is not None
    assert np.all(one.extended_agreement.rms < one.identified_agreement.rms)
    assert one.gain.tissue.ci95 is not None
    assert one.gain.tissue.ci95[0] > 0.3
    assert one.gain.mass == plain.gain.mass
    assert one.gain.distribution == plain.gain.distribution


def test_the_scale_is_the_most_probable_one() -> None:
    square, count = np.array([40.0, 3.0, 0.0]), np.array([12.0, 9.0, 0.0])

    def against(scale: float, k: int) -> float:
        return float(count[k] * scale + square[k] * np.exp(-2 * scale) / 2 + scale**2 / (2 * 0.6**2))

    wanted = [minimize_scalar(against, args=(k,), bounds=(-5, 5), method="bounded").x for k in range(3)]
    np.testing.assert_allclose(_scales(square, count, np.zeros(3)), wanted, atol=1e-4)


def test_the_sentence_names_what_moves_only_where_it_is_told() -> None:
    share = {"value": 0.25, "ci95": [0.2, 0.3]}
    gain = {"mass": share, "distribution": share, "tissue": None}
    assert "skin" not in parted_gain(gain)
    assert "25.0 % (20.0 to 30.0) skin, flesh and joints" in parted_gain({**gain, "tissue": share})
    for worse in ({"value": 0.03, "ci95": [-0.1, 0.2]}, {"value": -0.12, "ci95": None}):
        assert parted_gain({**gain, "tissue": worse}).endswith("explains nothing of what is then left")
        assert "-12" not in parted_gain({**gain, "tissue": worse})
