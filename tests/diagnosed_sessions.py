"""Sessions that obey their model but for what a test hides, as diagnosis sees them: no files, no markers, one plate."""

from functools import cache
from pathlib import Path

import numpy as np
from scipy.fft import idct
from scipy.interpolate import CubicSpline, make_interp_spline

from biodance.body.human.human import human
from biodance.diagnosis.problem import TrialWindow
from biodance.effects import wrench_about_origin
from biodance.motion.dynamics import predict_wrench
from biodance.records import CHANNELS, Motion, Plate, Source, Subject, Trial, Wrench
from biodance.uncertainty.bands import BANDS
from biodance.uncertainty.tolerances import Tolerances

SUBJECT = Subject(70.0, 1.75, "M", 30.0)
RATE, SECONDS = 50.0, 12.0
CORNERS = np.array([[0.6, 0.5, 0.0], [0.2, 0.5, 0.0], [0.2, -0.1, 0.0], [0.6, -0.1, 0.0]])
MOVED = 1e6
"""N², N²·m²: no session here needs more than what the noise was learned on."""
NOISE = np.array([0.6, 0.6, 0.8, 0.4, 0.4, 0.3])
"""N, N·m: standard deviation of one coefficient."""


@cache
def body():
    """Return the body of the subject."""
    return human(SUBJECT)


def known() -> Tolerances:
    """Return tolerances that hold for these sessions: noise only, and installed plates."""
    bands = len(BANDS)
    sizes = {f"plate_offset {c}": 0.3 for c in CHANNELS} | {f"plate_gain {c}": 0.002 for c in CHANNELS[:3]}
    noise = np.tile(np.diag(NOISE**2), (bands, 1, 1))
    return Tolerances(sizes, noise, np.full((bands, 6), MOVED))


def motion(seed: int) -> Motion:
    """Return smooth movement of all joints over the middle of the plate."""
    rng = np.random.default_rng(seed)
    one, time = body(), np.arange(0, SECONDS, 1 / RATE)
    knots = np.arange(0, SECONDS + 2, 0.8)
    half = 0.25 * (one.limits.upper - one.limits.lower)
    curve = CubicSpline(knots, rng.uniform(-1, 1, (knots.size, half.size)) * half)
    place = CubicSpline(knots, rng.normal(0, 0.03, (knots.size, 3)))
    q, v, a = np.tile(one.neutral, (time.size, 1)), np.zeros((time.size, one.nv)), np.zeros((time.size, one.nv))
    turn = one.neutral[3:7]
    q[:, :3] = np.array([0.4, 0.2, 0.95]) + place(time)
    q[:, 3:7], q[:, 7:], v[:, 6:], a[:, 6:] = turn, curve(time), curve(time, 1), curve(time, 2)
    up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    v[:, :3], a[:, :3] = place(time, 1) @ up.T, place(time, 2) @ up.T
    return Motion(time, q, v, a)


def noise(rng: np.random.Generator, frames: int) -> np.ndarray:
    """Return (T, 6) noise whose coefficients have the standard deviations `NOISE` up to 10 Hz (25 Hz samples see it
    unaliased).
    """
    value = np.zeros((frames, 6))
    low = int(10.0 * 2 * frames / RATE)
    value[:low] = rng.normal(size=(low, 6)) * NOISE * np.sqrt(2.0)
    return np.asarray(idct(value, axis=0, norm="ortho"))


def nothing(wrench, session, moving):
    """Hide nothing."""
    return wrench


def windows(seed: int, *, trials: int = 4, hidden=nothing, unlike: float = 0.7) -> tuple[TrialWindow, ...]:
    """Return trials of a person whose parameters differ from the table by ``unlike`` of its own standard deviations;
    ``hidden`` changes the wrench.
    """
    from biodance.uncertainty.caution import widened_prior

    rng = np.random.default_rng(1000 + seed)
    prior = widened_prior(body().sip)
    phi = prior.phi + unlike * symmetric_root(prior.covariance) @ rng.normal(size=prior.phi.size)
    found = []
    for k in range(trials):
        moving = motion(10 * seed + k)
        share = (k / trials, (k + 1) / trials)
        session = np.linspace(*share, moving.time.size)
        value = hidden(predict_wrench(body(), moving, phi).value, session, moving)
        value = value + wrench_about_origin(noise(rng, moving.time.size), CORNERS.mean(axis=0))
        plate = Plate("plate1", 2, CORNERS, Wrench(moving.time, value))
        trial = Trial(f"t{k}", "fit", None, (plate,), Source(Path(f"t{k}.c3d"), "", "test"))
        found.append(TrialWindow(trial, moving, np.ones(moving.time.size, dtype=bool), *share))
    return tuple(found)


def symmetric_root(covariance):
    """Return the root (p, p) of a covariance (p, p) that hangs on no signs or order of eigenvectors."""
    scale = np.sqrt(np.diag(covariance))
    value, vector = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * (vector * np.sqrt(np.maximum(value, 0.0))) @ vector.T


def delay(wrench, session, moving, *, late=0.02):
    """Hide that the forces come ``late`` s late."""
    return make_interp_spline(moving.time, wrench, k=5)(np.clip(moving.time - late, 0, None))


def pull(wrench, session, moving):
    """Hide a cable that pulls sideways with 8 N, one metre over the lab's origin, 1.3 times a second."""
    force = np.outer(8.0 * np.sin(2 * np.pi * 1.3 * moving.time), [0.0, 1.0, 0.0])
    return wrench + np.concatenate([force, np.cross([0.0, 0.0, 1.0], force)], axis=1)


def offset(newton: float):
    """Return a hiding of an offset of Fx."""
    return about_plate(lambda local, session: local + newton * np.eye(6)[0])


def gain(share: float):
    """Return a hiding of a gain of Fz that is too large by ``share``."""
    return about_plate(lambda local, session: local * (1 + share * np.eye(6)[2]))


def about_plate(change):
    """Return a hiding of ``change`` (T, 6) -> (T, 6) of the wrench about the plate's centre."""
    centre = CORNERS.mean(axis=0)

    def hidden(wrench, session, moving):
        local = np.concatenate([wrench[:, :3], wrench[:, 3:] - np.cross(centre, wrench[:, :3])], axis=1)
        local = change(local.copy(), session)
        return np.concatenate([local[:, :3], local[:, 3:] + np.cross(centre, local[:, :3])], axis=1)

    return hidden
