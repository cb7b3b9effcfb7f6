"""Smooth trials of random bodies with known truth, for the tests of identification."""

from dataclasses import replace

import numpy as np
from random_bodies import random_body
from scipy.interpolate import CubicSpline

from biodance.body.body import Body
from biodance.identification.statistics import Fit
from biodance.motion.dynamics import predict_wrench
from biodance.records import Array, Motion, Sip, Wrench


def smooth_motion(body: Body, rng: np.random.Generator, *, frames: int = 2000, size: float = 0.5) -> Motion:
    """Return a smooth motion at 100 Hz: all joints and the root's place."""
    time = np.arange(frames) / 100
    knots = np.arange(0, time[-1] + 1.5, 0.5)
    curve = CubicSpline(knots, rng.normal(0, size, (knots.size, len(body.joints))))
    place = CubicSpline(knots, rng.normal(0, 0.1 * size, (knots.size, 3)))
    q = np.tile(body.neutral, (frames, 1))
    v, a = np.zeros((frames, body.nv)), np.zeros((frames, body.nv))
    q[:, 7:], v[:, 6:], a[:, 6:] = curve(time), curve(time, 1), curve(time, 2)
    turn = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    q[:, :3], v[:, :3], a[:, :3] = place(time), place(time, 1) @ turn.T, place(time, 2) @ turn.T
    return Motion(time, q, v, a)


def noisy_fit(body: Body, motion: Motion, phi: Array, rng: np.random.Generator, *, size: float = 1.0) -> Fit:
    """Return a trial of ``body`` with parameters ``phi`` and white noise of ``size`` times 2 N, 0.5 N·m."""
    clean = predict_wrench(body, motion, phi).value
    noise = size * rng.normal(size=clean.shape) * [2, 2, 2, 0.5, 0.5, 0.5]
    return Fit("t", motion, Wrench(motion.time, clean + noise), np.ones(motion.time.size, dtype=bool))


def person(seed: int, *, segments: int = 4, spread: float = 0.1) -> tuple[Body, Array, np.random.Generator]:
    """Return a body whose table is wrong by its own standard deviations, the true parameters, and the generator."""
    rng = np.random.default_rng(seed)
    body = random_body(rng, n_segments=segments)
    truth = np.array(body.sip.phi)
    sd = spread * np.abs(truth) + 1e-3
    return replace(body, sip=Sip(body.segments, truth + sd * rng.normal(size=truth.size), np.diag(sd**2))), truth, rng
