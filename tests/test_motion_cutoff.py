"""The cut-off that a trial asks for: movements in closed form, with noise of known size, against the true wrench."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from biodance.body.human.human import human
from biodance.lab.prepare import LowPass
from biodance.motion.dynamics import predict_wrench
from biodance.motion.ik.inverse_kinematics import solve_ik
from biodance.motion.kinematics import poses
from biodance.motion.track import Followed, asked_cutoff, own_cutoff, smooth, with_cutoff
from biodance.records import Array, Markers, Motion, Source, Subject, Trial
from biodance.settings import USUAL

WOMAN = human(Subject(58.3, 1.64, "F", 31.0))
FIXED = (3.0, 6.0, 10.0, 20.0)
"""Hz that laboratories use."""
SECONDS = 12.0
MIDDLE = 0.5 * (WOMAN.limits.lower + WOMAN.limits.upper)
MIDDLE[[WOMAN.joint_index(f"{side}_shoulder_adduction") for side in ("left", "right")]] = -0.4  # not at 90 degrees
SPAN = WOMAN.limits.upper - WOMAN.limits.lower


def movement(time: Array, slow: float) -> Motion:
    """Return a body that sways and bends every joint, whose amplitude falls with frequency as exp(-(f / ``slow``)²)."""
    rng = np.random.default_rng(2)
    frequency = np.arange(1, int(40 * slow)) / SECONDS
    size = np.concatenate([0.05 * SPAN, [0.1, 0.05, 0.1]])
    weight = np.exp(-((frequency / slow) ** 2)) / np.linalg.norm(np.exp(-((frequency / slow) ** 2)))
    ahead, aside = rng.normal(0, 1, (2, frequency.size, size.size)) * weight[:, None] * size
    omega = 2 * np.pi * frequency
    cosine, sine = np.cos(np.outer(time, omega)), np.sin(np.outer(time, omega))
    q = cosine @ ahead + sine @ aside + np.concatenate([MIDDLE, [0.0, 0.0, 0.9]])
    v = cosine @ (omega[:, None] * aside) - sine @ (omega[:, None] * ahead)
    a = -(cosine @ (omega[:, None] ** 2 * ahead) + sine @ (omega[:, None] ** 2 * aside))
    still, zero = np.tile([0.0, 0.0, 0.0, 1.0], (time.size, 1)), np.zeros((time.size, 3))
    rates = (np.hstack([one[:, -3:], zero, one[:, :-3]]) for one in (v, a))
    return Motion(time, np.hstack([q[:, -3:], still, q[:, :-3]]), *rates)


def recorded(rate: float, slow: float, noise: float, late: float) -> tuple[Motion, Markers]:
    """Return a movement, and its markers with white ``noise`` m whose frames are off by ``late`` s, sd, each."""
    rng, time = np.random.default_rng(3), np.arange(int(SECONDS * rate)) / rate
    q = movement(time + rng.normal(0, late, time.size), slow).q
    xyz = poses(WOMAN, q).points(WOMAN.markers.segment, WOMAN.markers.position)
    return movement(time, slow), Markers(WOMAN.markers.names, time, xyz + rng.normal(0, noise, xyz.shape))


def error(truth: Motion, q: Array, cutoff: float) -> float:
    """Return how far the wrench of postures ``q``, filtered, is from the true one, a second from the ends: N and N·m
    about the lab origin, RMS.
    """
    inner = (truth.time > 1) & (truth.time < truth.time[-1] - 1)
    found = predict_wrench(WOMAN, smooth(WOMAN, truth.time, q, settings=LowPass(cutoff=cutoff)))
    return float(np.sqrt(np.mean((found.value - predict_wrench(WOMAN, truth).value)[inner] ** 2)))


@pytest.mark.parametrize(
    ("rate", "slow", "noise", "late"),
    [
        (30.0, 1.0, 0.0002, 0.003),  # stamps of when a frame arrived
        (30.0, 0.5, 0.002, 0.0),
        (60.0, 1.5, 0.001, 0.0),
        (100.0, 0.7, 0.0005, 0.0),
        (100.0, 2.0, 0.0005, 0.0),
        (250.0, 3.0, 0.001, 0.0),
        (1000.0, 1.0, 0.002, 0.0),
    ],
)
def test_no_usual_cutoff_tells_the_wrench_better(rate, slow, noise, late):
    truth, markers = recorded(rate, slow, noise, late)
    cutoff, q = own_cutoff(Followed(WOMAN, markers), LowPass()), solve_ik(WOMAN, markers).q
    others = {fixed: error(truth, q, fixed) for fixed in FIXED if fixed < rate / 2}
    assert error(truth, q, cutoff) <= 1.05 * min(others.values())


@pytest.mark.parametrize("noise", [0.0005, 0.004])
def test_a_trial_gets_its_cutoff_and_a_sentence(noise):
    _, markers = recorded(100.0, 1.0, noise, 0.0)
    trial = Trial("squat", "fit", markers, (), Source(Path("squat.c3d"), "", "c3d"))
    cutoff = asked_cutoff(trial, Followed(WOMAN, markers))
    found = with_cutoff(trial, cutoff)
    assert found.settings == USUAL.changed({"filter.cutoff": own_cutoff(Followed(WOMAN, markers), LowPass())})
    assert found.history == (
        f"Cut-off of the low-pass: {cutoff:g} Hz, where the filtered markers of this trial lie nearest to the path of "
        "rigid segments.",
    )


def test_more_noise_lowers_the_cutoff_and_a_faster_movement_raises_it():
    calm, shaken, fast = (
        own_cutoff(Followed(WOMAN, recorded(100.0, *how)[1]), LowPass())
        for how in ((1.0, 0.0005, 0.0), (1.0, 0.004, 0.0), (2.0, 0.0005, 0.0))
    )
    assert shaken < calm < fast


def test_what_the_markers_cannot_tell_is_left_as_it_is():
    _, markers = recorded(100.0, 1.0, 0.001, 0.0)
    trial = Trial("squat", "fit", markers, (), Source(Path("squat.c3d"), "", "c3d"))
    chosen = replace(trial, settings=USUAL.changed({"filter.cutoff": 8}))
    legs = markers.select(("LASI", "RASI", "LKNE"))
    short = Markers(markers.names, markers.time[:20], markers.xyz[:20])
    for one, worn in ((chosen, markers), (replace(trial, role="static"), markers), (trial, legs), (trial, short)):
        assert asked_cutoff(one, Followed(WOMAN, worn)) is None


def test_gaps_of_a_few_markers_change_little():
    _, markers = recorded(100.0, 1.0, 0.001, 0.0)
    xyz = np.array(markers.xyz)
    xyz[300:420, [3, 8, 20]] = np.nan
    whole, gappy = (
        own_cutoff(Followed(WOMAN, Markers(markers.names, markers.time, one)), LowPass()) for one in (markers.xyz, xyz)
    )
    assert gappy == pytest.approx(whole, abs=0.3)


def test_a_posture_that_steps_where_markers_come_and_go_is_no_noise():
    """Markers never sit where the body has them: without some of them it stands some millimetres elsewhere for 1 s."""
    _, markers = recorded(50.0, 2.0, 0.0003, 0.0)
    whole = np.array(markers.xyz)[:200] + 0.01 * np.random.default_rng(4).normal(size=markers.xyz.shape[1:])
    gappy = whole.copy()
    gappy[60:110, [markers.names.index(name) for name in ("RASI", "LKNE", "RKNE", "C7")]] = np.nan
    seen, unseen = (Markers(markers.names, markers.time[:200], xyz) for xyz in (whole, gappy))
    expected = own_cutoff(Followed(WOMAN, seen), LowPass())
    assert own_cutoff(Followed(WOMAN, unseen), LowPass()) == pytest.approx(expected, abs=0.4)
