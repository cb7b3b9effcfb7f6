"""A session that obeys its model, with known true parameters, as the pipeline hands it to identification: no
markers, no files.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from biodance.body.human.human import human
from biodance.identification.added_mass import scaled_to_mass
from biodance.identification.identification import Identification, identify_body
from biodance.identification.loads import compact_load
from biodance.motion.dynamics import compare, predict_wrench
from biodance.pipeline.identification import identify_trials
from biodance.pipeline.results import Placed, SessionResult
from biodance.pipeline.trial import TrialResult, WrenchComparison, trial_fit
from biodance.records import Motion, Session, Source, Subject, Trial, Wrench

SUBJECT = Subject(62.0, 1.70, "F", 30.0, "S01")
RATE = 50.0


def body():
    """Return the generic body of the subject."""
    return human(SUBJECT)


def movement(moving, seed: int, *, seconds: float) -> Motion:
    """Return smooth random movement of all joints above fixed hips."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / RATE)
    knots = np.arange(0, seconds + 2, 0.8)
    half = 0.35 * (moving.limits.upper - moving.limits.lower)
    curve = CubicSpline(knots, rng.uniform(-1, 1, (knots.size, half.size)) * half)
    q, v, a = (
        np.tile(moving.neutral, (time.size, 1)),
        np.zeros((time.size, moving.nv)),
        np.zeros((time.size, moving.nv)),
    )
    q[:, 2] = 0.9
    q[:, 7:], v[:, 6:], a[:, 6:] = curve(time), curve(time, 1), curve(time, 2)
    return Motion(time, q, v, a)


def truth(*, load: float = 0.0) -> np.ndarray:
    """Return true parameters: thighs heavier than the table's, the trunk lighter, and a load on the left forearm."""
    one = body()
    phi = np.array(one.sip.phi).reshape(-1, 10)
    for name, factor in (("left_thigh", 1.15), ("right_thigh", 1.1), ("trunk_head", 0.89)):
        phi[one.segment_index(name)] *= factor
    phi *= SUBJECT.mass / phi[:, 0].sum()
    phi[one.segment_index("left_forearm_hand")] += load * compact_load(np.array([0.0, -0.2, 0.02]))
    return phi.ravel()


def trial_result(name: str, role: str, seed: int, *, seconds: float = 15.0, load: float = 0.0) -> TrialResult:
    """Return a tracked trial whose plates measured the true parameters' wrench, with noise."""
    one = body()
    motion = movement(one, seed, seconds=seconds)
    noise = np.random.default_rng(100 + seed).normal(size=(motion.time.size, 6)) * [1, 1, 2, 0.5, 0.5, 0.3]
    measured, table = predict_wrench(one, motion, truth(load=load)).value + noise, predict_wrench(one, motion)
    used = motion.time > 0.3
    found = compare(Wrench(motion.time, measured), table, used)
    comparison = WrenchComparison(
        motion.time, measured, table.value, used, found.rms, np.array(found.correlation, dtype=float)
    )
    trial = Trial(name, role, None, (), Source(Path(f"/lab/S01/{name}.c3d"), "00" * 32, "C3D", RATE, 1000.0))
    return TrialResult(trial, (), motion=motion, comparison=comparison)


@cache
def session_result(*, load: float = 0.0, roles: tuple[str, ...] = ("fit", "validate"), seed: int = 1) -> SessionResult:
    """Return a session with one trial per role, identified where one is to be fitted."""
    trials = tuple(trial_result(f"{role}_{i}", role, seed + i, load=load) for i, role in enumerate(roles))
    session = Session(SUBJECT, tuple(t.trial for t in trials), Path("/lab/S01"))
    result = SessionResult(session, Placed(body(), "From stature alone."), (), trials)
    return replace(result, identification=identify_trials(body(), trials, name="S01")) if "fit" in roles else result


def declared(result: SessionResult, mass: float) -> Identification:
    """Return the identification of the fitted trials of a session whose analyst declared ``mass`` kg."""
    assert result.body is not None
    fits = tuple(fit for one in result.trials if one.trial.role == "fit" and (fit := trial_fit(one)) is not None)
    return identify_body(replace(result.body, sip=scaled_to_mass(result.body.sip, mass)), fits)
