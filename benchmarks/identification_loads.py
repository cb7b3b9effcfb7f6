"""Loads put on the segments of a recorded visit: their own wrench, of their true motion, is added to the plates."""

from dataclasses import replace

import numpy as np
from gathered_visits import Gathered
from identification_tables import ARM, LOADS, Load
from virtual_visits import TrackedVisit

from biodance.body.parts import GRAVITY
from biodance.identification.added_mass import added_mass
from biodance.identification.identification import Identification
from biodance.identification.learning import learn_noise
from biodance.identification.loads import with_unknown_load
from biodance.identification.mismatch import mismatch
from biodance.identification.statistics import Fit, Statistics
from biodance.lab.filters import LowPass, low_pass
from biodance.motion.kinematics import segment_motion
from biodance.motion.regressor import regressor_of
from biodance.records import Array, Motion
from biodance.uncertainty.caution import widened
from biodance.virtual_lab.truth import MERGED


def loads_table(reference: Identification, later: Gathered) -> list[Load]:
    """Return for every segment and load what is found with the reference and without, at the noise of the unloaded
    session.
    """
    extra = _with_loads(later)
    kinds = [(segment, mass) for segment in MERGED for mass in LOADS]
    return [_load(reference, later, _combined(later, extra, segment, mass), segment, mass) for segment, mass in kinds]


def loaded_arm(reference: Identification, later: Gathered) -> Load:
    """Return the same for the arm's load, with noise and disturbances learned from the loaded session itself."""
    total = _combined(later, _with_loads(later), *ARM)
    noise, _ = learn_noise(total, with_unknown_load(later.visit.body, widened(later.visit.body.sip)))
    found = mismatch(later.visit.body, later.visit.fits, noise)
    return _load(reference, replace(later, noise=noise, found=found), total, *ARM)


def _load(reference: Identification, later: Gathered, total: Statistics, segment: str, mass: float) -> Load:
    session = replace(later, total=total).identified()
    place = _place_in_model(later.visit, later.visit.body.segment_index(segment))
    return segment, mass, added_mass(session, reference=reference), added_mass(session), place


def _place_in_model(one: TrackedVisit, s: int) -> Array:
    """Return the load's place (3,) m in the model's frame of segment ``s``."""
    frame = one.frames[s]
    return frame[:, :3] @ _place(one, s) + frame[:, 3]


def _place(one: TrackedVisit, s: int) -> Array:
    """Return where a load sits, in the true joint frame: 6 cm outwards of the true CoM of a segment (trunk, pelvis:
    10 cm behind).
    """
    away = {"r": (0.0, 0.0, 0.06), "l": (0.0, 0.0, -0.06)}.get(tuple(MERGED)[s][0], (-0.10, 0.0, 0.0))
    own = one.true_own.reshape(-1, 10)[s]
    return own[1:4] / own[0] + away


def _with_loads(got: Gathered) -> Statistics:
    """Return the statistics of [W, wrench of 1 kg on each segment, y]."""
    one, layout = got.visit, got.total.layout
    p = 10 * len(one.body.segments) + len(one.body.segments)
    gram, count = np.zeros((len(got.total.count), 6, p + 1, 6, p + 1)), np.zeros_like(got.total.count)
    for fit in one.fits:
        unit = np.stack([_unit_wrench(one, fit, s) for s in range(len(one.body.segments))], axis=2)
        for pick in layout.bands.runs(fit.use, fit.motion.rate):
            part = Motion(fit.motion.time[pick], fit.motion.q[pick], fit.motion.v[pick], fit.motion.a[pick])
            W = regressor_of(segment_motion(one.body, part), gravity=one.body.gravity)
            X = layout.bands.coefficients(
                layout.shift @ np.concatenate([W, unit[pick], fit.wrench.value[pick][:, :, None]], axis=2)
            )
            band = layout.bands.of(len(X))
            for b in np.unique(band[band >= 0]):
                flat = X[band == b].reshape(-1, 6 * (p + 1))
                gram[b] += (flat.T @ flat).reshape(6, p + 1, 6, p + 1)
                count[b] += len(flat)
    return Statistics(gram, count, layout)


def _unit_wrench(one: TrackedVisit, fit: Fit, s: int) -> Array:
    """Return the wrench (T, 6) of 1 kg at its place on a segment, as it truly moves, low-passed like the plates."""
    from scipy.interpolate import make_interp_spline

    turn, origin = one.true_poses[fit.name]
    place = origin[:, s] + turn[:, s] @ _place(one, s)
    force = make_interp_spline(fit.motion.time, place, k=5).derivative(2)(fit.motion.time) - GRAVITY
    return low_pass(np.concatenate([force, np.cross(place, force)], axis=1), fit.motion.rate, LowPass())


def _combined(later: Gathered, extra: Statistics, segment: str, mass: float) -> Statistics:
    """Return the statistics with ``mass`` kg on ``segment``: y + mass times its unit wrench; ``extra`` from
    `_with_loads`.
    """
    count, s = len(later.visit.body.segments), later.visit.body.segment_index(segment)
    p = 10 * count
    turn = np.zeros((p + count + 1, p + 1))
    turn[:p, :p] = np.eye(p)
    turn[-1, -1], turn[p + s, -1] = 1.0, mass
    gram = np.einsum("bcidj,ik,jl->bckdl", extra.gram, turn, turn, optimize=True)
    return Statistics(gram, later.total.count, later.total.layout)
